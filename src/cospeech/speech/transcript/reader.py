"""Reads a transcript, whatever its format."""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable
from pathlib import Path

from cospeech.errors import InputFileError
from cospeech.speech.speech import Word
from cospeech.speech.transcript.entries import (
    Entries,
    Entry,
    Transcript,
    checked_entries,
    words_of,
)
from cospeech.speech.transcript.json_words import parse_json
from cospeech.speech.transcript.lines import parse_bracketed, parse_ctm, parse_tsv
from cospeech.speech.transcript.spreading import fill_in_times, spread_text
from cospeech.speech.transcript.subtitles import CUE_TIMES, parse_subtitles
from cospeech.speech.transcript.textgrid import parse_textgrid

MAX_FILE_BYTES = 64 * 2**20
"""Largest transcript that is read: some hundred hours of talk."""

_Parser = Callable[[Path, str], Entries]

_BY_SUFFIX: dict[str, _Parser] = {
    ".textgrid": parse_textgrid,
    ".json": parse_json,
    ".tsv": parse_tsv,
    ".ctm": parse_ctm,
    ".srt": parse_subtitles,
    ".vtt": parse_subtitles,
}

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_BY_LINE: tuple[tuple[re.Pattern[str], _Parser], ...] = (
    (re.compile(r"""\s*[\[(]\s*(['"]).*\1\s*,[^'"]*[\])],?\s*$"""), parse_bracketed),
    (CUE_TIMES, parse_subtitles),
    (re.compile(rf"\s*\S+\s+\S+\s+{_NUMBER}\s+{_NUMBER}\s+\S"), parse_ctm),
    (re.compile(rf"(?i)\s*(?:{_NUMBER}\s+{_NUMBER}(?:\s|$)|start\s+end\s)"), parse_tsv),
)
"""How one line of a format looks, for files whose name doesn't say it."""

_LINES_LOOKED_AT = 50
_AUDIO_ALONE = "a transcript is optional: leave it out to go on with the audio alone"


def read_transcript(path: str | Path, duration_s: float | None = None) -> tuple[Word, ...]:
    """Words of a transcript in order of onset; `read_transcript_with_timing` says more."""
    return read_transcript_with_timing(path, duration_s).words


def read_transcript_with_timing(path: str | Path, duration_s: float | None = None) -> Transcript:
    """Read a transcript, and tell whether its words have times of their own.

    Read are TextGrid (long and short), JSON (Gentle, Google, Whisper, Vosk, word lists), TSV, CTM,
    lines of ``['word', start, end]``, SRT, VTT and plain text; UTF-8 or UTF-16. The suffix decides,
    else the content. Silences ("sil", "<eps>", ...) and lone punctuation are dropped.

    Args:
        path: The file.
        duration_s: Length of the recording, s; needed for plain text, which is spread over it.

    Raises:
        InputFileError: Missing, broken, of unknown format, or without a word. Names the line or
            entry.
    """
    path = Path(path)
    text = _read_text(path)
    parser = _parser_for(path, text)
    if parser is None:
        if not text.strip():
            raise InputFileError(path, "the transcript is empty", hint=_AUDIO_ALONE)
        if duration_s is None:
            raise InputFileError(
                path,
                "is plain text without word times",
                hint="give the recording's duration to have the words spread over it, or align "
                "them (e.g. Montreal Forced Aligner, Gentle, Whisper) and pass its output",
            )
        found = Entries((Entry(text, 0.0, duration_s, "the text"),), are_phrases=True)
    else:
        found = parser(path, text)
    entries = checked_entries(path, found.entries)
    if entries:
        entries = fill_in_times(path, entries)
    if found.are_phrases:
        entries = _spread(entries)
    words = tuple(words_of(path, entries))
    if not words:
        raise InputFileError(path, "no word in the transcript", hint=_AUDIO_ALONE)
    return Transcript(words, "spread" if found.are_phrases else "words")


def _spread(phrases: list[Entry]) -> list[Entry]:
    words = []
    for phrase in phrases:
        assert phrase.start is not None  # filled in by now
        assert phrase.end is not None
        words += [
            Entry(word.text, word.start, word.end, phrase.place)
            for word in spread_text(phrase.text, phrase.start, phrase.end)
        ]
    return words


def _read_text(path: Path) -> str:
    if not path.exists():
        raise InputFileError(path, "no such transcript", hint=f"check the path; {_AUDIO_ALONE}")
    if not path.is_file():
        raise InputFileError(path, "is not a file", hint="give one transcript file")
    with path.open("rb") as file:
        raw = file.read(MAX_FILE_BYTES + 1)
    if len(raw) > MAX_FILE_BYTES:
        raise InputFileError(
            path,
            f"is larger than {MAX_FILE_BYTES >> 20} MiB",
            hint="give the transcript of one recording",
        )
    is_utf16 = raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        text = raw.decode("utf-16" if is_utf16 else "utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputFileError(
            path,
            f"is neither UTF-8 nor UTF-16 text (byte {error.start} is {raw[error.start]:#04x})",
            hint=f"save it as UTF-8, e.g. iconv -f latin1 -t utf-8 {path.name} > utf8-{path.name}",
        ) from error
    if text.startswith("ooBinaryFile"):
        raise InputFileError(
            path,
            "is a TextGrid in Praat's binary form",
            hint="in Praat: select the TextGrid, Save as text file",
        )
    if "\0" in text:
        raise InputFileError(
            path, "is a binary file", hint="give a TextGrid, JSON, TSV, CTM, SRT, VTT or txt file"
        )
    return text


def _parser_for(path: Path, text: str) -> _Parser | None:
    """The parser of a format with times; None for plain text."""
    by_suffix = _BY_SUFFIX.get(path.suffix.lower())
    if by_suffix is not None and text.strip():
        return by_suffix
    start = text.lstrip()[:200]
    if start.startswith(("File type", '"ooTextFile')):
        return parse_textgrid
    if start.startswith("WEBVTT"):
        return parse_subtitles
    lines = [line for line in text.splitlines() if line.strip()][:_LINES_LOOKED_AT]
    for pattern, parser in _BY_LINE:
        if any(pattern.match(line[:1000]) for line in lines):
            return parser
    return parse_json if start.startswith(("{", "[")) else None
