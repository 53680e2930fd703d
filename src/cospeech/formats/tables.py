"""Csv tables as users have them: who speaks, which split, what offset, which gesture phase."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from cospeech.errors import ContentError
from cospeech.foreign import read_bytes, understood

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

    def cell(self, column: int) -> str:
        """The value in a column.

        Raises:
            ContentError: The row is shorter.
        """
        if column >= len(self.fields):
            problem = f"{len(self.fields)} values where column {column + 1} is wanted"
            raise ContentError(problem, self.place)
        return self.fields[column]

    def number(self, column: int) -> float:
        """The finite number in a column.

        Raises:
            ContentError: The row is shorter, or something else stands there.
        """
        text = self.cell(column)
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ContentError(f"{text[:40]!r} is not a number", self.place)
        return value


def read_table(path: str | Path, most_bytes: int = MAX_TABLE_BYTES) -> list[Row]:
    """Rows of a comma-, semicolon- or tab-separated text file, the header among them.

    Rows without any value are left out.

    Args:
        path: The file.
        most_bytes: Its greatest length.

    Raises:
        InputFileError: The file is absent, too long, empty or no text table.
    """
    hint = "give a csv table with a line per entry"
    raw = read_bytes(path, "a table", most_bytes, hint)
    with understood(path, "a table", hint):
        try:
            text = raw.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            problem = f"is not UTF-8 text (byte {error.start})"
            raise ContentError(problem, hint="save it as UTF-8") from error
        first = text.lstrip().split("\n", 1)[0]
        # The comma last: beside tabs or semicolons it may be in numbers.
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=max("\t;,", key=first.count))
        rows = []
        try:
            if "\0" in text:
                raise csv.Error("it holds NUL")
            for fields in reader:
                stripped = tuple(field.strip() for field in fields)
                if any(stripped):
                    rows.append(Row(f"line {reader.line_num}", stripped))
        except csv.Error as error:
            problem = f"is not a csv table ({error})"
            raise ContentError(problem, hint="open and save it again as csv") from error
        if not rows:
            raise ContentError("is empty", hint=hint)
    return rows


def columns_of(header: Row, names: Mapping[str, tuple[str, ...]]) -> dict[str, int]:
    """Where each wanted column stands.

    Args:
        header: The first row.
        names: Column wanted -> the ways its header is spelled, in lower case, ``_`` for blanks.

    Raises:
        ContentError: One is not there.
    """
    spelled = [field.lower().replace(" ", "_") for field in header.fields]
    found = {}
    for column, spellings in names.items():
        places = [spelled.index(spelling) for spelling in spellings if spelling in spelled]
        if not places:
            raise ContentError(
                f"has no column {spellings[0]!r}; its columns: {', '.join(header.fields)[:200]}",
                header.place,
                "name the columns in the first line",
            )
        found[column] = places[0]
    return found
