"""Times for words that have none: spread over a phrase, or placed between timed neighbours."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import replace
from itertools import accumulate, pairwise
from typing import TypeVar

from cospeech.errors import ContentError
from cospeech.speech.speech import Word
from cospeech.speech.transcript.entries import Entry, counted

Timed = TypeVar("Timed", Word, Entry)

TYPICAL_LETTER_S = 0.07
"""English at about 180 words per minute; used where no word is timed, s."""


def letters(text: str) -> int:
    """Letters and digits in a text: what its duration is taken to be proportional to."""
    return sum(character.isalnum() for character in text)


def spread_text(text: str, start: float, end: float) -> tuple[Word, ...]:
    """Words of a text spread over an interval without gaps, in proportion to their letters.

    Tokens without a letter or digit (dashes, notes) are dropped.

    Args:
        text: Words separated by white space.
        start: Where the first word starts, s.
        end: Where the last word ends, s.
    """
    words = [Word(word, start, end) for word in text.split() if letters(word)]
    return tuple(lay_out(words, start, end))


def fill_in_times(entries: Sequence[Entry]) -> tuple[list[Entry], list[str]]:
    """Give every entry a start and an end; and a note on how many had none.

    Words an aligner could not find share the gap between their timed neighbours in proportion to
    their letters (a single one takes its neighbours' times, as the published code does). Before the
    first and after the last timed word they are laid out at the transcript's median pace, as is
    the other end of a word with one time, which no neighbour's start is beyond.

    Args:
        entries: In spoken order.

    Raises:
        ContentError: No entry has a time.
    """
    incomplete = sum(entry.start is None or entry.end is None for entry in entries)
    if not incomplete:
        return list(entries), []
    pace = _median_letter_s(entries)
    following = [entry.start for entry in entries[1:]] + [None]
    filled = [
        _with_other_end(entry, pace, after) for entry, after in zip(entries, following, strict=True)
    ]
    is_timed = [entry.start is not None for entry in filled]
    if not any(is_timed):
        raise ContentError(
            "no word in it has a time",
            hint="align the text with the audio (e.g. with the Montreal Forced Aligner), or give "
            "the text as a .txt file to have it spread over the audio",
        )
    first = 0
    while first < len(filled):
        stop = first
        while stop < len(filled) and not is_timed[stop]:
            stop += 1
        if stop > first:
            before = filled[first - 1].end if first else None
            after = filled[stop].start if stop < len(filled) else None
            filled[first:stop] = _between(filled[first:stop], before, after, pace)
        first = stop + 1
    lack = "lacks a time" if incomplete == 1 else "lack times"
    return filled, [f"{incomplete} of {counted(len(entries), 'word')} {lack}: placed by neighbours"]


def _with_other_end(entry: Entry, pace: float, after: float | None) -> Entry:
    length = pace * max(1, letters(entry.text))
    start, end = entry.start, entry.end
    if start is not None and end is None:
        end = start + length
        if after is not None and start < after < end:
            end = after
    elif end is not None and start is None:
        start = min(end, max(0.0, end - length))
    return replace(entry, start=start, end=end)


def _between(
    run: Sequence[Entry], before: float | None, after: float | None, pace: float
) -> list[Entry]:
    """The run laid out from the end of the word before it to the start of the word after it."""
    length = pace * sum(max(1, letters(entry.text)) for entry in run)
    start = before if before is not None else min(after or 0.0, max(0.0, (after or 0.0) - length))
    end = max(start, after) if after is not None else start + length
    return lay_out(run, start, end)


def lay_out(run: Sequence[Timed], start: float, end: float) -> list[Timed]:
    """Words or entries that share a time, s, in proportion to their letters."""
    done = list(accumulate((max(1, letters(one.text)) for one in run), initial=0))
    edges = [start + (end - start) * weight / (done[-1] or 1) for weight in done]
    return [
        replace(one, start=first, end=last)
        for one, (first, last) in zip(run, pairwise(edges), strict=True)
    ]


def _median_letter_s(entries: Sequence[Entry]) -> float:
    paces = [
        (entry.end - entry.start) / max(1, letters(entry.text))
        for entry in entries
        if entry.start is not None and entry.end is not None and entry.end > entry.start
    ]
    return statistics.median(paces) if paces else TYPICAL_LETTER_S
