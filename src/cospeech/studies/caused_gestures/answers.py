"""Whether the wrists move while a stroke was made for the speech, and when they do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import find_peaks
from scipy.stats import rankdata

from cospeech.studies.caused_gestures.concepts import WRISTS
from cospeech.studies.caused_gestures.strokes import Stroke

Array = NDArray[np.float64]

NEAR_S = 0.2
"""Seconds from the middle of a beat within which a peak of speed answers it."""

SHIFTS = 64
"""Shifts of the beats that chance is the mean of."""

_SMOOTHING = (0.25, 0.5, 0.25)
_PROMINENCE = 0.5


def wrist_speeds(positions: ArrayLike, fps: float) -> Array:
    """Mean speed of both wrists at each step, smoothed over three steps.

    Args:
        positions: ``(T, 10, 3)`` upper body, root-relative, metres.
        fps: Frames per second.

    Returns:
        ``(T - 1,)`` metres per second; step i is at ``(i + 0.5) / fps`` s.
    """
    wrists = np.asarray(positions, dtype=np.float64)[:, WRISTS]
    speeds = np.linalg.norm(np.diff(wrists, axis=0), axis=-1).mean(axis=-1) * fps
    smoothed = np.convolve(np.pad(speeds, 1, mode="edge"), _SMOOTHING, mode="valid")
    return smoothed.astype(np.float64)


def step_times(steps: int, fps: float) -> Array:
    """``(steps,)`` seconds at which the steps of `wrist_speeds` are."""
    return (np.arange(steps, dtype=np.float64) + 0.5) / fps


def within(times: Array, start_s: float, end_s: float) -> NDArray[np.bool_]:
    """Which times are in a stretch."""
    inside: NDArray[np.bool_] = (times >= start_s) & (times < end_s)
    return inside


def faster_than_between(
    speeds: Array,
    fps: float,
    asked: Sequence[Stroke],
    all_strokes: Sequence[Stroke],
    gesturing_s: tuple[float, float],
) -> Array:
    """How much faster wrists are within each stroke than between strokes, whatever their speeds.

    The area under the curve: the share of steps between strokes that are slower than a step of the
    stroke, those equally fast counting half, in the mean over its steps. 0.5 is no difference.

    Args:
        speeds: ``(T - 1,)`` from `wrist_speeds`.
        fps: Frames per second.
        asked: The strokes that are asked about.
        all_strokes: All strokes; between them is what is in none.
        gesturing_s: The stretch that is looked at, seconds.

    Returns:
        ``(len(asked),)``; NaN where there is nothing between strokes, or a stroke without a step.
    """
    times = step_times(len(speeds), fps)
    between = within(times, *gesturing_s)
    for stroke in all_strokes:
        between &= ~within(times, stroke.start_s, stroke.end_s)
    others = np.sort(speeds[between])
    found = np.full(len(asked), np.nan)
    for i, stroke in enumerate(asked):
        own = speeds[within(times, stroke.start_s, stroke.end_s)]
        if len(own) and len(others):
            slower = np.searchsorted(others, own, "left") + np.searchsorted(others, own, "right")
            found[i] = slower.mean() / (2 * len(others))
    return found


def ranks_at_lags(
    speeds: Array,
    fps: float,
    asked: Sequence[Stroke],
    gesturing_s: tuple[float, float],
    lags_s: ArrayLike,
) -> Array:
    """How fast wrists are within strokes that are taken to come later than they did.

    Args:
        speeds: ``(T - 1,)`` from `wrist_speeds`.
        fps: Frames per second.
        asked: The strokes.
        gesturing_s: The stretch that is looked at, seconds.
        lags_s: ``(L,)`` seconds by which motion may follow the recorded strokes; where wrists are
            fastest is how late the motion is.

    Returns:
        ``(len(asked), L)`` mean rank of the speeds among all of the stretch, 0 slowest to 1
        fastest; NaN where a stroke is out of the stretch.
    """
    times = step_times(len(speeds), fps)
    inside = within(times, *gesturing_s)
    times, speeds = times[inside], speeds[inside]
    ranks = (rankdata(speeds) - 0.5) / max(1, len(speeds))
    lags = np.asarray(lags_s, dtype=np.float64)
    found = np.full((len(asked), len(lags)), np.nan)
    for i, stroke in enumerate(asked):
        for k, lag in enumerate(lags.tolist()):
            own = ranks[within(times, stroke.start_s + lag, stroke.end_s + lag)]
            if len(own):
                found[i, k] = own.mean()
    return found


def peak_times(speeds: Array, fps: float, gesturing_s: tuple[float, float]) -> Array:
    """When wrists are fastest: peaks that stand out by half of the speeds' standard deviation.

    Args:
        speeds: ``(T - 1,)`` from `wrist_speeds`.
        fps: Frames per second.
        gesturing_s: The stretch that is looked at, seconds.

    Returns:
        ``(P,)`` seconds.
    """
    times = step_times(len(speeds), fps)
    inside = within(times, *gesturing_s)
    times, speeds = times[inside], speeds[inside]
    spread = float(speeds.std()) if len(speeds) else 0.0
    if spread < 1e-6:
        return np.zeros(0)
    found: Array = times[find_peaks(speeds, prominence=_PROMINENCE * spread)[0]]
    return found


def met(
    moments_s: ArrayLike, peaks_s: Array, gesturing_s: tuple[float, float]
) -> tuple[float, float]:
    """How many moments have a peak within `NEAR_S`, and how many do by chance.

    Chance is the mean over the moments shifted around within the stretch, by a quarter to three
    quarters of it.

    Args:
        moments_s: ``(n,)`` middles of strokes, seconds.
        peaks_s: ``(P,)`` from `peak_times`.
        gesturing_s: The stretch.
    """
    moments = np.asarray(moments_s, dtype=np.float64)
    if not len(peaks_s) or not len(moments):
        return 0.0, 0.0
    start_s, end_s = gesturing_s
    length_s = end_s - start_s

    def count(times: Array) -> float:
        gaps = np.abs(times[:, None] - peaks_s[None]).min(axis=1)
        return float((gaps <= NEAR_S).sum())

    shifts = np.linspace(0.25, 0.75, SHIFTS) * length_s
    chance = [count(start_s + (moments - start_s + shift) % length_s) for shift in shifts]
    return count(moments), float(np.mean(chance))
