"""Offset tables of raw Trinity takes: where motion and audio start together.

Two are around. StyleGestures's ``offsets.csv`` has no header and seven columns: name, first and
last frame (at 30 fps; -1 for the end), offset of the motion in 30 fps frames, the same in rows of
the BVH file, its rate, offset of the audio in seconds. A take in two pieces has two rows. The
datasets' ``AlignmentTimes.csv`` has a header (Take, AudioStart, MotionStart; seconds).
"""

from __future__ import annotations

import re
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

from cospeech.errors import ContentError
from cospeech.foreign import understood
from cospeech.formats.mocap.takes import Excerpt
from cospeech.formats.tables import Row, columns_of, read_table

TABLE_NAMES = ("offsets.csv", "AlignmentTimes.csv")
_COLUMNS = {
    "take": ("take", "name", "file", "filename"),
    "audio": ("audiostart", "audio_start"),
    "motion": ("motionstart", "motion_start"),
}
_TABLE_FPS = 30.0
_MOST_SECONDS = 3600.0
_MOST_FRAMES = 1e6


@dataclass(frozen=True, eq=False)
class OffsetTable:
    """Excerpts of raw takes.

    Attributes:
        path: The table.
        excerpts: Take number -> its pieces, in the table's order.
    """

    path: Path
    excerpts: dict[int, list[Excerpt]]


def find_offsets(motion: Path, root: Path, table: str | Path | None = None) -> OffsetTable | None:
    """The table that holds for a motion file: the given one, else of the nearest folder above it.

    Args:
        motion: The motion file, below ``root``.
        root: Where the search ends.
        table: A table for all.

    Raises:
        InputFileError: The table can't be read.
    """
    if table is not None:
        return read_offsets(Path(table))
    for folder in motion.parents:
        for name in TABLE_NAMES:
            if (folder / name).is_file():
                return read_offsets(folder / name)
        if folder == root:
            break
    return None


def read_offsets(path: Path) -> OffsetTable:
    """Read either kind of table.

    Raises:
        InputFileError: Neither kind; a time or rate is missing, negative or absurd. Names the line.
    """
    rows = read_table(path)
    excerpts: dict[int, list[Excerpt]] = defaultdict(list)
    spelled = " ".join(rows[0].fields).lower()
    with understood(path, "an offset table"):
        if "audio" in spelled and "motion" in spelled:
            columns = columns_of(rows[0], _COLUMNS)
            for row in rows[1:]:
                motion, audio = (_seconds(row, columns[name]) for name in ("motion", "audio"))
                excerpts[_take_number(row, columns["take"])].append(Excerpt(motion, audio))
        else:
            for row in rows[1:] if "offset" in spelled else rows:
                excerpts[_take_number(row, 0)].append(_by_frames(row))
    return OffsetTable(path, dict(excerpts))


def _by_frames(row: Row) -> Excerpt:
    start, stop, offset, rate = (row.number(column) for column in (1, 2, 4, 5))
    if not (1 <= rate <= 1000 and 0 <= start <= _MOST_FRAMES and stop <= _MOST_FRAMES):
        raise ContentError(
            f"{', '.join(row.fields)[:100]!r} is not name, start, stop, offset at 30 fps, offset in"
            " BVH rows, BVH rows per second, offset of the audio in seconds",
            row.place,
        )
    motion_start = (int(start * rate / _TABLE_FPS) - offset) / rate
    audio_start = start / _TABLE_FPS + row.number(6)
    duration = (stop - start) / _TABLE_FPS if stop > 0 else None
    if not (0 <= motion_start <= _MOST_SECONDS and 0 <= audio_start <= _MOST_SECONDS) or (
        duration is not None and duration <= 0
    ):
        raise ContentError(
            f"the piece starts at {motion_start:g} s of the motion and {audio_start:g} s of the"
            f" audio and lasts {'to the end' if duration is None else f'{duration:g} s'}",
            row.place,
            "a piece lies inside both files",
        )
    return Excerpt(motion_start, audio_start, duration)


def _take_number(row: Row, column: int) -> int:
    numbers = re.findall(r"\d+", re.sub(r"\.0+$", "", row.cell(column)))
    if not numbers or len(numbers[-1]) > 4:
        raise ContentError(f"{row.cell(column)[:40]!r} is no take", row.place)
    return int(numbers[-1])


def _seconds(row: Row, column: int) -> float:
    value = row.number(column)
    if not 0 <= value <= _MOST_SECONDS:
        raise ContentError(f"{value:g} s is not a place in a take", row.place)
    return value
