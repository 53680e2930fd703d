"""Phases as a table of start, end, label: comma, semicolon or tab between the columns."""

from __future__ import annotations

from pathlib import Path

from cospeech.errors import ContentError
from cospeech.formats.phase_files.hands import side_of
from cospeech.formats.phase_files.labels import normalised
from cospeech.formats.phase_files.tiers import MAX_BYTES, MAX_ENTRIES, Entry, Tier, read_time
from cospeech.formats.tables import columns_of, read_table

_COLUMNS = {
    "start": ("start", "start_s", "start_time", "begin", "onset"),
    "end": ("end", "end_s", "end_time", "stop", "offset"),
    "label": ("label", "phase"),
}
_HAND = ("hand", "side", "hand side", "arm", "main")


def read_phase_table(path: Path) -> list[Tier]:
    """One tier, named after the file, or where a column tells the hand, one per hand.

    Times are seconds. Without a header line the columns are start, end, label; with one they may be
    in any order and among others. Empty lines are passed over.

    Raises:
        InputFileError: It is no table in UTF-8.
        ContentError: It has too many lines or fewer than three columns, or a time is no number.
    """
    rows = read_table(path, MAX_BYTES)
    if len(rows) > MAX_ENTRIES:
        raise ContentError(f"more than {MAX_ENTRIES} lines")
    columns, hand = {name: index for index, name in enumerate(_COLUMNS)}, None
    if not _is_number(rows[0].fields[0]):
        header, *rows = rows
        columns = columns_of(header, _COLUMNS)
        hand = next((i for i, cell in enumerate(header.fields) if normalised(cell) in _HAND), None)
    entries: list[tuple[str, Entry]] = []
    for row in rows:
        if len(row.fields) <= max(columns.values()):
            problem = f"{len(row.fields)} columns, expected start, end and label"
            raise ContentError(problem, row.place)
        start, end = (read_time(row.fields[columns[name]], row.place) for name in ("start", "end"))
        side = row.fields[hand] if hand is not None and hand < len(row.fields) else ""
        entries.append((side, Entry(start, end, row.fields[columns["label"]], row.place)))
    sides = {side: side_of(side) or "both" for side, _ in entries}
    if not all(side_of(side) for side in sides if side) or len(set(sides.values())) < 2:
        return [Tier(path.stem, entries=[entry for _, entry in entries])]
    return [
        Tier(name, entries=[entry for side, entry in entries if sides[side] == name])
        for name in dict.fromkeys(sides.values())
    ]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
