"""Transcripts with one word per line: TSV, CTM and bracketed lists."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from cospeech.errors import InputFileError
from cospeech.speech.transcript.entries import Entries, Entry

_MAX_LINE_CHARACTERS = 5_000


def numbered_lines(path: Path, text: str) -> Iterator[tuple[str, str]]:
    """Non-blank lines with their place, e.g. ("line 3", "0.1 0.2 word").

    Raises:
        InputFileError: A line is absurdly long.
    """
    for number, line in enumerate(text.splitlines(), start=1):
        if len(line) > _MAX_LINE_CHARACTERS:
            raise InputFileError(
                path,
                f"a line of {len(line)} characters",
                place=f"line {number}",
                hint="one word per line is expected",
            )
        if line.strip():
            yield f"line {number}", line


def parse_tsv(path: Path, text: str) -> Entries:
    """``start end word`` in seconds, tab- or space-separated (GENEA 2022).

    A header line names the columns. Whisper's ``start end text`` header means phrases in
    milliseconds.

    Raises:
        InputFileError: A line has no two numbers and a text.
    """
    entries: list[Entry] = []
    is_whisper = False
    for place, line in numbered_lines(path, text):
        separator = "\t" if "\t" in line else None
        fields = [field.strip() for field in line.split(separator, maxsplit=2)]
        if not entries and [field.lower() for field in fields[:2]] == ["start", "end"]:
            is_whisper = fields[2:] == ["text"]
            continue
        if len(fields) == 2:
            fields.append("")  # an unlabelled interval is a silence
        start, end = _times(path, place, fields, (0, 1), "start, end and word")
        scale = 1e-3 if is_whisper else 1.0
        entries.append(Entry(fields[2], start * scale, end * scale, place))
    return Entries(tuple(entries), are_phrases=is_whisper)


def parse_ctm(path: Path, text: str) -> Entries:
    """``recording channel start duration word [confidence]`` in seconds (NIST CTM).

    Raises:
        InputFileError: A line is broken, or several recordings are mixed.
    """
    entries: list[Entry] = []
    recordings: dict[str, None] = {}
    for place, line in numbered_lines(path, text):
        if line.lstrip().startswith(";;"):
            continue
        fields = line.split()
        start, duration = _times(
            path, place, fields, (2, 3), "recording, channel, start, duration and word"
        )
        if len(fields) < 5:
            raise InputFileError(path, f"no word in {line[:60]!r}", place, "add the fifth column")
        recordings[fields[0]] = None
        entries.append(Entry(fields[4], start, start + duration, place))
    if len(recordings) > 1:
        names = ", ".join(list(recordings)[:3])
        raise InputFileError(
            path,
            f"holds the words of {len(recordings)} recordings ({names} ...)",
            hint="keep the lines of one recording per file",
        )
    return Entries(tuple(entries))


def parse_bracketed(path: Path, text: str) -> Entries:
    """``['word', start, end]`` in seconds, a Python or JSON list per line (TED-culture).

    Raises:
        InputFileError: A line is something else.
    """
    entries = []
    for place, line in numbered_lines(path, text):
        try:
            item = ast.literal_eval(line.strip().rstrip(","))
        except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
            item = None
        match item:
            case [str(word), int() | float() as start, int() | float() as end]:
                entries.append(Entry(word, float(start), float(end), place))
            case _:
                raise InputFileError(
                    path,
                    f"expected ['word', start, end], found {line.strip()[:60]!r}",
                    place,
                    "one such list per line, times in seconds",
                )
    return Entries(tuple(entries))


def _times(
    path: Path, place: str, fields: list[str], columns: tuple[int, int], expected: str
) -> tuple[float, float]:
    try:
        return float(fields[columns[0]]), float(fields[columns[1]])
    except (IndexError, ValueError) as error:
        raise InputFileError(
            path,
            f"expected {expected}, found {' '.join(fields)[:60]!r}",
            place,
            "times are seconds, columns are separated by tabs or spaces",
        ) from error
