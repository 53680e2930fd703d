"""Speech services: Google, Deepgram, AWS, Watson, AssemblyAI, Azure, Rev."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from cospeech.errors import ContentError
from cospeech.speech.transcript.entries import Entries, Entry
from cospeech.speech.transcript.json_shapes.items import (
    Document,
    Item,
    below,
    children,
    first,
    has,
    numbered,
    spread_note,
)

_WORD_TYPES = ("pronunciation", "word", "entity")
_FINAL_KEYS = ("final", "isFinal", "is_final")
_AZURE_STARTS = ("offsetinticks", "offset")
_TICKS_S = 1e-7  # Azure counts in steps of 100 ns


def read_google(document: Document) -> Entries | None:
    """``{"results": [{"alternatives": [{"words": [...]}]}]}``, or that list alone.

    The first alternative of each result is taken. With speaker labels on, the last result repeats
    the words of all others; they are dropped as repeats.
    """
    entries = _of_first_alternatives(document, "words")
    return None if entries is None else Entries(tuple(entries))


def read_watson(document: Document) -> Entries | None:
    """``{"results": [{"alternatives": [{"timestamps": [[word, start, end]]}]}]}``."""
    entries = _of_first_alternatives(document, "timestamps")
    return Entries(tuple(entries)) if entries else None


def _of_first_alternatives(document: Document, key: str) -> list[Entry] | None:
    results = _results(document, "alternatives")
    if results is None:
        return None
    entries = []
    for place, result in results:
        document.hear(result)
        entries += document.entries(below(result, f"alternatives[0].{key}", place))
    return entries


def read_deepgram(document: Document) -> Entries | None:
    """``{"results": {"channels": [{"alternatives": [{"words": [...]}]}]}}``.

    Raises:
        ContentError: Several channels hold words: one file per speaker is expected.
    """
    results = document.get("results")
    if not has(document.get("results", "channels"), "alternatives"):
        return None
    channels = [
        document.entries(below(channel, "alternatives[0].words", place))
        for place, channel in children(results, "channels", "results")
    ]
    _require_one(document, sum(bool(channel) for channel in channels), "channels")
    return Entries(tuple(entry for channel in channels for entry in channel))


def read_aws(document: Document) -> Entries | None:
    """AWS: ``{"results": {"items": [{"type": "pronunciation", "alternatives": [{"content"}]}]}}``.

    Times are texts. Speechmatics has the list under "results" and calls the type "word", or
    "entity" for a date or a number, of which the words as they were said are taken. Punctuation
    has no time, and is dropped.
    """
    items = document.get("results", "items")
    above = "results.items"
    if items is None and has(document.get("results"), "type"):
        items, above = document.get("results"), "results"
    if not has(items, "type"):
        return None
    entries = []
    for place, item in _spoken_items(above, items):
        if not isinstance(item, dict) or item.get("type") not in _WORD_TYPES:
            continue
        for _, alternative in below(item, "alternatives[0]"):
            content = alternative.get("content") if isinstance(alternative, dict) else None
            document.hear(alternative)
            entries.append(document.entry(place, {**item, "word": content}))
    return Entries(tuple(entries))


def _spoken_items(above: str, items: list[Any]) -> Iterator[Item]:
    """The items of a list, and in the place of an entity the words in which it was said."""
    for place, item in numbered(items, above):
        spoken = list(children(item, "spoken_form", place))
        yield from spoken or [(place, item)]


def read_assemblyai(document: Document) -> Entries | None:
    """``{"words": [{"text", "start", "end"}], "audio_duration": 3}``: whole milliseconds.

    ``audio_duration`` is in seconds. Fractions that fit it are seconds. Answers with
    "sentences", "paragraphs" or "utterances" have the words in those.
    """
    length = document.get("audio_duration")
    if not isinstance(length, (int, float)) or isinstance(length, bool):
        return None
    items: list[Item] = []
    for path in ("words", "utterances.words", "sentences.words", "paragraphs.words"):
        items = items or list(below(document.value, path))
    if not items:
        return None
    entries = document.entries(items)
    ends = [entry.end for entry in entries if entry.end is not None]
    if all(end.is_integer() for end in ends) or max(ends) > 1.5 * length + 1:
        entries = document.entries(items, scale=1e-3)
    return Entries(tuple(entries), are_seconds=True)


def read_polly(document: Document) -> Entries | None:
    """AWS Polly's marks: ``{"time": 400, "type": "word", "start": 0, "end": 2, "value": "so"}``.

    The time is the onset in milliseconds; start and end count the bytes of the text.
    """
    value = document.value if isinstance(document.value, list) else [document.value]
    if not (has(value, "time") and has(value, "type") and has(value, "value")):
        return None
    entries = []
    for place, mark in numbered(value):
        if isinstance(mark, dict) and mark.get("type") == "word":
            word = {"word": mark.get("value"), "start": mark.get("time")}
            entries.append(document.entry(place, word, scale=1e-3))
    return Entries(tuple(entries), are_seconds=True)


def read_azure(document: Document) -> Entries | None:
    """``{"NBest": [{"Words": [{"Word", "Offset", "Duration"}]}]}``, a batch's phrases or a list.

    Times are in steps of 100 ns; the first of the alternatives is taken. Where it has no words, its
    text is spread over the phrase.
    """
    phrases = document.get("recognizedPhrases")
    if not isinstance(phrases, list):
        phrases = document.value if isinstance(document.value, list) else [document.value]
    if not has(phrases, "NBest") and not has(phrases, "nBest"):
        return None
    entries = []
    for place, phrase in numbered(phrases, "NBest"):
        best = first(phrase, ("NBest", "nBest")) if isinstance(phrase, dict) else None
        if not (isinstance(best, list) and best and isinstance(best[0], dict)):
            continue
        chosen = _lower(best[0])
        words = list(children(chosen, "words", place))
        entries += [_azure_entry(document, inner, _lower(item)) for inner, item in words]
        said = _lower(phrase) | {"word": first(chosen, ("display", "lexical"))}
        if said["word"] and not words and isinstance(first(said, _AZURE_STARTS), int | float):
            entries.append(_azure_entry(document, place, said, is_phrase=True))
    spread = sum(entry.is_phrase for entry in entries)
    notes = (spread_note(spread, len(phrases)),) if 0 < spread < len(entries) else ()
    return Entries(tuple(entries), notes, are_seconds=True)


def _azure_entry(
    document: Document, place: str, item: dict[str, Any], is_phrase: bool = False
) -> Entry:
    times = {
        "start": first(item, _AZURE_STARTS),
        "duration": first(item, ("durationinticks", "duration")),
    }
    return document.entry(place, {"word": item.get("word")} | times, _TICKS_S, is_phrase)


def _lower(item: Any) -> dict[str, Any]:
    """An object with keys in lower case: services differ in them by their version."""
    return {key.lower(): value for key, value in item.items()} if isinstance(item, dict) else {}


def read_rev(document: Document) -> Entries | None:
    """``{"monologues": [{"elements": [{"type": "text", "value", "ts", "end_ts"}]}]}``.

    Raises:
        ContentError: Several speakers: one file per speaker is expected.
    """
    if not has(document.get("monologues"), "elements"):
        return None
    entries = []
    speakers = set()
    for place, monologue in children(document.value, "monologues"):
        for inner, item in children(monologue, "elements", place):
            if isinstance(item, dict) and item.get("type") == "text":
                times = {"start": item.get("ts"), "end": item.get("end_ts")}
                entries.append(document.entry(inner, {"word": item.get("value"), **times}))
                speakers.add(str(monologue.get("speaker")))
    _require_one(document, len(speakers), "speakers")
    return Entries(tuple(entries))


def _results(document: Document, key: str) -> list[Item] | None:
    """The results of a document, of a wrapped answer, or of a list of answers.

    Guesses that a service made while it listened are dropped where it gives final results.
    """
    value = document.value
    if isinstance(document.get("response"), dict):
        value = document.get("response")
    if isinstance(value, list):
        if has(value, key) and not has(value, "text"):
            return numbered(value)
        answers = numbered(value)
    else:
        answers = [("", value)]
    found = [
        item
        for place, answer in answers
        for item in children(answer, "results", place)
        if isinstance(item[1], dict)
    ]
    if any(first(item, _FINAL_KEYS) is True for _, item in found):
        found = [one for one in found if first(one[1], _FINAL_KEYS) is True]
    is_one = isinstance(value, dict) and value.get("results") == []
    return found if is_one or any(key in item for _, item in found) else None


def _require_one(document: Document, count: int, what: str) -> None:
    if count > 1:
        raise ContentError(
            f"holds the words of {count} {what}",
            hint="one file per speaker is expected: keep the words of one",
        )
