"""Errors that a user can act on: what was wrong, where, and what to do next."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path


class CospeechError(Exception):
    """Base of every error whose message is written for the person at the keyboard.

    Command lines print it without a traceback.

    Args:
        problem: What is wrong, in one or two sentences.
        hint: The next step, e.g. the command or the key that mends it.
    """

    def __init__(self, problem: str, hint: str | None = None) -> None:
        self.problem = problem
        self.hint = hint
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
        where = str(path) if place is None else f"{path}, {place}"
        super().__init__(f"{where}: {problem}", hint)


class ConfigError(CospeechError):
    """A combination of settings that can't work, found before anything is computed."""


def exit_status(main: Callable[[], int]) -> int:
    """The exit status of a module that is run: what its `main` returns, without tracebacks.

    Ctrl-C gives 130, a system's refusal (a full disk, no permission) 2 and its reason in one line;
    a reader of the output that has left, as ``head`` does, is no error.
    """
    try:
        status = main()
        sys.stdout.flush()
    except KeyboardInterrupt:
        print("\nstopped", file=sys.stderr)
        return 130
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w")  # noqa: PTH123, SIM115  # or Python complains at exit
        return 0
    except OSError as error:
        where = "" if error.filename is None else f"{error.filename}: "
        print(f"error: {where}{error.strerror or error}", file=sys.stderr)
        return 2
    except MemoryError:
        print("error: the memory isn't enough", file=sys.stderr)
        return 2
    return status
