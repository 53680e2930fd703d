"""A raw file of the UCI Gesture Phase set, as it is."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import ContentError
from cospeech.foreign import understood
from cospeech.formats.phase_files.labels import normalised, phase_meanings
from cospeech.formats.tables import read_table
from cospeech.motion.phases import PHASE_INDEX

FILE_JOINTS = ("left_hand", "right_hand", "head", "spine", "left_wrist", "right_wrist")
"""The file's joints, in its order."""

_COLUMNS = [f"{joint}{axis}" for joint in ("lh", "rh", "h", "s", "lw", "rw") for axis in "xyz"]
_COLUMNS += ["timestamp", "phase"]
_MOST_BYTES = 2**26
_LONGEST_S = 2 * 3600.0
"""The set's recordings last minutes; memory follows the time that the rows claim."""

_MOST_UNORDERED = 0.05

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class UciTable:
    """A raw file as it is.

    Attributes:
        times_s: ``(T,)`` decoded timestamps, s.
        values: ``(T, 6, 3)`` in the file's units, joints as `FILE_JOINTS`.
        labels: ``(T,)`` int8 into `cospeech.motion.phases.PHASES`; rest is ``rest_hold``.
    """

    times_s: NDArray[np.float64]
    values: NDArray[np.float64]
    labels: NDArray[np.int8]


def read_uci_table(path: str | Path) -> UciTable:
    """A raw file with its times decoded and its labels named, otherwise as it is.

    A timestamp is the decimal writing of minute, second and millisecond: ``5702026`` is 57:02.026.
    A row that isn't later than the row before it is left out.

    Raises:
        InputFileError: The file can't be read, has other columns, a value that is no number, an
            unknown phase, or times that go back again and again.
    """
    path = Path(path)
    meanings = phase_meanings()
    times: list[float] = []
    values: list[list[float]] = []
    labels: list[int] = []
    unordered = hours = 0
    header, *rows = read_table(path, _MOST_BYTES)
    with understood(path, "a raw file of the UCI set"):
        if [cell.lower() for cell in header.fields] != _COLUMNS:
            problem = f"the header is not {','.join(_COLUMNS)}"
            hint = "take the file from the UCI repository; edited copies are about"
            raise ContentError(problem, "line 1", hint)
        for row in rows:
            if len(row.fields) != len(_COLUMNS):
                problem = f"{len(row.fields)} columns, expected {len(_COLUMNS)}"
                raise ContentError(problem, row.place)
            numbers, stamp = [row.number(column) for column in range(18)], row.number(18)
            label = meanings.get(normalised(row.fields[19]))
            if label is None:
                raise ContentError(f"{row.fields[19]!r} is not a phase", row.place)
            minute, second = divmod(stamp // 1000, 100)
            if not (0 <= minute < 60 and 0 <= second < 60):
                problem = f"the timestamp {row.fields[18][:20]} is not minute, second, ms"
                raise ContentError(problem, row.place)
            time = 3600 * hours + 60 * minute + second + stamp % 1000 / 1000
            if times and time < times[-1] - 1800:
                hours, time = hours + 1, time + 3600
            if times and time - times[0] > _LONGEST_S:
                problem = f"{time - times[0]:.0f} s after the first row; recordings last minutes"
                raise ContentError(problem, row.place, "check the timestamps up to this row")
            if times and time <= times[-1]:
                unordered += 1
                continue
            times.append(time)
            values.append(numbers)
            labels.append(PHASE_INDEX[label])
        if len(times) < 2 or unordered > _MOST_UNORDERED * len(times):
            told = f"{len(times)} rows in order of time and {unordered} out of it"
            raise ContentError(f"{told}: not a recording")
    if unordered:
        _log.warning(
            "%s: %d rows were not later than the row before and are left out", path, unordered
        )
    return UciTable(
        np.array(times), np.array(values).reshape(-1, 6, 3), np.array(labels, dtype=np.int8)
    )
