"""The unit of word times: seconds, or what else the words would be spoken in at a human pace."""

from __future__ import annotations

import statistics
from collections.abc import Sequence

from cospeech.errors import ContentError
from cospeech.speech.transcript.entries import Entry

TIME_UNITS: tuple[tuple[float, str], ...] = (
    (1e3, "milliseconds"),
    (1e2, "hundredths of a second"),
    (1e7, "HTK's units of 100 ns"),
    (16000.0, "samples at 16 kHz"),
    (44100.0, "samples at 44.1 kHz"),
    (48000.0, "samples at 48 kHz"),
)
"""Units per second of word times that are not seconds."""

SLOWEST_WORD_S = 10.0
"""Half of all words never last longer, s."""

SLOW_WORD_S = 2.0
"""Half of all words rarely last longer, s; where times are whole numbers, they are no seconds."""

_FEWEST = 4  # words from which half of them means something

_USUAL_WORD_S = (0.08, 0.8)
"""Between these lies the length of half the words in any speech, s."""

_FROM_DURATION = 0.5
"""Share of the sound that sample numbers must reach, so that one sample rate alone fits."""

_TOLERATED_S = 0.5


def in_seconds(entries: Sequence[Entry], duration_s: float | None) -> tuple[list[Entry], list[str]]:
    """Entries in seconds, and a note where they were in milliseconds or samples.

    Only times that can't be seconds are touched: half of the words would last over
    `SLOWEST_WORD_S`. Above `SLOW_WORD_S` whole numbers are refused, and others noted.

    Args:
        entries: Of a format that doesn't say its unit.
        duration_s: Length of the sound, s, by which sample rates are told apart.

    Raises:
        ContentError: They aren't seconds, and it's not clear what else.
    """
    median = median_word(entries)
    if median is None or median <= SLOWEST_WORD_S:
        return list(entries), _on_slow_words(entries, median or 0.0)
    last = max(entry.end for entry in entries if entry.end is not None)
    possible = [
        (per_second, unit)
        for per_second, unit in TIME_UNITS
        if _USUAL_WORD_S[0] <= median / per_second <= _USUAL_WORD_S[1]
        and (per_second == TIME_UNITS[0][0] or _fits(last / per_second, duration_s))
    ]
    # Hundredths can be frames as well, and are never taken for sure.
    if len(possible) != 1 or possible[0][0] == TIME_UNITS[1][0]:
        told = " or ".join(f"{unit} (divide by {rate:g})" for rate, unit in possible)
        length = "" if duration_s is None else f", the sound lasts {duration_s:.1f} s"
        raise ContentError(
            f"its times are no seconds: half of the words last over {median:g}, the last ends at"
            f" {last:g}{length}",
            hint=f"convert them to seconds; they may be {told}"
            if told
            else "convert them to seconds (milliseconds: divide by 1000; samples: divide by the"
            " sample rate; frames: divide by the frame rate)",
        )
    per_second, unit = possible[0]
    converted = [entry.retimed(lambda time: time / per_second) for entry in entries]
    note = f"its times are {unit}: they were divided by {per_second:g} (the last word ends at"
    return converted, [f"{note} {last / per_second:.2f} s)"]


def _on_slow_words(entries: Sequence[Entry], median: float) -> list[str]:
    times = [time for entry in entries for time in (entry.start, entry.end) if time is not None]
    if len(entries) < _FEWEST or median <= SLOW_WORD_S:
        return []
    if all(time.is_integer() for time in times):
        raise ContentError(
            f"its times look like frame numbers or tenths of a second: they are whole numbers, and"
            f" half of the words would last over {median:g} s",
            hint="convert them to seconds (frames: divide by the frame rate; tenths: divide by 10)",
        )
    return [f"half of the words last over {median:.3g} s: are its times seconds?"]


def median_word(entries: Sequence[Entry]) -> float | None:
    """Median length per word over the entries that have both times; None where none has."""
    lengths = [
        (entry.end - entry.start) / max(1, len(entry.text.split()))
        for entry in entries
        if entry.start is not None and entry.end is not None
    ]
    return statistics.median(lengths) if lengths else None


def _fits(last_s: float, duration_s: float | None) -> bool:
    return duration_s is None or (_FROM_DURATION * duration_s < last_s <= duration_s + _TOLERATED_S)
