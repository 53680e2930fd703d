"""Clock times as subtitles and annotation tools write them."""

from __future__ import annotations

import re

CLOCK = r"(?:(\d{1,3}):)?(\d{1,2}):(\d{1,2})(?:[.,](\d{1,6}))?"
"""Hours (may be left out), minutes, seconds, fraction (may be left out)."""

_WHOLE = re.compile(rf"\s{{0,9}}{CLOCK}\s{{0,9}}")


def clock_seconds(text: str) -> float | None:
    """Seconds of a text like ``00:00:01,500``; None where it is no clock time."""
    found = _WHOLE.fullmatch(text)
    return None if found is None else seconds_of(found.groups())


def seconds_of(parts: tuple[str | None, ...]) -> float:
    """Seconds of the four groups of `CLOCK`."""
    hours, minutes, seconds, fraction = parts
    whole = int(hours or 0) * 3600 + int(minutes or 0) * 60 + int(seconds or 0)
    digits = fraction or "0"
    parts_of_one = 10 ** len(digits)
    return (whole * parts_of_one + int(digits)) / parts_of_one
