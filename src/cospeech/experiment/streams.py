"""Printing that never ends a run: any terminal, a reader that left, a full disk."""

from __future__ import annotations

import io
import sys
from typing import Any


class _KeepsGoing(io.FileIO):
    """A stream of the process whose failures to write are nobody's business but the reader's."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data)
        except OSError:
            return memoryview(data).nbytes


def keep_printing() -> None:
    """Make stdout and stderr of this process take every text and never raise.

    Letters that the terminal can't show are written as escapes. What can't be written, because the
    reader of a pipe has left or the disk under a redirection is full, is left out.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None or stream is not getattr(sys, f"__{name}__"):
            continue  # closed, or taken over by whoever imported us
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
