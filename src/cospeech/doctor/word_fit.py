"""Whether a transcript belongs to the audio: speech energy inside words against outside.

The level of the audio in dB is correlated with "a word is being spoken", for the word times as they
are and shifted. A transcript that fits has one sharp peak at shift 0, a late one a peak elsewhere,
another recording's transcript none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import correlate

from cospeech.doctor.audio import LEVEL_HZ

RANGE_DB = 50.0
"""Levels are looked at this far below the loudest; what is lower is silence all the same."""

FARTHEST_SHIFT_S = 5.0
"""Shifts that are tried, s."""

LEAST_OVERLAP = 0.6
"""Share of the words' time that must lie within the audio for a shift to count."""

NEAR_S = 0.4
"""A peak is distinct if nothing outside this distance comes near it, s: half a word and its
pause."""


@dataclass(frozen=True)
class Fit:
    """How well words fit a level curve.

    Attributes:
        at_zero: Correlation at shift 0, -1 to 1.
        best: Highest correlation at any shift.
        shift_s: Its shift, s: by how much the words would have to be later.
        runner_up: Highest correlation away from the best.
    """

    at_zero: float
    best: float
    shift_s: float
    runner_up: float


def is_judgeable(
    intervals: NDArray[np.float64],
    *,
    least_words: int = 15,
    least_s: float = 10.0,
    least_gaps_s: float = 1.5,
) -> bool:
    """Whether words have enough pauses between them to be told apart from other words.

    Interpolated word times leave none, and say nothing then.

    Args:
        intervals: ``(W, 2)`` starts and ends, s.
        least_words: Fewest words.
        least_s: Least time from the first to the last, s.
        least_gaps_s: Least time without a word in between, s.
    """
    if len(intervals) < least_words:
        return False
    start, end = float(intervals[:, 0].min()), float(intervals[:, 1].max())
    frames = max(1, int((end - start) * LEVEL_HZ))
    if frames > 24 * 3600 * LEVEL_HZ:
        return False
    spoken = _spoken(intervals - start, frames)
    return end - start >= least_s and (1 - spoken).sum() / LEVEL_HZ >= least_gaps_s


def fit_words(
    level: NDArray[np.float64],
    intervals: NDArray[np.float64],
    farthest_s: float = FARTHEST_SHIFT_S,
) -> Fit | None:
    """Correlation of level and words over shifts.

    Args:
        level: ``(N,)`` dB at `LEVEL_HZ`; see `cospeech.doctor.audio.level_db`.
        intervals: ``(W, 2)`` starts and ends of words, s.
        farthest_s: Largest shift tried, s.

    Returns:
        None where no shift can be judged.
    """
    profile = shift_profile(level, intervals, farthest_s)
    if profile is None or np.isnan(profile).all():
        return None
    reach = len(profile) // 2
    best = int(np.nanargmax(profile))
    near = round(NEAR_S * LEVEL_HZ)
    elsewhere = np.delete(
        profile, np.arange(max(0, best - near), best + near + 1).clip(max=2 * reach)
    )
    runner_up = float(np.nanmax(elsewhere)) if np.isfinite(elsewhere).any() else -1.0
    at_zero = float(profile[reach])
    return Fit(
        at_zero if np.isfinite(at_zero) else 0.0,
        float(profile[best]),
        (best - reach) / LEVEL_HZ,
        runner_up,
    )


def shift_profile(
    level: NDArray[np.float64], intervals: NDArray[np.float64], farthest_s: float
) -> NDArray[np.float64] | None:
    """Pearson's correlation of level and words for every shift of 10 ms.

    Only the time from the first to the last word counts: pauses before and after the speech fit any
    transcript.

    Args:
        level: ``(N,)`` dB at `LEVEL_HZ`.
        intervals: ``(W, 2)`` starts and ends of words, s.
        farthest_s: Largest shift tried, s.

    Returns:
        ``(2 S + 1,)`` for shifts of -S to S steps, NaN where too little of the words lies within
        the audio; None where the words leave no audio or no pause at all.
    """
    if len(intervals) == 0 or len(level) == 0:
        return None
    reach = round(farthest_s * LEVEL_HZ)
    first = max(0, round(float(intervals[:, 0].min()) * LEVEL_HZ))
    last = min(len(level), round(float(intervals[:, 1].max()) * LEVEL_HZ))
    if last - first < 2:
        return None
    spoken = _spoken(intervals - first / LEVEL_HZ, last - first)
    clear = np.maximum(level, np.percentile(level, 99) - RANGE_DB)
    clear = clear - clear.mean()
    low, high = first - reach, last + reach
    there = np.zeros(high - low)
    heard = np.zeros(high - low)
    inside = slice(max(0, low), min(len(level), high))
    there[inside.start - low : inside.stop - low] = 1.0
    heard[inside.start - low : inside.stop - low] = clear[inside]
    window = last - first

    def windowed(values: NDArray[np.float64]) -> NDArray[np.float64]:
        sums = np.concatenate([[0.0], np.cumsum(values)])
        return sums[window:] - sums[:-window]

    def crossed(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return correlate(values, spoken, mode="valid", method="fft")

    count = windowed(there)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean_level, mean_spoken = windowed(heard) / count, crossed(there) / count
        covariance = crossed(heard) / count - mean_level * mean_spoken
        level_variance = windowed(heard**2) / count - mean_level**2
        spoken_variance = mean_spoken - mean_spoken**2
        product = level_variance * spoken_variance
        profile = covariance / np.sqrt(np.maximum(product, 0))
    useless = (count < LEAST_OVERLAP * window) | (level_variance < 0.01) | (spoken_variance < 1e-4)
    profile[useless] = np.nan
    return profile


def _spoken(intervals: NDArray[np.float64], frames: int) -> NDArray[np.float64]:
    """``(frames,)`` 1 where a word is being spoken, else 0."""
    edges = np.zeros(frames + 1)
    bounds = np.rint(intervals * LEVEL_HZ).clip(0, frames).astype(np.int64)
    np.add.at(edges, bounds[:, 0], 1)
    np.add.at(edges, bounds[:, 1], -1)
    return (np.cumsum(edges)[:frames] > 0).astype(np.float64)
