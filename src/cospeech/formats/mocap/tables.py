"""Small csv tables beside a corpus: who speaks, which split, what offset."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path

from cospeech.errors import InputFileError
from cospeech.foreign import read_bytes

MAX_TABLE_BYTES = 2**22


@dataclass(frozen=True)
class Row:
    """A row of a table.

    Attributes:
        place: Where it stands, for messages: ``"line 3"``.
        fields: Its values, stripped.
    """

    place: str
    fields: tuple[str, ...]


def read_table(path: str | Path) -> list[Row]:
    """Rows of a comma-, semicolon- or tab-separated text file, the header among them.

    Rows without any value are left out.

    Raises:
        InputFileError: The file is absent, larger than 4 MiB, empty or no text table.
    """
    path = Path(path)
    hint = "give a table with a line per recording"
    raw = read_bytes(path, "a table", MAX_TABLE_BYTES, hint)
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputFileError(
            path, f"is not UTF-8 text (byte {error.start})", hint="save it as UTF-8"
        ) from error
    first = text.lstrip().split("\n", 1)[0]
    delimiter = max(",;\t", key=first.count)
    rows = []
    try:
        if "\0" in text:
            raise csv.Error("it holds NUL")
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
        for fields in reader:
            stripped = tuple(field.strip() for field in fields)
            if any(stripped):
                rows.append(Row(f"line {reader.line_num}", stripped))
    except csv.Error as error:
        raise InputFileError(
            path, f"is not a csv table ({error})", hint="open and save it again as csv"
        ) from error
    if not rows:
        raise InputFileError(path, "is empty", hint="a table has a line per recording")
    return rows


def columns_of(path: Path, header: Row, names: dict[str, tuple[str, ...]]) -> dict[str, int]:
    """Where each wanted column stands.

    Args:
        path: The table, for messages.
        header: Its first row.
        names: Column wanted -> the ways its header is spelled, in lower case.

    Raises:
        InputFileError: One is not there.
    """
    spelled = [field.lower() for field in header.fields]
    found = {}
    for column, spellings in names.items():
        places = [spelled.index(spelling) for spelling in spellings if spelling in spelled]
        if not places:
            raise InputFileError(
                path,
                f"has no column {spellings[0]!r}; its columns: {', '.join(header.fields)[:200]}",
                place=header.place,
                hint="name the columns in the first line",
            )
        found[column] = places[0]
    return found


def cell(path: Path, row: Row, column: int) -> str:
    """A value of a row.

    Raises:
        InputFileError: The row is shorter.
    """
    if column >= len(row.fields):
        raise InputFileError(
            path, f"{len(row.fields)} values where column {column + 1} is wanted", place=row.place
        )
    return row.fields[column]
