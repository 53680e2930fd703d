"""What the shapes of JSON transcripts share: lists under keys, words, times."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

from cospeech.errors import ContentError
from cospeech.speech.transcript.entries import Entry, counted, require_few
from cospeech.speech.transcript.lines import number

TEXT_KEYS = ("word", "text", "label", "value", "content", "body")
START_KEYS = ("start", "start_time", "startTime", "startOffset", "begin", "time")
END_KEYS = ("end", "end_time", "endTime", "endOffset", "stop")
DURATION_KEYS = ("duration",)
_SPEAKER_KEYS = ("speaker", "speaker_label", "speakerTag", "speakerLabel", "channelTag")
_EXPECTED = 'a word is {"word": ..., "start": ..., "end": ...} in seconds'

Item = tuple[str, Any]  # where it stands in the document, and what stands there


@dataclass
class Document:
    """A parsed file.

    Attributes:
        value: What it holds.
        made: Entries that were made of it, which are bounded.
        speakers: Who said them, as far as it tells.
    """

    value: Any
    made: int = 0
    speakers: set[str] = field(default_factory=set)

    def get(self, *keys: str) -> Any:
        """The value under a path of keys; None where there is none."""
        value = self.value
        for key in keys:
            value = value.get(key) if isinstance(value, dict) else None
        return value

    def list_of(self, key: str) -> list[Any] | None:
        """The list under a key; None where there is none."""
        value = self.get(key)
        return value if isinstance(value, list) else None

    def entry(self, place: str, item: Any, scale: float = 1.0, is_phrase: bool = False) -> Entry:
        """An entry of ``{"word": ..., "start": ..., "end": ...}``, under whatever names.

        A duration may stand for the end; ``[word, start, end]`` will do as well.

        Raises:
            ContentError: It is something else, a time is none, or it is one too many.
        """
        self.made += 1
        require_few(self.made)
        if isinstance(item, list) and len(item) == 3:
            item = dict(zip(("word", "start", "end"), item, strict=True))
        text = first(item, TEXT_KEYS) if isinstance(item, dict) else None
        if not isinstance(text, str):
            raise ContentError(
                f"expected a word with its times, found {item!r:.60}", place, _EXPECTED
            )
        self.hear(item)
        if item.get("case") == "not-found-in-audio":
            return Entry(text, None, None, place, is_phrase)
        entry = Entry(text, *self.times(place, item), place, is_phrase)
        return entry.retimed(lambda time: time * scale)

    def entries(self, items: Iterable[Item], scale: float = 1.0) -> list[Entry]:
        """As `entry`, of several."""
        return [self.entry(place, item, scale) for place, item in items]

    def hear(self, item: Any) -> None:
        """Take note of the speaker or the channel of a word or a phrase."""
        speaker = first(item, _SPEAKER_KEYS) if isinstance(item, dict) else None
        is_unknown = speaker == 0 and first(item, _SPEAKER_KEYS[2:]) is not None  # Google
        if isinstance(speaker, (str, int)) and not is_unknown:
            self.speakers.add(str(speaker))

    def times(self, place: str, item: Any) -> tuple[float | None, float | None]:
        """Start and end of a word or a phrase; None where it has none.

        Raises:
            ContentError: A time is none.
        """
        if not isinstance(item, dict):
            return None, None
        start = self.seconds(place, first(item, START_KEYS))
        end = self.seconds(place, first(item, END_KEYS))
        duration = self.seconds(place, first(item, DURATION_KEYS))
        if end is None and duration is not None and start is not None:
            end = start + duration
        return start, end

    def seconds(self, place: str, value: Any) -> float | None:
        """Seconds of a number, "1.200s", "1.2" or {"seconds": 1, "nanos": 200000000}.

        Raises:
            ContentError: It is no time.
        """
        found: float | None = None
        if value is None:
            return None
        if isinstance(value, dict):
            parts = [
                self.seconds(place, value.get(key) or 0) or 0.0 for key in ("seconds", "nanos")
            ]
            found = parts[0] + parts[1] * 1e-9
        elif isinstance(value, str):
            found = number(value.strip().removesuffix("s"))
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            found = float(value)  # of 30 digits at most
        if found is None:
            raise ContentError(
                f"{value!r:.60} is not a time", place, 'times are seconds: 1.2 or "1.2s"'
            )
        return None if math.isnan(found) else found


def spread_note(phrases: int, total: int) -> str:
    """That some of a file's phrases lack the word times that others have."""
    told = counted(phrases, "segment")
    return f"{told} of {total} without word times: the words were spread over it"


def first(item: dict[str, Any], keys: Sequence[str]) -> Any:
    """The value of the first of the keys that has one."""
    return next((item[key] for key in keys if item.get(key) is not None), None)


def children(value: Any, key: str, above: str = "") -> Iterator[Item]:
    """The items of the list under a key, with their places; none where there is no list."""
    values = value.get(key) if isinstance(value, dict) else None
    if isinstance(values, list):
        yield from numbered(values, f"{above}.{key}" if above else key)


def numbered(values: list[Any], above: str = "") -> list[Item]:
    """The items of a list with their places."""
    return [(f"{above}[{index}]", item) for index, item in enumerate(values)]


def below(value: Any, path: str, above: str = "") -> Iterator[Item]:
    """The items of lists in lists, with their places.

    Args:
        value: What holds the outermost list.
        path: Keys of the lists, ``"alternatives[0].words"``: of the first alternative alone.
        above: Where the value stands.
    """
    key, _, rest = path.partition(".")
    found = children(value, key.removesuffix("[0]"), above)
    for place, item in islice(found, 1) if key.endswith("[0]") else found:
        yield from below(item, rest, place) if rest else ((place, item),)


def has(items: Any, key: str) -> bool:
    """Whether something is a list in which an item has a key."""
    return isinstance(items, list) and any(isinstance(item, dict) and key in item for item in items)
