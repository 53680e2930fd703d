"""Terminals that can't show everything."""

from __future__ import annotations

import io
import sys


def replace_unprintable() -> None:
    """Print ``?`` for characters that the encoding of standard output or error lacks.

    Without it an ASCII terminal ends a command, its work done, at the first arrow or umlaut.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
