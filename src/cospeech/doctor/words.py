"""Word times that can't be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from cospeech.doctor.audio import LEVEL_HZ, SILENT_DB, level_db
from cospeech.doctor.findings import Check, Files, Finding, Severity
from cospeech.doctor.stretches import word_intervals
from cospeech.speech.speech import Speech, Word
from cospeech.speech.transcript import TIME_UNITS

BEYOND_S, FAR_BEYOND_S = 0.1, 0.5
"""How far words may reach over an end of the audio, s: aligners round, and cut clips keep the word
they were cut in. The second is an error."""

RATE_WINDOW_S = 5.0
"""Stretch over which words are counted, s: long enough to hold a breath."""

FAST_WORDS_PER_S, IMPOSSIBLE_WORDS_PER_S = 6.0, 8.0
"""Words per second over `RATE_WINDOW_S`. Conversation has 2 to 4, fast readers 5 to 6; auctioneers
reach 8 for a moment."""

LONGEST_WORD_S = 4.0
"""A longer word swallowed a pause."""

SPEAKING_RANGE_DB = 20.0
"""Speech and its pauses lie this far apart in level; a hum or noise alone does not."""


def check_words_end(words: Sequence[Word], audio_s: float, files: Files) -> Iterator[Finding]:
    """Words outside the audio.

    Args:
        words: Before anything is cut.
        audio_s: Length of the audio, s.
        files: What to call them.
    """
    if not words:
        return
    times = word_intervals(words)
    last, first = float(times.max()), float(times.min())
    if last > 1.5 * audio_s + 60:
        for per_second, unit in TIME_UNITS:
            if 0.5 * audio_s < last / per_second < audio_s + FAR_BEYOND_S:
                yield Finding(
                    Check.WORD_TIMES,
                    Severity.ERROR,
                    files.words,
                    f"the last word ends at {last:g}, the audio at {audio_s:.2f} s: the times"
                    f" are {unit}",
                    f"divide them by {per_second:g}",
                )
                return
    beyond = np.flatnonzero(times[:, 1] > audio_s + BEYOND_S)
    if len(beyond):
        severity = _severity(last - audio_s, len(beyond))
        yield Finding(
            Check.WORD_TIMES,
            severity,
            files.words,
            f"{len(beyond)} words, from {words[beyond[0]].text!r} on, end after the audio"
            f" ({audio_s:.2f} s); the last one at {last:.2f} s",
            "check that the transcript belongs to this audio and that the audio is not cut off",
            time_s=float(times[beyond[0], 0]),
        )
    if first < -BEYOND_S:
        before = int((times[:, 0] < -BEYOND_S).sum())
        yield Finding(
            Check.WORD_TIMES,
            _severity(-first, before),
            files.words,
            f"{before} words start before the audio, the first at {first:.2f} s",
            "take the offset of the cut out of the word times",
            time_s=first,
        )


def _severity(over_s: float, words: int) -> Severity:
    """Of words that reach over an end; one that was cut by it is no fault."""
    if over_s > FAR_BEYOND_S:
        return Severity.ERROR
    return Severity.WARNING if words > 1 else Severity.NOTE


def check_word_rate(speech: Speech, files: Files) -> Iterator[Finding]:
    """Words that are missing, out of order, too many, or too long.

    Args:
        speech: Words and, where there is any, audio.
        files: What to call them.
    """
    if speech.words is None:
        return
    if not speech.words:
        yield from _no_words(speech, files)
        return
    times = word_intervals(speech.words)
    backward = np.flatnonzero(times[:, 1] < times[:, 0])
    unordered = np.flatnonzero(np.diff(times[:, 0]) < 0) + 1
    for wrong, what in ((backward, "end before they start"), (unordered, "are out of order")):
        if len(wrong):
            yield Finding(
                Check.WORD_TIMES,
                Severity.ERROR,
                files.words,
                f"{len(wrong)} words {what}, first {speech.words[wrong[0]].text!r}",
                "repair or re-align the transcript",
                time_s=float(times[wrong[0], 0]),
            )
    # Measured from each word to the one that a fast talker would reach in the window.
    starts = np.sort(times[:, 0])
    count = int(FAST_WORDS_PER_S * RATE_WINDOW_S)
    if len(starts) > count:
        spans = starts[count:] - starts[:-count]
        fastest = int(spans.argmin())
        rate = count / max(float(spans[fastest]), 1e-3)
        if rate > FAST_WORDS_PER_S:
            yield Finding(
                Check.WORD_TIMES,
                Severity.ERROR if rate > IMPOSSIBLE_WORDS_PER_S else Severity.WARNING,
                files.words,
                f"{count} words within {spans[fastest]:.2f} s: {rate:.1f} words per second",
                "check the unit and the scale of the word times, or re-align the transcript",
                time_s=float(starts[fastest]),
            )
    long = np.flatnonzero(times[:, 1] - times[:, 0] > LONGEST_WORD_S)
    if len(long):
        yield Finding(
            Check.WORD_TIMES,
            Severity.WARNING,
            files.words,
            f"{len(long)} words last over {LONGEST_WORD_S:g} s, first"
            f" {speech.words[long[0]].text!r}",
            "the aligner lost its place there: re-align, or leave the stretch out",
            time_s=float(times[long[0], 0]),
        )


def _no_words(speech: Speech, files: Files) -> Iterator[Finding]:
    level = level_db(speech.waveform)
    speaks = len(level) >= LEVEL_HZ and np.percentile(level, 95) > max(
        SILENT_DB, np.percentile(level, 5) + SPEAKING_RANGE_DB
    )
    yield Finding(
        Check.WORD_TIMES,
        Severity.WARNING,
        files.words,
        "the transcript is empty" + (", but somebody speaks" if speaks else ""),
        "transcribe the audio again; with no transcript at all the audio is used alone",
    )
