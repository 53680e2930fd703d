"""Transcripts in JSON: Gentle, Google Speech-to-Text, Whisper, Vosk, plain word lists."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from cospeech.errors import InputFileError
from cospeech.speech.transcript.entries import Entries, Entry

_TEXT_KEYS = ("word", "text", "label")
_LIST_KEYS = ("word_segments", "words", "result")  # the first is WhisperX's, beside its segments
_START_KEYS = ("start", "start_time", "startTime", "startOffset", "start_offset")
_END_KEYS = ("end", "end_time", "endTime", "endOffset", "end_offset")
_KNOWN_SHAPES = (
    "expected Gentle or Whisper output ('words' or 'segments'), Google Speech-to-Text output "
    "('results' or a list with 'alternatives'), or a list of "
    '{"word": ..., "start": ..., "end": ...} in seconds'
)

_Item = tuple[str, Any]  # where it stands in the document, and what stands there


def parse_json(path: Path, text: str) -> Entries:
    """Entries of a JSON transcript; a word without times (not found in the audio) has None.

    Raises:
        InputFileError: Not JSON, or of no known shape.
    """
    try:
        document = json.loads(text)
        items = list(_word_items(path, document))
    except json.JSONDecodeError as error:
        raise InputFileError(
            path,
            f"is not valid JSON ({error.msg})",
            place=f"line {error.lineno}, column {error.colno}",
            hint="the file is cut off or was edited by hand: export it again",
        ) from error
    except (RecursionError, ValueError) as error:  # bracket towers, integers of 5000 digits
        raise InputFileError(path, f"is not a transcript ({error})", hint=_KNOWN_SHAPES) from error
    if items:
        return Entries(tuple(_entry(path, place, item) for place, item in items))
    phrases = [
        _entry(path, place, item)
        for place, item in _children(document, "segments")
        if isinstance(item, dict) and "text" in item
    ]
    return Entries(tuple(phrases), are_phrases=bool(phrases))


def _children(document: Any, key: str) -> Iterator[_Item]:
    values = document.get(key) if isinstance(document, dict) else None
    if isinstance(values, list):
        yield from ((f"{key}[{index}]", value) for index, value in enumerate(values))


def _word_items(path: Path, document: Any) -> Iterator[_Item]:
    """Every word of a document, from whichever of the known shapes it has."""
    if isinstance(document, list):
        has_alternatives = any(isinstance(i, dict) and "alternatives" in i for i in document)
        document = {"results" if has_alternatives else "words": document}
    if not isinstance(document, dict):
        raise InputFileError(path, "is JSON but not a transcript", hint=_KNOWN_SHAPES)
    if isinstance(document.get("results"), list):
        yield from _google_words(document)
    elif isinstance(document.get("tiers"), dict):
        for name in ("words", "word"):
            tier = document["tiers"].get(name)
            for place, item in _children(tier, "entries"):
                if isinstance(item, list) and len(item) == 3:  # aligner order: start, end, label
                    yield f"tiers.{name}.{place}", [item[2], item[0], item[1]]
    elif key := next((key for key in _LIST_KEYS if isinstance(document.get(key), list)), None):
        yield from _children(document, key)
    elif isinstance(document.get("segments"), list):
        for place, segment in _children(document, "segments"):
            for inner, item in _children(segment, "words"):
                yield f"{place}.{inner}", item
    else:
        raise InputFileError(path, "is JSON but not a transcript", hint=_KNOWN_SHAPES)


def _google_words(document: dict[str, Any]) -> Iterator[_Item]:
    """Words of the first alternative of each result, each word once.

    With speaker labels on, Google's last result repeats all words of the others.
    """
    seen = set()
    for place, result in _children(document, "results"):
        for inner, alternative in _children(result, "alternatives"):
            for innermost, item in _children(alternative, "words"):
                key = json.dumps(
                    [item.get(name) for name in (*_TEXT_KEYS, *_START_KEYS, *_END_KEYS)]
                    if isinstance(item, dict)
                    else item
                )
                if key not in seen:
                    seen.add(key)
                    yield f"{place}.{inner}.{innermost}", item
            break


def _entry(path: Path, place: str, item: Any) -> Entry:
    if isinstance(item, list) and len(item) == 3:
        item = dict(zip(("word", "start", "end"), item, strict=True))
    text = _first(item, _TEXT_KEYS) if isinstance(item, dict) else None
    if not isinstance(text, str):
        raise InputFileError(
            path, f"expected a word with its times, found {item!r:.60}", place, _KNOWN_SHAPES
        )
    if item.get("case") == "not-found-in-audio":
        return Entry(text, None, None, place)
    times = [_seconds(path, place, _first(item, keys)) for keys in (_START_KEYS, _END_KEYS)]
    return Entry(text, times[0], times[1], place)


def _first(item: dict[str, Any], keys: tuple[str, ...]) -> Any:
    return next((item[key] for key in keys if item.get(key) is not None), None)


def _seconds(path: Path, place: str, value: Any) -> float | None:
    """Seconds from a number, "1.200s", "1.2" or {"seconds": 1, "nanos": 200000000}."""
    if value is None:
        return None
    try:
        if isinstance(value, dict):
            return float(value.get("seconds") or 0) + float(value.get("nanos") or 0) * 1e-9
        if isinstance(value, str):
            return float(value.strip().removesuffix("s"))
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            return float(value)
    except (TypeError, ValueError, OverflowError):
        pass  # reported below with the rest
    raise InputFileError(
        path, f"{value!r:.60} is not a time", place, 'times are seconds: 1.2 or "1.200s"'
    )
