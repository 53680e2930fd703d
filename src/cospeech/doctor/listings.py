"""Recordings that a table of the corpus names and the folder does not hold."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from cospeech.doctor.findings import Check, Finding, Severity
from cospeech.errors import CospeechError
from cospeech.formats.mocap import Take
from cospeech.formats.mocap.finding import files_named
from cospeech.formats.tables import MAX_TABLE_BYTES, Row, read_table

TABLES = r".*(split|train|val|test|dev|info|list|meta).*\.(csv|txt)"
"""Names of tables that may list recordings."""

MOST_TABLES = 50
ALL_DIFFERENT = 0.9
"""Share of different values in a column of recordings' names; a speaker's name repeats."""

_MENTIONED = 5


def check_listings(root: Path, takes: Sequence[Take]) -> Iterator[Finding]:
    """Names in split lists and metadata that have no files.

    A column is a list of recordings when its values differ and one of them at least is a recording
    of the folder.

    Args:
        root: The folder.
        takes: Its takes.
    """
    known = {name.lower() for take in takes for name in _names(take)}
    parts = {path for take in takes for path in (*take.transcripts, *take.phase_files)}
    tables = {table for take in takes for table in take.tables}
    tables |= {path for path in files_named(root, TABLES) if path not in parts}
    for table in sorted(tables)[:MOST_TABLES]:
        if table.stem.lower() in known or table.stat().st_size > MAX_TABLE_BYTES:
            continue
        try:
            rows = read_table(table)
        except CospeechError:
            continue  # not a table; those that a corpus needs are read by its own reader
        yield from _absent(table, rows, known)


def _absent(table: Path, rows: list[Row], known: set[str]) -> Iterator[Finding]:
    width = max(len(row.fields) for row in rows)
    best: list[tuple[str, str]] = []
    most = 0
    for column in range(width):
        cells = [(row.place, row.fields[column]) for row in rows if column < len(row.fields)]
        found = sum(_key(value) in known for _, value in cells)
        if found > most and len({value for _, value in cells}) >= ALL_DIFFERENT * len(cells):
            most = found
            # A first row that names no file is the header.
            first = 0 if _key(cells[0][1]) in known or not _is_header(cells[0][1]) else 1
            best = [(place, v) for place, v in cells[first:] if v and _key(v) not in known]
    if not best:
        return
    names = ", ".join(value for _, value in best[:_MENTIONED])
    more = f" and {len(best) - _MENTIONED} more" if len(best) > _MENTIONED else ""
    yield Finding(
        Check.MISSING,
        Severity.WARNING,
        str(table),
        f"{len(best)} recordings that it names are not in the folder: {names}{more}, first in"
        f" {best[0][0]}",
        "download them, or know that the published split is not complete here",
    )


def _names(take: Take) -> set[str]:
    """How a table may call a take: by its id or files, or by the first parts of their names.

    ``001_Neutral_0`` is ``001_Neutral_0_x_1_0.bvh``; ``001_Neutral`` might be any.
    """
    paths = [path for path in (take.motion, take.audio) if path is not None]
    names = {take.id, *(path.stem for path in paths), *(path.name for path in paths)}
    for name in [*names]:
        parts = name.split("_")
        starts = ("_".join(parts[:count]) for count in range(2, len(parts)))
        names |= {start for start in starts if start[-1:].isdigit()}
    return names


def _key(value: str) -> str:
    name = value.replace("\\", "/").rpartition("/")[2].lower()
    stem, dot, suffix = name.rpartition(".")
    return stem if dot and suffix in ("bvh", "wav", "npy", "npz", "flac", "mp3") else name


def _is_header(value: str) -> bool:
    return not any(character.isdigit() for character in value)
