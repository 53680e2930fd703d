"""Errors that a user can act on: what was wrong, where, and what to do next."""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from pathlib import Path

# Controls (a terminal obeys escape sequences), what turns the direction of all text that follows,
# and halves of surrogate pairs, which no file can be written with. Line ends and tabs stay.
_UNSHOWABLE = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")


def plain(text: object) -> str:
    """A text whose control characters, direction overrides and lone surrogates are U+FFFD."""
    return _UNSHOWABLE.sub("\ufffd", str(text))


def one_line(text: object) -> str:
    """As `plain`, with line ends and tabs as spaces."""
    return re.sub(r"[\n\t\u2028\u2029]", " ", plain(text))


class CospeechError(Exception):
    """Base of every error whose message is written for the person at the keyboard.

    Command lines print it without a traceback, and no terminal obeys what it quotes.

    Args:
        problem: What is wrong, in one or two sentences.
        hint: The next step, e.g. the command or the key that mends it.
    """

    def __init__(self, problem: str, hint: str | None = None) -> None:
        self.problem = problem = plain(problem)
        self.hint = hint = None if hint is None else plain(hint)
        super().__init__(problem if hint is None else f"{problem}\n  -> {hint}")


class InputFileError(CospeechError):
    """A file from outside can't be used.

    Args:
        path: The file.
        problem: What is wrong with it.
        place: Where in it (``"line 12"``, ``"frame 40, joint Hips"``).
        hint: The next step.
    """

    def __init__(
        self, path: str | Path, problem: str, place: str | None = None, hint: str | None = None
    ) -> None:
        self.path = Path(path)
        self.place = place
        # A line end in a file's name would begin a line that seems ours.
        where = one_line(path if place is None else f"{path}, {place}")
        super().__init__(f"{where}: {problem}", hint)


class ContentError(CospeechError):
    """What a file from outside holds can't be used, told by what isn't told the file's name.

    `cospeech.foreign.understood` makes an `InputFileError` of it.

    Args:
        problem: What is wrong with it.
        place: Where in it, as for `InputFileError`.
        hint: The next step.
    """

    def __init__(self, problem: str, place: str | None = None, hint: str | None = None) -> None:
        self.place = place
        super().__init__(problem, hint)


class ConfigError(CospeechError):
    """A combination of settings that can't work, found before anything is computed."""


def require_choice(setting: str, value: object, choices: Collection[object]) -> None:
    """Refuse a value that is none of the choices.

    Raises:
        ConfigError: The message names the setting, its value and the choices.
    """
    if value not in choices:
        known = ", ".join(map(str, choices))
        raise ConfigError(f"{setting}={value!r} is not one of {known}")


def require_range(setting: str, value: float, least: float, most: float | None = None) -> None:
    """Refuse a number below ``least`` or above ``most``, and one that isn't finite.

    Raises:
        ConfigError: The message names the setting, its value and the range.
    """
    if value == math.inf:
        raise ConfigError(f"{setting}={value}: must be finite")
    if not least <= value <= (math.inf if most is None else most):
        wanted = f"at least {least}" if most is None else f"from {least} to {most}"
        raise ConfigError(f"{setting}={value}: must be {wanted}")
