"""The choice by the sum of two ranks, compiled: distances are measured where bounds leave it open.

A sum of ranks is at least the rank in the preselecting modality. So once the best sum among the
first K candidates in that order is below K, none of the others can be chosen, and K is of the order
of the root of their number. Only those K are sorted; the rank of one in the other modality is the
number of candidates that are certainly nearer, and of those it can't be told of, measured.

Numbers are counted in buckets. The bucket of a number never falls as the number rises, so bounds of
a number are bounds of its bucket.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

# What is compiled here is kept on disk with `distance` in it: who edits that one alone deletes
# __pycache__.
from cospeech.matching.kernels import Found, Side, distance

_compiled = numba.njit(nogil=True, cache=True, error_model="numpy")
_SAMPLED = 16  # every so many


class _Buckets(NamedTuple):
    """Equal parts of the range of a number; what lies outside is in the first or the last one.

    Attributes:
        lowest: Where the first one begins.
        per_unit: Buckets per unit.
        last: The last one's place.
    """

    lowest: float
    per_unit: float
    last: float


@_compiled
def _bucket(buckets: _Buckets, value: float) -> int:
    place = (value - buckets.lowest) * buckets.per_unit
    return int(min(max(place, 0.0), buckets.last))


@_compiled
def _buckets(candidates: NDArray[np.int32], values: NDArray[np.float32]) -> _Buckets:
    """Buckets of about two candidates each; a sample's range will do."""
    lowest, highest = values[candidates[0]], values[candidates[0]]
    for i in range(0, len(candidates), _SAMPLED):
        value = values[candidates[i]]
        lowest, highest = min(lowest, value), max(highest, value)
    last = len(candidates) // 2
    per_unit = last / (highest - lowest) if highest > lowest else 0.0
    return _Buckets(lowest, per_unit, float(last))


@_compiled
def _first_of(
    side: Side,
    b: int,
    frames: NDArray[np.int16],
    low: NDArray[np.float32],
    high: NDArray[np.float32],
    candidates: NDArray[np.int32],
    wanted: int,
) -> NDArray[np.int32]:
    """The first ``wanted`` candidates or more by distance; of equals the earlier one first."""
    half = 1.0 if side.is_audio else 0.5
    buckets = _buckets(candidates, high)
    counts = np.zeros(int(buckets.last) + 1, dtype=np.int32)
    for m in candidates:
        counts[_bucket(buckets, high[m])] += 1
    last, size = -1, 0
    while size < wanted:
        last += 1
        size += counts[last]
    # At least ``wanted`` distances are in these buckets, as what they are at most is. All that are
    # in them are found, as what they are at least is in them too.
    near = np.empty(len(candidates), dtype=np.int32)
    size = 0
    for m in candidates:
        near[size] = m
        size += _bucket(buckets, low[m]) <= last
    distances = np.empty(size)
    kept = 0
    for m in near[:size]:
        measured = distance(side, b, m, frames[m])
        if _bucket(buckets, half * measured) <= last:
            near[kept], distances[kept] = m, measured
            kept += 1
    return near[:kept][np.argsort(distances[:kept], kind="mergesort")]


@_compiled
def _reach(side: Side, value: float, error: float) -> float:
    """Distances that differ by more than this from one are in order, whatever they are off."""
    return 2 * error * (1.0 if side.is_audio else value / (1 - error))


@_compiled
def _ranks(
    side: Side,
    b: int,
    frames: NDArray[np.int16],
    distances: NDArray[np.float32],
    error: float,
    candidates: NDArray[np.int32],
    near: NDArray[np.int32],
    k: int,
) -> NDArray[np.int64]:
    """The ranks of some candidates among all; of equals the earlier one is before.

    Args:
        side: The modality.
        b: The query.
        frames: Of every sequence.
        distances: Of every sequence, in single precision.
        error: How far off they may be: absolute for audio, relative for poses.
        candidates: All of them.
        near: Those whose ranks are wanted, in the order of the other modality.
        k: How many sums of both ranks count; a rank whose sum can't be among the k lowest may be
            given too low, but not so low that it seems to be.
    """
    buckets = _buckets(candidates, distances)
    begins = np.zeros(int(buckets.last) + 3, dtype=np.int32)
    places = np.empty(len(candidates), dtype=np.int32)
    for i in range(len(candidates)):
        place = _bucket(buckets, distances[candidates[i]])
        places[i] = place
        begins[place + 2] += 1
    for place in range(2, len(begins)):
        begins[place] += begins[place - 1]
    # Now bucket c begins at c + 1, and at c once it is filled.
    members = np.empty(len(candidates), dtype=np.int32)
    for i in range(len(candidates)):
        place = places[i] + 1
        members[begins[place]] = candidates[i]
        begins[place] += 1
    ranks = np.empty(len(near), dtype=np.int64)
    at_most = np.empty(len(near), dtype=np.int64)
    for i in range(len(near)):
        own, reach = np.float64(distances[near[i]]), _reach(side, distances[near[i]], error)
        first = begins[_bucket(buckets, own - reach)]
        nearer, open_ones = first, -1
        for j in members[first : begins[_bucket(buckets, own + reach) + 1]]:
            nearer += distances[j] - own < -reach
            open_ones += abs(distances[j] - own) <= reach
        ranks[i], at_most[i] = nearer, i + nearer + open_ones
    enough = np.partition(at_most, k - 1)[k - 1]
    measured = np.full(len(distances), np.nan)
    for i in range(len(near)):
        if i + ranks[i] == at_most[i] or i + ranks[i] > enough:
            continue
        m = near[i]
        own, reach = np.float64(distances[m]), _reach(side, distances[m], error)
        first, end = _bucket(buckets, own - reach), _bucket(buckets, own + reach) + 1
        for j in members[begins[first] : begins[end]]:
            if j == m or abs(distances[j] - own) > reach:
                continue
            for n in (m, j):
                if np.isnan(measured[n]):
                    measured[n] = distance(side, b, n, frames[n])
            nearer = measured[j] < measured[m]
            ranks[i] += nearer or (measured[j] == measured[m] and j < m)
    return ranks


@_compiled
def _choose(
    k: int, b: int, first: Side, second: Side, found: Found, error: float, alone: bool
) -> tuple[int, int, int]:
    """Sequence and frame, -1 where there is none, and the number of candidates."""
    frames, low, high, other = found.frames[b], found.low[b], found.high[b], found.second[b]
    candidates = np.empty(len(frames), dtype=np.int32)
    everyone = 0
    for m in range(len(frames)):
        candidates[everyone] = m
        everyone += frames[m] >= 0
    if everyone == 0:
        return -1, -1, 0
    candidates = candidates[:everyone]
    k = min(k, everyone)
    wanted = k if alone else min(everyone, math.ceil(math.sqrt(2.0 * k * everyone)) + k)
    while True:
        near = _first_of(first, b, frames, low, high, candidates, wanted)
        place, worst = k - 1, 0
        if not alone:
            ranks = _ranks(second, b, frames, other, error, candidates, near, k)
            # Sums, then pose ranks; both are below the number of candidates.
            keys = np.empty(len(near), dtype=np.int64)
            for i in range(len(near)):
                keys[i] = (i + ranks[i]) * everyone + (ranks[i] if first.is_audio else i)
            key = np.partition(keys, k - 1)[k - 1]
            worst, pose_rank = key // everyone, key % everyone
            place = worst - pose_rank if first.is_audio else pose_rank
        # The next candidate's rank in the first order alone is len(near).
        if worst < len(near) or len(near) == everyone:
            chosen = near[place]
            return chosen, frames[chosen], everyone
        wanted = min(everyone, worst + 1)


@_compiled
def choose(
    start: int,
    end: int,
    ks: NDArray[np.int64],
    first: Side,
    second: Side,
    found: Found,
    error: float,
    alone: bool,
    chosen: NDArray[np.int64],
) -> None:
    """Choose candidates by the sum of their ranks, and of equal sums by the nearer pose.

    Args:
        start: The first query.
        end: The one after the last.
        ks: ``(B,)`` which candidate, from 1; the last one where there are fewer.
        first: The preselecting modality.
        second: The other one.
        found: Every sequence's candidate.
        error: How far ``found.second`` may be off: absolute for audio, relative for poses.
        alone: Whether the first modality counts alone.
        chosen: ``(B, 3)``, written: sequence and frame, -1 where there is none, and the number of
            candidates.
    """
    for b in range(start, end):
        chosen[b] = _choose(ks[b], b, first, second, found, error, alone)
