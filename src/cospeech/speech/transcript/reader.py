"""Reads a transcript, whatever its format."""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable, Sequence
from itertools import islice
from pathlib import Path

from cospeech.errors import ContentError
from cospeech.foreign import read_bytes, understood
from cospeech.speech.speech import Word
from cospeech.speech.transcript.entries import (
    MOST_ENTRIES,
    Entries,
    Entry,
    Timing,
    Transcript,
    require_few,
)
from cospeech.speech.transcript.json_shapes import parse_json_transcript
from cospeech.speech.transcript.labels import times_of_a_list, times_within
from cospeech.speech.transcript.lines import is_bracketed, parse_bracketed
from cospeech.speech.transcript.plausibility import plausible_words, require_columns, spoken_entries
from cospeech.speech.transcript.spreading import fill_in_times, spread_text
from cospeech.speech.transcript.subtitles import is_cue_times, parse_subtitles
from cospeech.speech.transcript.tables import is_ctm, is_table, parse_ctm, parse_table
from cospeech.speech.transcript.textgrid import parse_textgrid
from cospeech.speech.transcript.units import in_seconds

MAX_FILE_BYTES = 16 * 2**20
"""Largest transcript that is read: some forty hours of talk in the most wordy format."""

_Parser = Callable[[str], Entries]

_BY_SUFFIX: dict[str, _Parser] = {
    ".textgrid": parse_textgrid,
    ".json": parse_json_transcript,
    ".jsonl": parse_json_transcript,
    ".tsv": parse_table,
    ".ctm": parse_ctm,
    ".srt": parse_subtitles,
    ".vtt": parse_subtitles,
}

_BY_LINE: tuple[tuple[Callable[[str], bool], _Parser], ...] = (
    (is_bracketed, parse_bracketed),
    (is_cue_times, parse_subtitles),
    (is_table, parse_table),
    (is_ctm, parse_ctm),
)
"""How one line of a format looks, for files whose name doesn't say it."""

_CHAT = re.compile(r"\A\s*(?:@UTF8\s+)?(?:@\w[\w ]*:.*\n)*@Begin\s")
_LINES_LOOKED_AT = 50
_MOST_TIMES, _FEWEST_TIMES = 0.2, 3  # share of a plain text's words, or of its lines; and a number
_WHAT = "a transcript"
_AUDIO_ALONE = "a transcript is optional: leave it out to go on with the audio alone"


def read_transcript(path: str | Path, duration_s: float | None = None) -> tuple[Word, ...]:
    """Words of a transcript in order of onset; `read_transcript_with_timing` says more."""
    return read_transcript_with_timing(path, duration_s).words


def read_transcript_with_timing(
    path: str | Path, duration_s: float | None = None, *, goes_on: bool = False
) -> Transcript:
    """Read a transcript, and tell whether its words have times of their own.

    Read are TextGrid (long and short), JSON (of aligners, Whisper and its relatives, Vosk and the
    speech services; `json_shapes` lists them), TSV and other tables with a start, an end and a text
    (ELAN, Audacity, Praat), CTM, lines of ``['word', start, end]``, SRT, VTT and plain text; UTF-8
    or UTF-16. The suffix decides, else the content. Silences ("sil", "<eps>", ...) and lone
    punctuation are dropped; phrases are spread over their time.

    Words come out with times that speech can have, or not at all; what was left out, moved or
    converted is told in the transcript's notes. Nobody speaks where the file is empty.

    Args:
        path: The file.
        duration_s: Length of the sound, s; needed for plain text, which is spread over it.
        goes_on: The sound is a part of what the file is about, and words beyond it are no fault.

    Raises:
        ContentError: Missing, broken, of unknown format, not empty and without a word, or with
            times that its words can't have. Names the line or entry.
    """
    path = Path(path)
    with understood(path, _WHAT, _AUDIO_ALONE):
        text = _read_text(path)
        if not text.strip():
            return Transcript((), "words", ("the file is empty: nobody speaks",))
        parser = _parser_for(path, text)
        found = _plain(text, duration_s) if parser is None else parser(text)
        _require_bounded(found.entries)
        entries, notes = spoken_entries(found.entries)
        notes = [*found.notes, *notes]
        require_columns(entries)
        if not found.are_seconds:
            entries, more = in_seconds(entries, None if goes_on else duration_s)
            notes += more
        if entries:
            entries, more = fill_in_times(entries)
            notes += more
        entries, spread = _spread(entries)
        words, more = plausible_words(entries, duration_s, goes_on)
        if not words:
            raise ContentError("no word in the transcript", hint=_AUDIO_ALONE)
        timing: Timing = "spread" if spread > 0.5 * len(entries) else "words"
        return Transcript(words, timing, (*notes, *more))


def _plain(text: str, duration_s: float | None) -> Entries:
    _require_prose(text)
    if duration_s is None:
        raise ContentError(
            "is plain text without word times",
            hint="give the recording's duration to have the words spread over it, or align "
            "them (e.g. Montreal Forced Aligner, Gentle, Whisper) and pass its output",
        )
    return Entries((Entry(text, 0.0, duration_s, "the text", is_phrase=True),), are_seconds=True)


def _require_prose(text: str) -> None:
    times = times_within(text)
    lines = [line for line in text.splitlines() if line.strip()]
    timed = sum(bool(times_within(line)) for line in lines)
    share = max(len(times) / len(text.split()), timed / len(lines) if timed > 1 else 0.0)
    if len(times) < _FEWEST_TIMES or share <= _MOST_TIMES:
        times = times_of_a_list(text)
    if times:
        what = f"a list with times ({', '.join(times[:3])} ...)"
    elif text.lstrip().startswith("<?xml"):
        what = "XML"
    else:
        return
    raise ContentError(
        f"looks like {what} in a format that is not known, not like plain text",
        hint="save it as SRT, as a TextGrid, or as a table with the columns start, end and"
        " word, separated by tabs, in seconds; or keep the text alone",
    )


def _require_bounded(entries: Sequence[Entry]) -> None:
    require_few(len(entries))
    for entry in entries:
        if len(entry.text) > MOST_ENTRIES:
            require_few(len(entry.text.split(None, MOST_ENTRIES + 1)))


def _spread(entries: Sequence[Entry]) -> tuple[list[Entry], int]:
    """Entries of one word each, and how many of them share a time with others."""
    words: list[Entry] = []
    spread = 0
    for entry in entries:
        if not (entry.is_phrase or any(character.isspace() for character in entry.text)):
            words.append(entry)
            continue
        assert entry.start is not None  # filled in by now
        assert entry.end is not None
        several = spread_text(entry.text, entry.start, entry.end)
        words += [Entry(word.text, word.start, word.end, entry.place) for word in several]
        spread += len(several)
        require_few(len(words))
    return words, spread


def _read_text(path: Path) -> str:
    if not path.exists():
        raise ContentError("no such transcript", hint=f"check the path; {_AUDIO_ALONE}")
    raw = read_bytes(path, _WHAT, MAX_FILE_BYTES, "give the transcript of one recording")
    is_utf16 = raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        text = raw.decode("utf-16" if is_utf16 else "utf-8-sig")
    except UnicodeDecodeError as error:
        raise ContentError(
            f"is neither UTF-8 nor UTF-16 text (byte {error.start} is {raw[error.start]:#04x})",
            hint=f"save it as UTF-8, e.g. iconv -f latin1 -t utf-8 {path.name} > utf8-{path.name}",
        ) from error
    if text.startswith("ooBinaryFile"):
        raise ContentError(
            "is a TextGrid in Praat's binary form",
            hint="in Praat: select the TextGrid, Save as text file",
        )
    if _CHAT.search(text):
        raise ContentError(
            "is a CHAT transcript",
            hint="convert it with CLAN: chat2praat makes a TextGrid of it, chat2srt subtitles",
        )
    if "\0" in text:
        raise ContentError(
            "is a binary file", hint="give a TextGrid, JSON, TSV, CTM, SRT, VTT or txt file"
        )
    return text


def _parser_for(path: Path, text: str) -> _Parser | None:
    """The parser of a format with times; None for plain text."""
    by_suffix = _BY_SUFFIX.get(path.suffix.lower())
    if by_suffix is not None:
        return by_suffix
    start = text[:1000].lstrip()
    if start.startswith(("File type", '"ooTextFile')):
        return parse_textgrid
    if start.startswith("WEBVTT"):
        return parse_subtitles
    head = (line[:1000] for line in text[: 1000 * _LINES_LOOKED_AT].splitlines() if line.strip())
    lines = list(islice(head, _LINES_LOOKED_AT))
    for is_line, parser in _BY_LINE:
        if any(map(is_line, lines)):
            return parser
    is_list = start.startswith("[") and start[1:].lstrip()[:1] in ("", "{", "[", "]", '"')
    return parse_json_transcript if start.startswith("{") or is_list else None
