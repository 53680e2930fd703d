"""Gesture phases as a structure in time: shares, durations, what follows what."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import jensenshannon

Array = NDArray[np.float64]

DURATION_EDGES_S = (0.0, 0.15, 0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, np.inf)
"""Bins in which durations are compared; steps of about 1.4, as phases are half a second long."""


class PhaseCounts(NamedTuple):
    """Countable facts of one recording's labels; those of several recordings add up.

    Attributes:
        steps: ``(K,)`` steps with each label.
        segments: ``(K,)`` stretches with each label; one that the recording's edge cuts counts with
            the time that is there.
        transitions: ``(K, K)`` how often a stretch of one label is followed by one of another.
        durations: ``(K, D)`` stretches by duration, in the bins of `DURATION_EDGES_S`.
    """

    steps: Array
    segments: Array
    transitions: Array
    durations: Array


def count_phases(labels: NDArray[np.integer], classes: int, fps: float) -> PhaseCounts:
    """Count one recording's labels.

    Args:
        labels: ``(T,)`` class index per step.
        classes: Number of classes, K.
        fps: Steps per second.

    Raises:
        ValueError: A label is not a class.
    """
    labels = np.asarray(labels)
    if labels.size and not (labels.min() >= 0 and labels.max() < classes):
        raise ValueError(f"labels from {labels.min()} to {labels.max()} for {classes} classes")
    first = np.flatnonzero(np.diff(labels, prepend=-1))
    lengths = np.diff(first, append=len(labels))
    order = labels[first]
    transitions = np.zeros((classes, classes))
    np.add.at(transitions, (order[:-1], order[1:]), 1)
    durations = np.zeros((classes, len(DURATION_EDGES_S) - 1))
    bins = np.searchsorted(DURATION_EDGES_S, lengths / fps + 1e-9, side="right") - 1
    np.add.at(durations, (order, bins), 1)
    return PhaseCounts(
        np.bincount(labels, minlength=classes).astype(np.float64),
        np.bincount(order, minlength=classes).astype(np.float64),
        transitions,
        durations,
    )


@dataclass(frozen=True, eq=False)
class PhaseStructure:
    """Phases of a set of recordings.

    Attributes:
        shares: ``(K,)`` share of time, summing to 1.
        mean_durations_s: ``(K,)`` mean seconds of a stretch; NaN for a phase that never comes.
        transitions: ``(K, K)`` share of the stretches of one phase (row) that are followed by one
            of another (column); rows sum to 1, NaN for a phase that nothing follows.
        pairs: ``(K, K)`` the same transitions as shares of all, summing to 1.
        durations: ``(K, D)`` share of a phase's stretches in each bin of `DURATION_EDGES_S`; NaN
            for a phase that never comes.
    """

    shares: Array
    mean_durations_s: Array
    transitions: Array
    pairs: Array
    durations: Array


def phase_structure(counts: Sequence[PhaseCounts], fps: float) -> PhaseStructure:
    """The structure of several recordings together.

    Args:
        counts: From `count_phases`; a recording may be there twice when resampled.
        fps: Steps per second.
    """
    steps, segments, transitions, durations = (
        np.sum(parts, axis=0) for parts in zip(*counts, strict=True)
    )
    return PhaseStructure(
        shares=_share(steps, steps.sum()),
        mean_durations_s=_share(steps, segments) / fps,
        transitions=_share(transitions, transitions.sum(axis=1, keepdims=True)),
        pairs=_share(transitions, transitions.sum()),
        durations=_share(durations, segments[:, None]),
    )


def _share(part: Array, whole: Array) -> Array:
    whole = np.broadcast_to(whole, part.shape)
    return np.divide(part, whole, out=np.full(part.shape, np.nan), where=whole > 0)


class PhaseDistances(NamedTuple):
    """Jensen-Shannon distances (base 2, 0 to 1) between two structures.

    Attributes:
        shares: Of the shares of time.
        transitions: Of the transitions as shares of all.
        durations: Of each phase's durations, in the mean over phases; 1 where only one side has the
            phase, 0 where neither has.
    """

    shares: float
    transitions: float
    durations: float


def phase_distances(structure: PhaseStructure, real: PhaseStructure) -> PhaseDistances:
    """How far one structure is from another."""
    durations = map(_distance, structure.durations, real.durations)
    return PhaseDistances(
        _distance(structure.shares, real.shares),
        _distance(structure.pairs.ravel(), real.pairs.ravel()),
        float(np.mean(list(durations))),
    )


def _distance(first: Array, second: Array) -> float:
    absent = bool(np.isnan(first).any()), bool(np.isnan(second).any())
    if any(absent):
        return 0.0 if all(absent) else 1.0
    # rounding can leave a tiny negative divergence, whose root is NaN
    distance = float(jensenshannon(first, second, base=2))
    return 0.0 if np.isnan(distance) else distance
