"""Whisper and its relatives: segments, of which some have words with times of their own."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from functools import partial
from itertools import chain
from operator import add
from typing import Any

from cospeech.errors import ContentError
from cospeech.speech.transcript.entries import Entries, Entry
from cospeech.speech.transcript.json_shapes.items import (
    Document,
    children,
    first,
    has,
    spread_note,
)
from cospeech.speech.transcript.labels import is_spoken
from cospeech.speech.transcript.spreading import lay_out

_FITS_S, _OFF_S = 0.1, 1.0  # words reach at most, or at least, that far out of a segment
_LOOSE_S, _LOOSE_SHARE = 0.3, 0.1  # farther, and by more of its length, is told
_OTHER_UNIT = 100.0  # segments that much longer or shorter than their words have another unit
_OVERLAP_S = 1.0  # that much may chunks overlap
_WITHOUT_BLANKS = "\u3040"  # from here on in Unicode: kana, ideographs, syllables


def read_segments(document: Document) -> Entries | None:
    """``{"segments": [{"start", "end", "text", "words": [...]}]}``, or that list alone.

    A segment whose words could not be aligned, or were not asked for, is a phrase; words without
    times at an end of a segment lie within it. Where no segment has timed words, "words" or
    WhisperX's "word_segments" beside them are taken.
    """
    value = document.value
    if isinstance(value, list) and has(value, "words"):
        value = {"segments": value}
    if not isinstance(value, dict) or not isinstance(value.get("segments"), list):
        return _words_beside(document, value)
    segments = list(children(value, "segments"))
    listed = [document.entries(children(segment, "words", place)) for place, segment in segments]
    is_aligned = any(word.is_timed for word in chain.from_iterable(listed))
    if not is_aligned:
        beside = _words_beside(document, value)
        if beside is not None:
            return beside
    listed, notes = _in_place(document, [document.times(*item) for item in segments], listed)
    entries: list[Entry] = []
    phrases = 0
    for (place, segment), words in zip(segments, listed, strict=True):
        has_text = isinstance(segment, dict) and isinstance(first(segment, ("text", "body")), str)
        if has_text and not any(word.is_timed for word in words):
            entry = document.entry(place, segment, is_phrase=True)
            entries.append(entry)
            phrases += bool(entry.text.strip())
        elif words:
            entries += _within(words, *document.times(place, segment))
    if phrases and is_aligned:
        notes.append(spread_note(phrases, len(segments)))
    return Entries(tuple(entries), tuple(notes))


def _in_place(
    document: Document,
    times: Sequence[tuple[float | None, float | None]],
    listed: list[list[Entry]],
) -> tuple[list[list[Entry]], list[str]]:
    """Words from the start of the recording, and a note where theirs count from the segment's.

    Raises:
        ContentError: Most segments' words lie before them, wherever their times count from.
    """
    spans = []
    for (start, end), words in zip(times, listed, strict=True):
        known = [time for word in words for time in (word.start, word.end) if time is not None]
        if start is not None and end is not None and known:
            spans.append((start, end, min(known), max(known)))
    long = sum(end - start for start, end, _, _ in spans)
    said = sum(last - first_time for _, _, first_time, last in spans)
    if not long / _OTHER_UNIT < said < long * _OTHER_UNIT:
        return listed, []
    is_off = any(_misfit(*span) > _OFF_S for span in spans)
    if is_off and all(_misfit(0.0, end - start, *inner) <= _FITS_S for start, end, *inner in spans):
        moved = [
            [word.retimed(partial(add, start or 0.0)) for word in words]
            for (start, _), words in zip(times, listed, strict=True)
        ]
        return moved, ["its words' times count from their segment's start, which was added"]
    before = [span for span in spans if span[3] <= span[0] - _LOOSE_S]
    if 2 * len(before) > len(spans):
        start, _, _, last = before[0]
        raise ContentError(
            f"its words lie before their segments: one that starts at {start:g} has words up to"
            f" {last:g}",
            hint="give words' times from the start of the recording",
        )
    loose = [
        off
        for span in spans
        if (off := _misfit(*span)) > max(_LOOSE_S, _LOOSE_SHARE * (span[1] - span[0]))
    ]
    return listed, [f"words reach up to {max(loose):.3g} s out of their segments"] if loose else []


def _misfit(start: float, end: float, first_time: float, last_time: float) -> float:
    return max(start - first_time, last_time - end)


def _within(words: list[Entry], start: float | None, end: float | None) -> list[Entry]:
    """The words of a segment, of which those at its ends that have no time lie within it."""
    timed = [index for index, word in enumerate(words) if word.is_timed]
    if not timed:
        return words
    head, tail = words[: timed[0]], words[timed[-1] + 1 :]
    first_start, last_end = words[timed[0]].start, words[timed[-1]].end
    if head and start is not None and first_start is not None and start < first_start:
        head = lay_out(head, start, first_start)
    if tail and end is not None and last_end is not None and last_end < end:
        tail = lay_out(tail, last_end, end)
    return [*head, *words[timed[0] : timed[-1] + 1], *tail]


def _words_beside(document: Document, value: Any) -> Entries | None:
    for key in ("word_segments", "words"):
        if isinstance(value, dict) and value.get(key) and isinstance(value[key], list):
            if key == "words" and "segments" not in value:
                return None
            entries = tuple(document.entries(children(value, key)))
            if (
                key == "words"
                or any(entry.is_timed for entry in entries)
                or not value.get("segments")
            ):
                return Entries(entries)
    return None


def read_chunks(document: Document) -> Entries | None:
    """Hugging Face pipelines: ``{"chunks": [{"text", "timestamp": [start, end]}]}``.

    Raises:
        ContentError: The times start again, as those of parts of a recording do.
    """
    if not has(document.get("chunks"), "timestamp"):
        return None
    entries: list[Entry] = []
    for place, chunk in children(document.value, "chunks"):
        times = chunk.get("timestamp") if isinstance(chunk, dict) else None
        if isinstance(times, list) and len(times) == 2:
            chunk = {**chunk, "start": times[0], "end": times[1]}
        entry = document.entry(place, chunk)
        if entries and _starts_again(entries[-1], entry):
            raise ContentError(
                f"its times start again at {entry.start:g} s, after {entries[-1].end:g} s",
                place,
                "transcribe it with times from the start of the whole recording, or add to the"
                " times of each part where that starts",
            )
        entries.append(entry)
    return Entries(tuple(entries))


def _starts_again(before: Entry, entry: Entry) -> bool:
    if before.start is None or before.end is None or entry.start is None:
        return False
    return entry.start <= before.start and entry.start < before.end - _OVERLAP_S


def read_whisper_cpp(document: Document) -> Entries | None:
    """``{"transcription": [{"offsets": {"from", "to"}, "text", "tokens": [...]}]}``, milliseconds.

    Tokens are parts of words; a word begins where a token begins with a blank. Without tokens,
    segments are phrases, or with ``-ml 1`` tokens as well.
    """
    if not has(document.get("transcription"), "offsets"):
        return None
    segments = []
    for place, segment in children(document.value, "transcription"):
        parts = []
        for inner, item in list(children(segment, "tokens", place)) or [(place, segment)]:
            offsets = item.get("offsets") if isinstance(item, dict) else None
            times = offsets if isinstance(offsets, dict) else {}
            text = item.get("text") if isinstance(item, dict) else None
            timed = {"word": text, "start": times.get("from"), "end": times.get("to")}
            entry = document.entry(inner, timed, scale=1e-3)
            if not (entry.text.startswith("[_") and entry.text.endswith("]")):  # [_BEG_], [_TT_50]
                parts.append(entry)
        segments.append(parts)
    if all(len(parts) <= 1 and " " not in parts[0].text.strip() for parts in segments if parts):
        segments = [list(chain.from_iterable(segments))]  # what -ml 1 writes
    has_blanks = any(part.text.startswith(" ") for parts in segments for part in parts)
    words = chain.from_iterable(_joined(parts, has_blanks) for parts in segments)
    return Entries(tuple(words), are_seconds=True)


def _joined(parts: list[Entry], has_blanks: bool) -> list[Entry]:
    """Words of parts of words. A symbol is none of them, and punctuation takes no time."""
    words: list[Entry] = []
    for part in parts:
        text = part.text
        is_mark = not is_spoken(text)
        begins = text.startswith(" ") or text[:1] >= _WITHOUT_BLANKS or not has_blanks
        if not words or begins:
            words.append(part)
        elif not is_mark or all(unicodedata.category(sign)[0] == "P" for sign in text.strip()):
            before = words[-1]
            end = before.end if part.end is None or is_mark else part.end
            words[-1] = Entry(before.text + text, before.start, end, before.place)
    return words
