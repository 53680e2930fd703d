"""Patterns of words: which words of a transcript are meant."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from cospeech.errors import ConfigError, CospeechError
from cospeech.foreign import linear_pattern

MOST_PATTERN_CHARACTERS = 200
LONGEST_WORD = 40
"""Characters; nothing longer is a word."""

_EDGES = re.compile(r"^[\W_]+|[\W_]+\Z")
_ESCAPE_OR_BRACKET = re.compile(r"\\.|\[\^?\]?|\]", re.DOTALL)
_CLASSES = {
    r"\w": r"\p{L}\p{M}\p{N}_",
    r"\W": r"\p{Pd}\p{Ps}\p{Pe}\p{Pi}\p{Pf}\p{Po}\p{S}\p{Z}\p{C}",
    r"\d": r"\p{Nd}",
    r"\D": r"\P{Nd}",
}


@dataclass(frozen=True)
class WordPattern:
    """A regular expression that the whole word has to match, upper or lower case.

    A search takes time in proportion to the word, whatever the expression says; look-around and
    references back to a group aren't known.

    Attributes:
        text: The expression, e.g. ``"big|huge|enormous"``.

    Raises:
        ConfigError: It is no such expression, or too long.
    """

    text: str
    _regex: Any = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not self.text.strip():
            raise ConfigError("the pattern of words is empty", 'give words, e.g. "big|huge"')
        if len(self.text) > MOST_PATTERN_CHARACTERS:
            raise ConfigError(
                f"the pattern of words {self.text[:40]!r}... has {len(self.text)} characters, more"
                f" than {MOST_PATTERN_CHARACTERS}",
                "join several shorter ones: word(...) or word(...)",
            )
        spelled = _in_every_alphabet(unicodedata.normalize("NFC", self.text))
        try:
            regex = linear_pattern(spelled, ignore_case=True)
        except CospeechError as error:
            raise ConfigError(
                f"the pattern of words {self.text!r} can't be taken: {error.problem}",
                f"give words, e.g. big|huge|enormous; {error.hint}",
            ) from None
        object.__setattr__(self, "_regex", regex)

    def matches(self, word: str) -> bool:
        """Whether a word is meant, as it is or without the punctuation around it."""
        if len(word) > 2 * LONGEST_WORD:
            return False
        # Transcripts of some systems spell an accented letter as two characters, and half a
        # surrogate pair is no character at all.
        word = unicodedata.normalize("NFC", word.encode("utf-8", "replace").decode())
        forms = {word.strip(), _EDGES.sub("", word)}
        return any(
            0 < len(form) <= LONGEST_WORD and self._regex.fullmatch(form) is not None
            for form in forms
        )

    def among(self, vocabulary: Iterable[str]) -> list[int]:
        """Indices of the words that are meant."""
        return [i for i, word in enumerate(vocabulary) if self.matches(word)]


def _in_every_alphabet(pattern: str) -> str:
    r"""The pattern with ``\w`` and ``\d`` spelt out, which are a to z and 0 to 9 alone in RE2."""
    inside = False

    def spelled(found: re.Match[str]) -> str:
        nonlocal inside
        sign = found.group()
        if sign.startswith("[") and not inside:
            inside = True
        elif sign == "]":
            inside = False
        elif sign in _CLASSES:
            return _CLASSES[sign] if inside else f"[{_CLASSES[sign]}]"
        return sign

    return _ESCAPE_OR_BRACKET.sub(spelled, pattern)
