"""What every transcript format is reduced to, and the checks they share."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from cospeech.errors import InputFileError
from cospeech.speech.speech import Word

Timing = Literal["words", "spread"]

SILENCE_LABELS = frozenset(
    {"", "sil", "sp", "spn", "pau", "<eps>", "<sil>", "<p>", "<p:>", "{sl}", "{sp}", "#"}
)
"""Labels (lower case) by which aligners mark an interval without a word."""

_SPOKEN_SYMBOLS = frozenset("&%@$€£+")

MAX_WORD_CHARACTERS = 1_000
MAX_TIME_S = 1e6

_ROUNDING_S = 1e-3  # an end this much before its start is rounding in the file, not a mistake


@dataclass(frozen=True)
class Transcript:
    """The words of a recording, and how their times are known.

    Attributes:
        words: In order of onset; `end >= start`; neighbours may overlap a little, as in the file.
        timing: "words" when the file times each word; "spread" when it times whole phrases (or
            nothing), over which the words were spread in proportion to their letters.
    """

    words: tuple[Word, ...]
    timing: Timing


@dataclass(frozen=True)
class Entry:
    """One timed text of a file; a time is None where the file knows none.

    Attributes:
        text: A word, or a phrase to spread.
        start: Onset, s.
        end: Offset, s.
        place: Where it stands in the file, for messages.
    """

    text: str
    start: float | None
    end: float | None
    place: str


@dataclass(frozen=True)
class Entries:
    """What a parser found.

    Attributes:
        entries: In the order of the file.
        are_phrases: The entries are phrases whose words have no times of their own.
    """

    entries: tuple[Entry, ...]
    are_phrases: bool = False


def is_spoken(label: str) -> bool:
    """Whether a label stands for a word, not for a silence, a dash or a note."""
    label = label.strip()
    return label.lower() not in SILENCE_LABELS and any(
        character.isalnum() or character in _SPOKEN_SYMBOLS for character in label
    )


def checked_entries(path: Path, entries: Iterable[Entry]) -> list[Entry]:
    """The spoken entries, stripped; silences and lone punctuation are dropped.

    Raises:
        InputFileError: A text is absurdly long, or a time is not finite, huge or reversed.
    """
    spoken = []
    for entry in entries:
        text = entry.text.strip()
        if not is_spoken(text):
            continue
        start, end = entry.start, entry.end
        for time in (start, end):
            if time is not None and not (math.isfinite(time) and abs(time) <= MAX_TIME_S):
                raise InputFileError(
                    path,
                    f"the time of {text[:40]!r} is {time}",
                    place=entry.place,
                    hint="times are seconds from the start of the recording",
                )
        if start is not None and end is not None and end < start:
            if start - end > _ROUNDING_S:
                raise InputFileError(
                    path,
                    f"{text[:40]!r} ends at {end:g} s, before it starts at {start:g} s",
                    place=entry.place,
                    hint="correct the two times",
                )
            end = start
        spoken.append(Entry(text, start, end, entry.place))
    return spoken


def words_of(path: Path, entries: list[Entry]) -> list[Word]:
    """Entries whose times are all known as words, in order of onset.

    Raises:
        InputFileError: A word is absurdly long.
    """
    words = []
    for entry in entries:
        assert entry.start is not None  # filled in by now
        assert entry.end is not None
        if len(entry.text) > MAX_WORD_CHARACTERS:
            raise InputFileError(
                path,
                f"a word of {len(entry.text)} letters ({entry.text[:40]!r}...)",
                place=entry.place,
                hint="one word per entry is expected",
            )
        words.append(Word(entry.text, entry.start, entry.end))
    return sorted(words, key=lambda word: (word.start, word.end))
