"""Big csv tables by interval: one pass notes where rows are, then an interval's are read.

The table of frames has millions of rows (about 8 million, 2 to 3 GB, for all ten speakers). What
is kept of it is 16 bytes per run of neighbouring rows of one interval plus about 250 bytes per
interval: some 10 MB where rows are ordered by interval, as published, and at most 16 bytes per row
(130 MB) where somebody shuffled them.
"""

from __future__ import annotations

import csv
import functools
import io
from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from cospeech.errors import CospeechError, InputFileError
from cospeech.foreign import open_file, read_bytes, understood

MAX_LINE_BYTES = 2**16
MAX_ROW_LINES = 16
MAX_INTERVALS = 2_000_000
MAX_INTERVAL_BYTES = 2**24
"""An interval's rows; at 250 bytes each these are over an hour."""
MAX_TABLE_BYTES = 2**26

Key = tuple[str, str]
"""Speaker and interval."""


@dataclass(frozen=True)
class RowIndex:
    """Where the rows of each interval are.

    Attributes:
        path: The csv.
        columns: Column name -> its number.
        runs: (speaker, interval) -> start and stop byte of each run, flat.
        bad_rows: Rows that have another number of fields than the header.
        first_bad: Line of the first of them.
    """

    path: Path
    columns: dict[str, int]
    runs: dict[Key, array[int]] = field(repr=False)
    bad_rows: int = 0
    first_bad: int = 0

    def rows(self, key: Key, names: Sequence[str]) -> list[tuple[str, ...]]:
        """Some columns of an interval's rows, in file order; "" for a column that isn't there.

        Raises:
            CospeechError: They are too many, or the file changed since the pass.
        """
        runs = self.runs[key]
        total = sum(stop - start for start, stop in zip(runs[::2], runs[1::2], strict=True))
        if total > MAX_INTERVAL_BYTES:
            raise CospeechError(
                f"interval {key[1]} has {total / 2**20:.0f} MB of rows in {self.path.name}: over an"
                " hour without a cut"
            )
        pieces = []
        with open_file(self.path) as file:
            for start, stop in zip(runs[::2], runs[1::2], strict=True):
                file.seek(start)
                pieces.append(file.read(stop - start))
        numbers = [self.columns.get(name) for name in names]
        try:
            return [
                tuple("" if i is None else row[i].strip() for i in numbers)
                for row in csv.reader(io.StringIO(_text(b"".join(pieces)), newline=""))
                if len(row) == len(self.columns)
            ]
        except csv.Error as error:
            raise InputFileError(self.path, str(error), f"interval {key[1]}") from error


def index_rows(path: Path, required: Sequence[str]) -> RowIndex:
    """Pass over a csv once, or take what an earlier call in this process found.

    Args:
        path: The csv, with the columns ``speaker`` and ``interval_id``.
        required: Columns that it must have.

    Raises:
        InputFileError: It can't be read, lacks a column, or isn't a table of intervals.
    """
    with understood(path, "a table of intervals"):
        state = path.stat()
        return _indexed(path, tuple(required), state.st_mtime_ns, state.st_size)


# Two: the table of frames and that of samples.
@functools.lru_cache(maxsize=2)
def _indexed(path: Path, required: tuple[str, ...], modified: int, size: int) -> RowIndex:
    with open_file(path) as file:
        header = _text(file.readline(MAX_LINE_BYTES)).lstrip("\ufeff")
        names = next(csv.reader([header]), [])
        columns = {name.strip() or f"column {i}": i for i, name in enumerate(names)}
        missing = [name for name in required if name not in columns]
        if missing or len(columns) != len(names):
            raise InputFileError(
                path,
                f"has the columns {', '.join(columns)[:500]}; {', '.join(missing) or 'one'}"
                f" {'are missing' if missing else 'is there twice'}",
                "line 1",
            )
        return _pass_over(path, file, columns)


def _pass_over(path: Path, file: IO[bytes], columns: dict[str, int]) -> RowIndex:
    runs: dict[tuple[bytes, bytes], array[int]] = {}
    speaker, interval, count = columns["speaker"], columns["interval_id"], len(columns)
    last, run = None, array("q")
    offset, line_number, bad_rows, first_bad = file.tell(), 1, 0, 0
    readline = functools.partial(file.readline, MAX_LINE_BYTES)
    while line := readline():
        line_number += 1
        start = offset
        offset += len(line)
        if b'"' in line:
            whole = _with_continuation(line, readline)
            fields = _quoted_fields(whole)
            if len(fields) == count:
                line_number += whole.count(b"\n") - line.count(b"\n")
                offset += len(whole) - len(line)
            elif len(whole) > len(line):
                file.seek(offset)  # a stray quote spoils its own line only
        else:
            fields = line.rstrip(b"\r\n").split(b",")
        if len(fields) != count or len(line) >= MAX_LINE_BYTES:
            if line.strip():
                bad_rows += 1
                first_bad = first_bad or line_number
            last = None
            continue
        key = fields[speaker], fields[interval]
        if key == last and run[-1] == start:
            run[-1] = offset
            continue
        last = key
        run = runs.setdefault(key, array("q"))
        if run and run[-1] == start:
            run[-1] = offset
        else:
            run.extend((start, offset))
        if len(runs) > MAX_INTERVALS:
            raise InputFileError(path, f"has over {MAX_INTERVALS} intervals")
    named = {(_text(who).strip(), _text(which).strip()): run for (who, which), run in runs.items()}
    return RowIndex(path, columns, named, bad_rows, first_bad)


def _with_continuation(line: bytes, readline: Callable[[], bytes]) -> bytes:
    """A line with those after it that its quotes take in."""
    for _ in range(MAX_ROW_LINES):
        if line.count(b'"') % 2 == 0 or len(line) >= MAX_LINE_BYTES:
            break
        line += readline()
    return line


def _quoted_fields(line: bytes) -> list[bytes]:
    try:
        rows = list(csv.reader(io.StringIO(_text(line), newline="")))
    except csv.Error:
        return []
    return [text.encode() for text in rows[0]] if len(rows) == 1 else []


def read_small_table(path: Path, required: Sequence[str]) -> Iterator[list[str]]:
    """The named columns of a table that fits in memory; rows that don't have them are left out.

    Raises:
        InputFileError: It is over `MAX_TABLE_BYTES`, can't be read, or lacks a column.
    """
    data = read_bytes(path, "a table", MAX_TABLE_BYTES)
    reader = csv.reader(io.StringIO(_text(data).lstrip("\ufeff"), newline=""))
    try:
        header = [name.strip() for name in next(reader, [])]
        missing = [name for name in required if name not in header]
        if missing:
            raise InputFileError(path, f"has no column {', '.join(missing)}", "line 1")
        wanted = [header.index(name) for name in required]
        for row in reader:
            if len(row) == len(header):
                yield [row[i] for i in wanted]
    except csv.Error as error:
        raise InputFileError(path, str(error), f"line {reader.line_num}") from error


def _text(data: bytes) -> str:
    return data.decode("utf-8", "replace")
