"""Whisper and its relatives: segments, of which some have words with times of their own."""

from __future__ import annotations

from typing import Any

from cospeech.speech.transcript.entries import Entries, Entry, counted
from cospeech.speech.transcript.json_shapes.items import Document, children, first, has

_WITHOUT_BLANKS = "\u3040"  # from here on in Unicode: kana, ideographs, syllables


def read_segments(document: Document) -> Entries | None:
    """``{"segments": [{"start", "end", "text", "words": [...]}]}``, or that list alone.

    A segment whose words could not be aligned, or were not asked for, is a phrase. Where no
    segment has words, "words" or WhisperX's "word_segments" beside them are taken.
    """
    value = document.value
    if isinstance(value, list) and has(value, "words"):
        value = {"segments": value}
    if not isinstance(value, dict) or not isinstance(value.get("segments"), list):
        return _words_beside(document, value)
    segments = list(children(value, "segments"))
    aligned = [isinstance(item, dict) and bool(item.get("words")) for _, item in segments]
    if not any(aligned):
        beside = _words_beside(document, value)
        if beside is not None:
            return beside
    entries: list[Entry] = []
    phrases = 0
    for place, segment in segments:
        words = list(children(segment, "words", place))
        if words:
            entries += [document.entry(*item) for item in words]
        elif isinstance(segment, dict) and isinstance(first(segment, ("text", "body")), str):
            entry = document.entry(place, segment, is_phrase=True)
            entries.append(entry)
            phrases += bool(entry.text.strip())
    notes: tuple[str, ...] = ()
    if phrases and any(aligned):
        told = counted(phrases, "segment")
        notes = (f"{told} of {len(segments)} without word times: the words were spread over it",)
    return Entries(tuple(entries), notes)


def _words_beside(document: Document, value: Any) -> Entries | None:
    for key in ("word_segments", "words"):
        if isinstance(value, dict) and value.get(key) and isinstance(value[key], list):
            if key == "words" and "segments" not in value:
                return None
            return Entries(tuple(document.entry(*item) for item in children(value, key)))
    return None


def read_chunks(document: Document) -> Entries | None:
    """Hugging Face pipelines: ``{"chunks": [{"text", "timestamp": [start, end]}]}``."""
    if not has(document.get("chunks"), "timestamp"):
        return None
    entries = []
    for place, chunk in children(document.value, "chunks"):
        times = chunk.get("timestamp") if isinstance(chunk, dict) else None
        if isinstance(times, list) and len(times) == 2:
            chunk = {**chunk, "start": times[0], "end": times[1]}
        entries.append(document.entry(place, chunk))
    return Entries(tuple(entries))


def read_whisper_cpp(document: Document) -> Entries | None:
    """``{"transcription": [{"offsets": {"from", "to"}, "text", "tokens": [...]}]}``, milliseconds.

    Tokens are parts of words; a word begins where a token begins with a blank. Without tokens,
    segments are phrases, or with ``-ml 1`` tokens as well.
    """
    if not has(document.get("transcription"), "offsets"):
        return None
    parts: list[Entry] = []
    for place, segment in children(document.value, "transcription"):
        tokens = list(children(segment, "tokens", place))
        for inner, item in tokens or [(place, segment)]:
            offsets = item.get("offsets") if isinstance(item, dict) else None
            times = offsets if isinstance(offsets, dict) else {}
            text = item.get("text") if isinstance(item, dict) else None
            timed = {"word": text, "start": times.get("from"), "end": times.get("to")}
            entry = document.entry(inner, timed, scale=1e-3)
            if not (entry.text.startswith("[_") and entry.text.endswith("]")):  # [_BEG_], [_TT_50]
                parts.append(entry)
    return Entries(tuple(_joined(parts)), are_seconds=True)


def _joined(parts: list[Entry]) -> list[Entry]:
    """Words of parts of words."""
    has_blanks = any(part.text.startswith(" ") for part in parts)
    words: list[Entry] = []
    for part in parts:
        begins = part.text.startswith(" ") or part.text[:1] >= _WITHOUT_BLANKS or not has_blanks
        if words and not begins:
            before = words[-1]
            end = before.end if part.end is None else part.end
            words[-1] = Entry(before.text + part.text, before.start, end, before.place)
        else:
            words.append(part)
    return words
