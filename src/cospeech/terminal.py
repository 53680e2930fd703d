"""What every command owes to its terminal: printing that never ends it, and an exit status."""

from __future__ import annotations

import argparse
import errno
import io
import logging
import math
import os
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from types import FrameType
from typing import Any

from cospeech.errors import one_line, plain


class _KeepsGoing(io.FileIO):
    """A stream of the process that takes everything.

    Attributes:
        lost: Why something of it isn't where it should be; None where all is, or where the reader
            has left, which is nobody's business but the reader's.
    """

    lost: OSError | None = None

    def write(self, data: Any) -> int:
        try:
            return super().write(data)
        except OSError as error:
            if self.lost is None and error.errno not in (errno.EPIPE, errno.EIO):
                self.lost = error
            return memoryview(data).nbytes


class Printable(logging.Filter):
    """Texts in what is logged are shown, never obeyed; those that are filled in keep to a line."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Change the record's texts; none is left out."""
        if isinstance(record.args, tuple):
            record.args = tuple(_shown(value) for value in record.args)
        record.msg = plain(record.msg) if isinstance(record.msg, str) else record.msg
        return True


def _shown(value: object) -> object:
    if isinstance(value, str | os.PathLike):
        return one_line(value)
    return plain(value) if isinstance(value, Exception) else value


def keep_printing() -> None:
    """Make stdout and stderr of this process take every text and never raise.

    Letters that the terminal can't show are written as escapes. What can't be written, because the
    reader of a pipe has left or the disk under a redirection is full, is left out.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None or stream is not getattr(sys, f"__{name}__"):
            continue  # closed, or taken over by whoever imported us
        with suppress(OSError, ValueError):
            stream.flush()  # else what it holds would come after all that follows
        try:
            raw = _KeepsGoing(stream.fileno(), "w", closefd=False)
        except (OSError, ValueError):
            continue
        replacement = io.TextIOWrapper(
            io.BufferedWriter(raw),
            encoding=stream.encoding,
            errors="backslashreplace",
            line_buffering=True,
        )
        setattr(sys, name, replacement)


def stop_at_once() -> None:
    """Have Ctrl-C end this process with one line, until `stop_in_order`.

    For a command that is still importing: it has nothing to keep, and the libraries make a
    traceback, or an error of their own, of an interrupt.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not ignored, as by nohup
        signal.signal(signal.SIGINT, _stop)


def stop_in_order() -> None:
    """Have Ctrl-C raise `KeyboardInterrupt` again, if `stop_at_once` has changed that."""
    if signal.getsignal(signal.SIGINT) is _stop:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _stop(number: int, frame: FrameType | None) -> None:
    with suppress(OSError):
        os.write(2, b"\nstopped\n")  # the stream may be in the middle of its own writing
    os._exit(130)


def number_between(least: float, most: float) -> Callable[[str], float]:
    """For `argparse`: what reads an option's text as a number from ``least`` to ``most``."""

    def number(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"a number from {least:g} to {most:g}, not {text}")
        return value

    return number


def exit_status(main: Callable[[], int]) -> int:
    """The exit status of a module that is run: what its `main` returns, without tracebacks.

    Ctrl-C gives 130, a system's refusal (a full disk, no permission) 2 and its reason in one line;
    a reader of the output that has left, as ``head`` does, is no error.
    """
    keep_printing()
    stop_in_order()
    try:
        status = main()
        sys.stdout.flush()
        raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
        if isinstance(raw, _KeepsGoing) and raw.lost is not None:
            raise OSError(raw.lost.errno, raw.lost.strerror, "stdout")
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
