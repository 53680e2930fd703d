"""Which columns of a table are times and which are texts."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from cospeech.speech.transcript.clocks import clock_seconds
from cospeech.speech.transcript.lines import number

_STARTS = frozenset({"start", "begin", "onset", "tmin", "xmin", "from", "starttime", "begintime"})
_ENDS = frozenset({"end", "stop", "offset", "tmax", "xmax", "to", "endtime", "stoptime"})
_DURATIONS = frozenset({"dur", "duration"})
_SECONDS = frozenset({"s", "sec", "secs", "seconds"})
_MILLISECONDS = frozenset({"ms", "msec", "millis", "milliseconds"})
_QUALIFIERS = frozenset({"time", "hh", "mm", "ss"}) | _SECONDS | _MILLISECONDS
_LETTERS = re.compile("[a-z]+")
_TIERS = ("tier", "tier name", "tiername")
_TEXT_NAMES = """
    word words text label labels value annotation transcript transcription token content utterance
    orthography
"""
_TEXTS = frozenset(_TEXT_NAMES.split())
_NO_TEXTS = (*_TIERS, "participant", "speaker", "annotator", "id", "confidence", "score", "file")
_MOST_COLUMNS = 24
_EQUAL_S, _EQUAL_UNITS = 0.011, 1.001


@dataclass(frozen=True)
class Column:
    """A column of times.

    Attributes:
        index: Which, from 0.
        scale: Seconds per unit; clock times need none.
        is_known: The unit is certain.
    """

    index: int
    scale: float = 1.0
    is_known: bool = False

    def seconds(self, cells: Sequence[str]) -> float | None:
        """The time in a row; None where there is none."""
        if self.index >= len(cells):
            return None
        text = cells[self.index]
        value = clock_seconds(text) if ":" in text else number(text)
        return None if value is None else value * self.scale


@dataclass(frozen=True)
class Columns:
    """What is in which column.

    Attributes:
        start: Onsets.
        end: Offsets, or durations.
        texts: Columns of texts, each a tier.
        names: Names of the tiers of those columns.
        tier: The column that says whose tier a row is.
        has_durations: ``end`` holds durations.
        is_whisper: The header is that of Whisper's own TSV.
        passed_over: Columns of texts, without names, that are not taken for the words.
    """

    start: Column
    end: Column
    texts: tuple[int, ...]
    names: Mapping[int, str] = field(default_factory=dict)
    tier: int | None = None
    has_durations: bool = False
    is_whisper: bool = False
    passed_over: tuple[int, ...] = ()

    @property
    def are_seconds(self) -> bool:
        """Whether the unit is certain."""
        return self.start.is_known and self.end.is_known

    def times(self, cells: Sequence[str]) -> tuple[float | None, float | None]:
        """Start and end of a row, s where the unit is known."""
        start, end = self.start.seconds(cells), self.end.seconds(cells)
        if self.has_durations and start is not None and end is not None:
            end += start
        return start, end


def columns_by_name(cells: Sequence[str]) -> Columns | None:
    """The columns by a header; None where the cells are no header."""
    names = [cell.strip().strip('"').lower() for cell in cells]
    starts, ends, durations = (
        [i for i, name in enumerate(names) if _is_called(name, known)]
        for known in (_STARTS, _ENDS, _DURATIONS)
    )
    if not starts or not (ends or durations) or any(number(name) is not None for name in names):
        return None
    times = {*starts, *ends, *durations}
    tier = next((i for i, name in enumerate(names) if name in _TIERS), None)
    texts = [i for i, name in enumerate(names) if i not in times and name in _TEXTS]
    if not texts:
        texts = [i for i, name in enumerate(names) if i not in times and name not in _NO_TEXTS]
    if len(texts) > 1 and tier is not None:
        texts = texts[-1:]
    return Columns(
        _named(names, starts),
        _named(names, ends or durations),
        tuple(texts or [len(names)]),
        {index: cells[index].strip() for index in texts},
        tier,
        has_durations=not ends,
        is_whisper=names == ["start", "end", "text"],
    )


def _is_called(name: str, known: frozenset[str]) -> bool:
    """Whether a name is one of those, perhaps with its unit; a sentence of prose is not."""
    first, *more = _LETTERS.findall(name) or [""]
    return first in known and _QUALIFIERS.issuperset(more)


def _named(names: Sequence[str], candidates: Sequence[int]) -> Column:
    """The column whose name tells its unit best: ELAN can write a time in three units."""
    units = {index: _LETTERS.findall(names[index]) for index in candidates}
    for index, parts in units.items():
        if parts[-1] in _SECONDS or "ss" in parts:  # ss.msec, hh:mm:ss.ms
            return Column(index, 1.0, is_known=True)
    for index, parts in units.items():
        if parts[-1] in _MILLISECONDS:
            return Column(index, 1e-3, is_known=True)
    return Column(candidates[0])


def columns_by_content(rows: Sequence[Sequence[str]]) -> Columns | None:
    """The columns by what is in them; None where that can't be told.

    Clock times are start and end; of three columns of numbers the third may be the difference of
    the others or a confidence; two alone are start and end if no row says otherwise. Of several
    columns of texts the one of the most different ones holds the words; those alike are tiers.
    """
    width = max(map(len, rows))
    if width > _MOST_COLUMNS:
        return None
    cells = [[row[i].strip() if i < len(row) else "" for row in rows] for i in range(width)]
    clocks = [i for i in range(width) if _all(cells[i], clock_seconds)]
    numbers = [i for i in range(width) if _all(cells[i], number)]
    if len(clocks) >= 2:
        start, end = clocks[:2]
        times = [*clocks, *numbers]
    else:
        pair = _pair(cells, numbers)
        if pair is None:
            return None
        start, end = pair
        times = numbers if len(numbers) < width else numbers[:-1]
    after = [i for i in range(max(start, end) + 1, width) if i not in times]
    before = [i for i in range(min(start, end)) if i not in times]
    candidates = [i for i in after if any(cells[i])] or after[:1] or before[-1:]
    if not candidates:
        return None
    variety = {index: _variety(cells[index]) for index in candidates}
    texts = tuple(index for index in candidates if variety[index] == max(variety.values()))
    return Columns(
        Column(start, is_known=len(clocks) >= 2),
        Column(end, is_known=len(clocks) >= 2),
        texts,
        {index: f"column {index + 1}" for index in texts} if len(texts) > 1 else {},
        tier=before[0] if after and before and len(texts) == 1 else None,
        passed_over=tuple(index for index in candidates if index not in texts),
    )


def _pair(cells: Sequence[Sequence[str]], numbers: Sequence[int]) -> tuple[int, int] | None:
    values = {i: [number(cell) or 0.0 for cell in cells[i]] for i in numbers}
    for i in numbers:
        for j in [j for j in numbers if j > i]:
            for k in [k for k in numbers if k > j]:
                rows = list(zip(values[i], values[j], values[k], strict=True))
                if any(row[2] for row in rows) and all(_is_difference(*row) for row in rows):
                    return i, j
    # Durations stand where ends would: then some are smaller than their starts. A third number
    # may be a confidence, and after the words a score.
    is_sure = len(numbers) == 3 and (
        numbers[2] > numbers[1] + 1 or all(0 <= value <= 1 for value in values[numbers[2]])
    )
    if (len(numbers) == 2 or is_sure) and numbers[1] == numbers[0] + 1:
        first, second = (values[i] for i in numbers[:2])
        if all(a <= b for a, b in zip(first, second, strict=True)):
            return numbers[0], numbers[1]
    return None


def _is_difference(start: float, end: float, duration: float) -> bool:
    whole = start.is_integer() and end.is_integer() and duration.is_integer()
    tolerance = _EQUAL_UNITS if whole and end > 60 else _EQUAL_S
    return abs(end - start - duration) <= tolerance


def _variety(cells: Sequence[str]) -> int:
    """How many different texts a column has: words vary more than tags and speakers do."""
    is_numbered = all(any(map(str.isdigit, cell)) for cell in cells)
    return 0 if is_numbered else len(set(cells))


def _all(cells: Sequence[str], read: Callable[[str], float | None]) -> bool:
    filled = [cell for cell in cells if cell]
    return bool(filled) and all(read(cell) is not None for cell in filled)
