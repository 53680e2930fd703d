"""Phases as a table of start, end, label: comma, semicolon or tab between the columns."""

from __future__ import annotations

import csv
from pathlib import Path

from cospeech.errors import InputFileError
from cospeech.foreign import read_bytes
from cospeech.formats.phase_files.hands import side_of
from cospeech.formats.phase_files.labels import normalised
from cospeech.formats.phase_files.tiers import MAX_BYTES, MAX_ENTRIES, Entry, Tier, read_time

_COLUMNS = {
    "start": ("start", "start_s", "start_time", "begin", "onset"),
    "end": ("end", "end_s", "end_time", "stop", "offset"),
    "label": ("label", "phase"),
}
_HAND = ("hand", "side", "hand side", "arm", "main")


def read_table(path: Path) -> list[Tier]:
    """One tier, named after the file, or where a column tells the hand, one per hand.

    Times are seconds. Without a header line the columns are start, end, label; with one they may be
    in any order and among others. Empty lines are passed over.

    Raises:
        InputFileError: It isn't text, has fewer than three columns, or a time is no number.
    """
    try:
        lines = read_bytes(path, "an annotation file", MAX_BYTES).decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise InputFileError(
            path, f"not UTF-8 text (byte {error.start})", hint="save it as UTF-8"
        ) from error
    if len(lines) > MAX_ENTRIES:
        raise InputFileError(path, f"more than {MAX_ENTRIES} lines")
    filled = next((line for line in lines if line.strip()), "")
    delimiter = max("\t;,", key=filled.count)
    entries: list[tuple[str, Entry]] = []
    columns: tuple[int, int, int] | None = None
    hand: int | None = None
    try:
        rows = list(enumerate(csv.reader(lines, delimiter=delimiter), start=1))
    except csv.Error as error:
        raise InputFileError(path, f"not a table: {error}") from error
    for number, row in rows:
        if not any(cell.strip() for cell in row):
            continue
        if columns is None:
            columns = _header(path, number, row)
            if columns is not None:
                hand = next((i for i, cell in enumerate(row) if normalised(cell) in _HAND), None)
                continue
            columns = (0, 1, 2)
        place = f"line {number}"
        if len(row) <= max(columns):
            raise InputFileError(path, f"{len(row)} columns, expected start, end and label", place)
        start, end = (read_time(path, row[column].strip(), place) for column in columns[:2])
        side = row[hand].strip() if hand is not None and hand < len(row) else ""
        entries.append((side, Entry(start, end, row[columns[2]].strip(), place)))
    sides = {side: side_of(side) or "both" for side, _ in entries}
    if not all(side_of(side) for side in sides if side) or len(set(sides.values())) < 2:
        return [Tier(path.stem, entries=[entry for _, entry in entries])]
    return [
        Tier(name, entries=[entry for side, entry in entries if sides[side] == name])
        for name in dict.fromkeys(sides.values())
    ]


def _header(path: Path, number: int, row: list[str]) -> tuple[int, int, int] | None:
    """Columns of start, end and label; None when the row is no header."""
    cells = [cell.strip().lower().replace(" ", "_") for cell in row]
    try:
        float(cells[0])
    except ValueError:
        pass
    else:
        return None
    found = []
    for column, names in _COLUMNS.items():
        index = next((i for i, cell in enumerate(cells) if cell in names), None)
        if index is None:
            raise InputFileError(
                path, f"the header {', '.join(row)} has no column {column!r}", f"line {number}"
            )
        found.append(index)
    return found[0], found[1], found[2]
