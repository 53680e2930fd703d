"""What every transcript format is reduced to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from cospeech.errors import ContentError
from cospeech.speech.speech import Word

Timing = Literal["words", "spread"]

MOST_ENTRIES = 100_000
"""Words of one recording: eleven hours of talk."""


@dataclass(frozen=True)
class Transcript:
    """The words of a recording, and how their times are known.

    Attributes:
        words: In order of onset; `end >= start`; neighbours may overlap a little, as in the file.
        timing: "words" when the file times most words one by one; "spread" when it times whole
            phrases (or nothing), over which the words were spread in proportion to their letters.
        notes: What was left out, moved or taken for another unit, one sentence each, with counts.
    """

    words: tuple[Word, ...]
    timing: Timing
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Entry:
    """One timed text of a file; a time is None where the file knows none.

    Attributes:
        text: A word, or a phrase to spread.
        start: Onset, s.
        end: Offset, s.
        place: Where it stands in the file, for messages.
        is_phrase: The times are those of a phrase, even if it has one word.
    """

    text: str
    start: float | None
    end: float | None
    place: str
    is_phrase: bool = False

    @property
    def is_timed(self) -> bool:
        """Whether a time of it is known."""
        return self.start is not None or self.end is not None

    def retimed(self, change: Callable[[float], float]) -> Entry:
        """The entry with other times in the place of those that are known."""
        start, end = (None if time is None else change(time) for time in (self.start, self.end))
        return replace(self, start=start, end=end)


@dataclass(frozen=True)
class Entries:
    """What a parser found.

    Attributes:
        entries: In the order of the file.
        notes: What the parser left out, one sentence each.
        are_seconds: The format says in which unit its times are; otherwise they are seconds unless
            no speech could have such times.
    """

    entries: tuple[Entry, ...]
    notes: tuple[str, ...] = ()
    are_seconds: bool = False


def require_few(count: int, most: int = MOST_ENTRIES) -> None:
    """Refuse a file of more words than anybody says.

    Raises:
        ContentError: It has more.
    """
    if count > most:
        raise ContentError(
            f"holds more than {most} words",
            hint="give the transcript of one recording",
        )


def counted(count: int, what: str, plural: str | None = None) -> str:
    """A number with its noun: ``1 word``, ``2 words``."""
    return f"{count} {what if count == 1 else plural or what + 's'}"
