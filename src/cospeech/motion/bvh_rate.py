"""The frame rate of a BVH file, by what its header and its rows say together."""

from __future__ import annotations

from decimal import Decimal, InvalidOperation
from pathlib import Path

from cospeech.errors import InputFileError
from cospeech.motion.bvh_rows import decoded, tolerated_rows

PLAUSIBLE_FPS = (5.0, 250.0)
"""Rates that motion capture is kept at: others aren't advised, and mean that a file is cut off."""

_LONGEST_NUMBER = 60
"""Characters of a frame count or a frame time."""


def checked_rate(count: bytes, frame_time: bytes, rows: int, path: Path) -> tuple[float, str]:
    """Frames per second by the header, when it agrees with the rows.

    Args:
        count: What the header says after ``Frames:``.
        frame_time: What it says after ``Frame Time:``.
        rows: How many rows follow, one at least.
        path: For messages.

    Returns:
        The rate, and what is odd about the header all the same; empty when nothing is.

    Raises:
        InputFileError: The frame time is no duration, or the header says far more or fewer frames
            than there are rows.
    """
    shown_time = decoded(frame_time[:40])
    try:
        if len(frame_time) > _LONGEST_NUMBER:
            raise ValueError("longer than any duration")
        rate = _frame_rate(Decimal(decoded(frame_time)))
    except (InvalidOperation, ValueError, OverflowError):
        raise InputFileError(
            path,
            f"frame time {shown_time!r} is not a duration in seconds",
            hint="give the rate of the rows: read_bvh(..., frame_rate=30), or data.frame_rate=30",
        ) from None
    is_count = count.isdigit() and len(count) < 12
    said = int(count) if is_count else None
    if said == rows:
        return rate, ""
    if said is not None and abs(said - rows) <= tolerated_rows(rows):
        return rate, f"the header says {said} frames, {rows} rows follow and are read"
    raise _contradiction(said, decoded(count[:40]), rate, rows, path)


def _contradiction(
    said: int | None, shown: str, rate: float, rows: int, path: Path
) -> InputFileError:
    told = shown if said is None else f"{said} frames at {rate:g} fps ({said / rate:.1f} s)"
    hint = (
        f"if the rows are at {rate:g} fps, write 'Frames: {rows}' into the file; or pass"
        f" frame_rate={rate:g} (data.frame_rate={rate:g}, for all files of a corpus)"
    )
    implied = _implied_rate(said, rate, rows) if said else 0.0
    if said and PLAUSIBLE_FPS[0] <= implied <= PLAUSIBLE_FPS[1]:
        hint = (
            f"if the {rows} rows last those {said / rate:.1f} s, they are at {implied:g} fps: pass"
            f" frame_rate={implied:g} to read_bvh, or set data.frame_rate={implied:g}; if they are"
            f" at {rate:g} fps after all, give that number"
        )
    return InputFileError(path, f"the header says {told}, but {rows} rows follow", hint=hint)


def _implied_rate(said: int, rate: float, rows: int) -> float:
    """Rate at which the rows last as long as the header says."""
    ratio = said / rows
    stride = round(ratio)
    # a file that keeps every n-th frame often drops a few at the end as well
    if stride >= 2 and abs(ratio - stride) < 0.02 * stride:
        return round(rate / stride, 3)
    return round(rate / ratio, 3)


def _frame_rate(seconds: Decimal) -> float:
    """The rate meant by a rounded frame time: 0.033333 is 30 fps, not 30.0003."""
    value = float(seconds)
    if not 1e-5 < value < 60:
        raise ValueError("not the duration of a frame")
    rate = 1.0 / value
    exponent = seconds.as_tuple().exponent
    digits = -exponent if isinstance(exponent, int) else 0
    tolerance = max(10.0**-digits, 1e-9) if digits >= 4 else 1e-9
    whole = round(rate)
    return float(whole) if whole >= 1 and abs(1.0 / whole - value) < tolerance else rate
