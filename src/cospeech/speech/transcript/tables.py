"""Transcripts with one entry per line and its times in columns: TSV, CTM, ELAN, Audacity, Praat."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from cospeech.errors import ContentError
from cospeech.speech.transcript.columns import Column, Columns, columns_by_content, columns_by_name
from cospeech.speech.transcript.entries import Entries, Entry, require_few
from cospeech.speech.transcript.lines import number, numbered_lines
from cospeech.speech.transcript.tiers import Tier, words_tier

_CHANNELS = frozenset({"0", "1", "2", "A", "B", "a", "b"})
_SEPARATORS = "\t;,"
_LOOKED_AT = 200
_FEWEST_TAGS = 4  # rows from which few tags tell themselves from words
_HINT = (
    "times are seconds, columns are separated by tabs or spaces: start, end, word. Another order"
    " needs a first line with the columns' names"
)


@dataclass(frozen=True)
class _Row:
    place: str
    cells: list[str]

    def cell(self, index: int) -> str:
        return self.cells[index] if index < len(self.cells) else ""


def is_ctm(line: str) -> bool:
    """Whether a line looks like ``recording channel start duration word``."""
    fields = line.split(None, 5)
    return len(fields) >= 5 and _starts_with_digit(fields[2]) and _starts_with_digit(fields[3])


def is_table(line: str) -> bool:
    """Whether a line looks like two times and a text, or names such columns."""
    for separator in [one for one in _SEPARATORS if line.count(one) > 1]:
        cells = _cells(line, separator)
        if columns_by_name(cells) is not None:
            return True
        columns = columns_by_content([cells])
        # In prose, a blank follows the comma between two numbers.
        if columns is not None and not cells[columns.end.index].startswith(" "):
            return True
    fields = line.split(None, 2)
    if len(fields) >= 2 and all(_starts_with_digit(field) for field in fields[:2]):
        return not _is_ctm_row(fields)
    if len(fields) == 3 and all(_starts_with_digit(field) and "." in field for field in fields[1:]):
        return True
    return [field.lower() for field in fields[:2]] == ["start", "end"]


def parse_table(text: str) -> Entries:
    """Rows with a start, an end (or a duration) and a text, in columns.

    Columns are separated by tabs, semicolons, commas or, for start, end and word, spaces. A first
    line may name them; otherwise numbers and clock times are told apart by what they hold. Columns
    are tiers where a column names them or several hold texts. Whisper's ``start end text`` header
    over whole numbers means phrases in milliseconds.

    Raises:
        ContentError: A line doesn't fit, or the columns can't be told apart.
    """
    rows = _rows(text)
    if not rows:
        return Entries(())
    columns = columns_by_name(rows[0].cells)
    named = columns is not None
    if named:
        rows = rows[1:]
    else:
        head = [row.cells for row in rows[:_LOOKED_AT]]
        columns = columns_by_content(head)
        if all(map(_is_ctm_row, head)) and not (columns and _end_before_the_next(head, columns)):
            return parse_ctm(text)
        columns = _three(head) or columns
    if columns is None:
        raise ContentError(
            f"can't tell which columns are times and which the words: {rows[0].cells!r:.80}",
            rows[0].place,
            _HINT,
        )
    in_milliseconds = columns.is_whisper and _are_whole(rows, columns)
    tiers: dict[str, Tier] = {}
    for row in rows:
        for name, entry in _row_entries(row, columns, in_milliseconds):
            tiers.setdefault(name, Tier(name)).entries.append(entry)
    tier = words_tier(list(tiers.values())) if tiers else Tier("")
    notes = _passed_over(rows, columns)
    return Entries(tuple(tier.entries), notes, columns.are_seconds or in_milliseconds)


def _passed_over(rows: Sequence[_Row], columns: Columns) -> tuple[str, ...]:
    if not columns.passed_over:
        return ()
    taken, *others = (
        f"column {index + 1} ({', '.join(row.cell(index) for row in rows[:3]):.60} ...)"
        for index in (*columns.texts, *columns.passed_over)
    )
    return (f"the words are those of {taken}, not of {' and '.join(others)}",)


def parse_ctm(text: str) -> Entries:
    """``recording channel start duration word [confidence]`` in seconds (NIST CTM).

    Raises:
        ContentError: A line is broken, or several recordings are mixed.
    """
    entries: list[Entry] = []
    recordings: dict[str, None] = {}
    for place, line in numbered_lines(text):
        require_few(len(entries))
        if line.lstrip().startswith(";;"):
            continue
        fields = line.split()
        times = [number(field) for field in fields[2:4]]
        if len(times) < 2 or times[0] is None or times[1] is None:
            raise ContentError(
                "expected recording, channel, start, duration and word, found"
                f" {' '.join(fields)[:60]!r}",
                place,
                "times are seconds, columns are separated by tabs or spaces",
            )
        if len(fields) < 5:
            raise ContentError(f"no word in {line[:60]!r}", place, "add the fifth column")
        recordings[fields[0]] = None
        entries.append(Entry(fields[4], times[0], times[0] + times[1], place))
    if len(recordings) > 1:
        names = ", ".join(list(recordings)[:3])
        raise ContentError(
            f"holds the words of {len(recordings)} recordings ({names} ...)",
            hint="keep the lines of one recording per file",
        )
    return Entries(tuple(entries))


def _rows(text: str) -> list[_Row]:
    rows: list[_Row] = []
    separator: str | None = None
    for place, line in numbered_lines(text):
        if line.startswith(("\\", '"#', "#")):  # Audacity's frequencies, ELAN's file names
            continue
        require_few(len(rows))
        if not rows:
            separator = next((one for one in _SEPARATORS if line.count(one) > 1), None)
        if separator is not None and separator != "\t" and separator not in line:
            raise _unfit(place, [line])
        cells = _cells(line, separator if separator in (";", ",") else "\t")
        if len(cells) == 1:
            cells = line.split(None, 2)
        rows.append(_Row(place, [cell.strip() for cell in cells]))
    return rows if separator is not None or not rows else _with_more_columns(rows)


def _with_more_columns(rows: list[_Row]) -> list[_Row]:
    """Rows of start, end and word of which a score or a tag after each word is a column too."""
    texts = [row.cell(2).split() for row in rows]
    said = texts[1:] if number(rows[0].cell(0)) is None else texts
    if not said or min(map(len, said)) < 2:
        return rows
    last = [text[-1] for text in said]
    are_scores = all(number(text) is not None and set(".-") & set(text) for text in last)
    are_tags = (
        len(said) >= _FEWEST_TAGS
        and max(map(len, said)) == 2
        and 2 * len(set(last)) <= len({text[0] for text in said})
    )
    if not (are_scores or are_tags):
        return rows
    return [
        _Row(row.place, [*row.cells[:2], " ".join(text[:-1]), text[-1]] if text[1:] else row.cells)
        for row, text in zip(rows, texts, strict=True)
    ]


def _cells(line: str, separator: str) -> list[str]:
    if separator == "\t":
        return line.split("\t")
    return next(csv.reader([line], delimiter=separator), [])


def _three(rows: Sequence[Sequence[str]]) -> Columns | None:
    """Start, end and word: what three columns are without names, words last or first."""
    if max(map(len, rows)) > 3:
        return None
    first = rows[0]
    if len(first) == 3 and number(first[0]) is None and None not in map(number, first[1:]):
        return Columns(Column(1), Column(2), (0,))
    if ":" in first[0]:
        return columns_by_content(rows)
    return Columns(Column(0), Column(1), (2,))


def _is_ctm_row(cells: Sequence[str]) -> bool:
    fields = " ".join(cells).split(None, 5)
    return is_ctm(" ".join(fields)) and fields[1] in _CHANNELS


def _end_before_the_next(rows: Sequence[Sequence[str]], columns: Columns) -> bool:
    """Whether most rows end by the start of the next, as they would not if those were durations."""
    times = [columns.times(row) for row in rows]
    fitting = sum((one[1] or 0.0) <= (other[0] or 0.0) + 0.05 for one, other in pairwise(times))
    return len(rows) > 1 and fitting >= 0.8 * (len(rows) - 1)


def _are_whole(rows: Sequence[_Row], columns: Columns) -> bool:
    starts = (number(row.cells[columns.start.index]) for row in rows if row.cells)
    return all(start is None or start.is_integer() for start in starts)


def _row_entries(row: _Row, columns: Columns, in_milliseconds: bool) -> list[tuple[str, Entry]]:
    start, end = columns.times(row.cells)
    if start is None or end is None:
        raise _unfit(row.place, row.cells)
    if in_milliseconds:
        start, end = start / 1000, end / 1000
    found = []
    for index in columns.texts:
        label = row.cell(index)
        if columns.tier is not None and columns.tier < len(row.cells):
            name = row.cells[columns.tier]
        else:
            name = columns.names.get(index, "")
        found.append((name, Entry(label, start, end, row.place, in_milliseconds)))
    return found


def _unfit(place: str, cells: Sequence[str]) -> ContentError:
    if len(cells) == 2:
        cells = [*cells, ""]
    found = " ".join(cells)[:60]
    return ContentError(f"expected start, end and word, found {found!r}", place, _HINT)


def _starts_with_digit(field: str) -> bool:
    return field[:1] in "+-.0123456789" and number(field) is not None
