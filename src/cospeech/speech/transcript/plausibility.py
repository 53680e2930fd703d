"""Whether words are plausible, decided in one place for every format, reader and command.

What is left out or moved is counted in a note; what nobody can say at such times is refused.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise

from cospeech.errors import ContentError
from cospeech.speech.speech import Word
from cospeech.speech.transcript.entries import Entry, counted
from cospeech.speech.transcript.labels import (
    are_annotations,
    are_phones,
    is_spoken,
    speakers_of,
    without_clocks,
    without_markup,
    without_speakers,
)
from cospeech.speech.transcript.spreading import TYPICAL_LETTER_S, lay_out, letters
from cospeech.speech.transcript.units import median_word

MAX_WORD_CHARACTERS = 1_000
MAX_TIME = 1e12
MAX_TIME_S = 1e6

TOLERATED_S = 1.0
"""How far words may reach over an end of the sound, s: aligners round."""

TOLERATED_SHARE = 0.2
"""Share of the words that may lie beyond an end of the sound; they are left out."""

SHORTEST_WORD_S = 0.02
"""No word is shorter, s: the "a" of fast speech has 0.03."""

_ROUNDING_S = 1e-3  # an end this much before its start is rounding in the file, not a mistake
_FEWEST = 4  # words from which "most of them" means something


def spoken_entries(entries: Iterable[Entry]) -> tuple[list[Entry], list[str]]:
    """The entries that are words, without markup, each once; and notes on what was left out.

    Silences and lone punctuation are left out without a note. A time that is not a number is
    unknown.

    Raises:
        ContentError: A time is infinite, huge or reversed, or the words are phones, phases of
            gestures or emotions.
    """
    spoken: list[Entry] = []
    clocks = marked = repeated = 0
    seen: set[tuple[str, float | None, float | None]] = set()
    entries = list(entries)
    names = speakers_of(without_markup(entry.text)[0] for entry in entries)
    for entry in entries:
        text = entry.text.strip()
        if not is_spoken(text):
            continue
        text, markup = without_markup(text)
        text = without_speakers(text, names) if names else text
        text, times = without_clocks(text)
        marked += markup > 0
        clocks += times
        if not is_spoken(text):
            continue
        start, end = _checked_times(entry)
        key = (text, start, end)
        if start is not None and key in seen:
            repeated += 1
            continue
        seen.add(key)
        spoken.append(Entry(text, start, end, entry.place, entry.is_phrase))
    if are_phones(entry.text for entry in spoken if not entry.is_phrase):
        sample = " ".join(entry.text for entry in spoken[:8])
        raise ContentError(
            f"holds phones and no words ({sample} ...)",
            hint="give the aligner's file with the tier of the words, called 'words'",
        )
    if are_annotations(entry.text for entry in spoken):
        sample = " ".join(entry.text for entry in spoken[:8])
        raise ContentError(
            f"holds phases of gestures or emotions and no words ({sample})",
            hint="give a file with the words that are said",
        )
    notes = []
    if names:
        notes.append(f"names of speakers left out ({', '.join(sorted(names)):.60})")
    if clocks:
        notes.append(f"{counted(clocks, 'clock time')} among the words left out")
    if marked:
        notes.append(
            f"markup or sounds in brackets left out of {counted(marked, 'entry', 'entries')}"
        )
    if repeated:
        notes.append(
            f"{counted(repeated, 'entry', 'entries')} with the times and text of another left out"
        )
    return spoken, notes


def _checked_times(entry: Entry) -> tuple[float | None, float | None]:
    text = entry.text.strip()[:40]
    start, end = (
        None if time is None or math.isnan(time) else time for time in (entry.start, entry.end)
    )
    for time in (start, end):
        if time is not None and not abs(time) <= MAX_TIME:
            raise ContentError(
                f"the time of {text!r} is {time}",
                place=entry.place,
                hint="times are seconds from the start of the recording",
            )
    if start is not None and end is not None and end < start:
        if start - end > _ROUNDING_S:
            raise ContentError(
                f"{text!r} ends at {end:g} s, before it starts at {start:g} s",
                place=entry.place,
                hint="correct the two times",
            )
        end = start
    return start, end


def plausible_words(
    entries: Sequence[Entry], duration_s: float | None, goes_on: bool
) -> tuple[tuple[Word, ...], list[str]]:
    """Words with times that speech can have, in order of onset, and notes on what was changed.

    Args:
        entries: One word each, with both times in seconds.
        duration_s: Length of the sound, s.
        goes_on: The sound is a part of what the file is about: words beyond it are no fault.

    Raises:
        ContentError: A word is absurdly long, or most words lie beyond the sound, overlap, or
            last a few milliseconds.
    """
    words = []
    for entry in entries:
        assert entry.start is not None  # filled in by now
        assert entry.end is not None
        if len(entry.text) > MAX_WORD_CHARACTERS:
            raise ContentError(
                f"a word of {len(entry.text)} letters ({entry.text[:40]!r}...)",
                place=entry.place,
                hint="one word per entry is expected",
            )
        if max(abs(entry.start), abs(entry.end)) > MAX_TIME_S:
            raise ContentError(
                f"the times of {entry.text[:40]!r} are {entry.start:g} and {entry.end:g} s",
                place=entry.place,
                hint="times are seconds from the start of the recording",
            )
        words.append(Word(entry.text, entry.start, entry.end))
    words.sort(key=lambda word: (word.start, word.end))
    notes: list[str] = []
    if not words:
        return (), notes
    _require_pace(entries, words)
    if goes_on:
        duration_s = None
    if duration_s is not None:
        words = _within(words, duration_s, notes)
    return tuple(_lengthened(words, duration_s, notes)), notes


def require_columns(entries: Sequence[Entry]) -> None:
    """Refuse times of which most overlap: a column is taken for what it isn't.

    Raises:
        ContentError: So it is.
    """
    timed = sorted(
        (entry.start, entry.end, entry.text)
        for entry in entries
        if entry.start is not None and entry.end is not None
    )
    overlapping = [
        (one, other)
        for one, other in pairwise(timed)
        if one[1] - other[0] > 0.5 * min(one[1] - one[0], other[1] - other[0]) > 0
    ]
    if len(timed) >= _FEWEST and len(overlapping) > 0.6 * (len(timed) - 1):
        (start, end, text), (next_start, next_end, next_text) = overlapping[0]
        raise ContentError(
            f"most words overlap, e.g. {text[:40]!r} ({start:g} to {end:g}) and"
            f" {next_text[:40]!r} ({next_start:g} to {next_end:g})",
            hint="do its columns fit the format (TSV: start, end, word; CTM: recording, channel,"
            " start, duration, word)? Are its words those of one speaker?",
        )


def _require_pace(entries: Sequence[Entry], words: Sequence[Word]) -> None:
    median = median_word(entries) or 0.0
    span = words[-1].end - words[0].start
    if len(words) >= _FEWEST and max(median, 0.5 * span / len(words)) < SHORTEST_WORD_S:
        raise ContentError(
            f"its times are no seconds: {len(words)} words within {span:g} s",
            hint="convert them to seconds (minutes: multiply by 60)",
        )


def _within(words: list[Word], duration_s: float, notes: list[str]) -> list[Word]:
    """The words that lie within the sound, at least in part."""
    first, last = words[0].start, max(word.end for word in words)
    after = [word for word in words if word.start >= duration_s]
    before = [word for word in words if word.end <= 0 and word.start < 0]
    lost = len(after) + len(before)
    if lost == len(words) or (lost > 1 and lost > TOLERATED_SHARE * len(words)):
        where = (
            f"goes on to {last:.1f} s, but the sound lasts {duration_s:.1f} s"
            if len(after) >= len(before)
            else f"starts at {first:.1f} s, before the sound"
        )
        raise ContentError(
            f"{where} ({lost} of {counted(len(words), 'word')} lie outside it)",
            hint="give the transcript of this recording; if the sound was cut out of a longer one,"
            " cut the transcript too, with times from the start of the sound",
        )
    over = [
        word for word in words if word.start < duration_s and word.end - TOLERATED_S > duration_s
    ]
    for some, what in ((after, "left out, after the end of the sound"), (over, "cut at its end")):
        if some:
            notes.append(
                f"{counted(len(some), 'word')} of {len(words)} {what}: the words go on to"
                f" {last:.1f} s, the sound to {duration_s:.1f} s; is it the transcript of this"
                " recording?"
            )
    if before:
        notes.append(
            f"{counted(len(before), 'word')} of {len(words)} left out, before the start of the"
            f" sound: the first is at {first:.1f} s"
        )
    return [
        replace(word, end=duration_s) if word.end - TOLERATED_S > duration_s else word
        for word in words
        if word.start < duration_s and (word.end > 0 or word.start >= 0)
    ]


def _lengthened(words: list[Word], duration_s: float | None, notes: list[str]) -> list[Word]:
    """Words of a few milliseconds go on until the next one, or share the next one's time.

    Each keeps its start unless the next ones leave it no room: then they share what they have.
    """
    result: list[Word] = []
    moved = lost = 0
    index = 0
    while index < len(words):
        start = words[index].start
        if words[index].end - start >= SHORTEST_WORD_S:
            result.append(words[index])
            index += 1
            continue
        stop = index + 1
        while stop < len(words) and words[stop].start - start < SHORTEST_WORD_S * (stop - index):
            stop += 1
        run = words[index:stop]
        end = start + TYPICAL_LETTER_S * sum(max(1, letters(word.text)) for word in run)
        if stop < len(words):
            end = min(end, words[stop].start)
        end = max(end, *(word.end for word in run))
        if duration_s is not None and end > duration_s:
            room = max(SHORTEST_WORD_S, duration_s - start)
            run = run[: max(1, int(room / SHORTEST_WORD_S))]
            end = min(end, start + room)
        result += lay_out(run, start, end)
        moved += len(run)
        lost += stop - index - len(run)
        index = stop
    if moved:
        notes.append(
            f"{counted(moved, 'word')} of under {SHORTEST_WORD_S * 1e3:g} ms, or beside one, given"
            " the time up to the next"
        )
    if lost:
        notes.append(
            f"{counted(lost, 'word')} of under {SHORTEST_WORD_S * 1e3:g} ms left out, for which"
            " there is no time before the end of the sound"
        )
    return result
