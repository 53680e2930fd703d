"""The inner loop of the search, compiled: each sequence's nearest eligible frame, exactly."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

# Unlike `fastmath`, none of this assumes that there are no infinities.
_compiled = numba.njit(nogil=True, cache=True, error_model="numpy")

# Sums may be added up in another order, so that eight terms are added at once. The order is the
# same for every row: equal rows are equally far, to the last bit.
_summing = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"reassoc", "contract"})

_FRAME_BITS = 63
"""Low bits of a bound that make room for the frame it belongs to."""

MOST_STARTS = _FRAME_BITS + 1
_PAIRS_AT_ONCE = 64
_LIBRARY_FROM = 8  # queries from which on a call of the linear algebra library pays


# Rows are named by their places: a view of one would be counted, which takes longer than the sum.


@_summing
def _squared(
    queries: NDArray[np.float64], b: int, rows: NDArray[np.float32], m: int, f: int
) -> float:
    total = 0.0
    for i in range(rows.shape[2]):
        difference = rows[m, f, i] - queries[b, i]
        total += difference * difference
    return total


@_summing
def _product(
    queries: NDArray[np.float64], b: int, rows: NDArray[np.float32], m: int, f: int
) -> float:
    total = 0.0
    for i in range(rows.shape[2]):
        total += rows[m, f, i] * queries[b, i]
    return total


@_summing
def _scores(
    lead: NDArray[np.float32], vectors: NDArray[np.float32], scores: NDArray[np.float32]
) -> None:
    """``vectors @ lead`` for few vectors."""
    starts = lead.shape[1]
    for b in range(len(vectors)):
        for f in range(starts):
            scores[b, f] = 0
        for i in range(0, len(lead), 4):
            for f in range(starts):
                scores[b, f] += (
                    vectors[b, i] * lead[i, f] + vectors[b, i + 1] * lead[i + 1, f]
                ) + (vectors[b, i + 2] * lead[i + 2, f] + vectors[b, i + 3] * lead[i + 3, f])


@numba.njit(nogil=True, cache=True, error_model="numpy", inline="always")
def _distance(
    is_audio: bool,
    rows: NDArray[np.float32],
    lengths: NDArray[np.float64],
    queries: NDArray[np.float64],
    query_lengths: NDArray[np.float64],
    b: int,
    m: int,
    f: int,
) -> float:
    if is_audio:
        length = lengths[m, f] * query_lengths[b]
        cosine = _product(queries, b, rows, m, f) / length if length > 0 else 0.0
        distance = 1 - cosine
    else:
        distance = _squared(queries, b, rows, m, f)
    return distance


@_compiled
def _likely_frame(
    scores: NDArray[np.float32],
    b: int,
    halves: NDArray[np.float32],
    m: int,
    offset: np.float32,
    masks: NDArray[np.float32],
    mask: int,
    only: int,
    hidden: int,
    bounds: NDArray[np.float32],
    bits: NDArray[np.int32],
    pair: int,
) -> int:
    """Write a pair's bounds, and give the frame with the lowest; -1 where none is eligible."""
    padded = bounds.shape[1]
    for f in range(padded):
        bounds[pair, f] = max(scores[b, f] + halves[m, f] + offset, np.float32(0))
    if mask >= 0:
        for f in range(padded):
            bounds[pair, f] += masks[mask, m, f]
    if 0 <= only < padded and bounds[pair, only] < np.inf:
        for f in range(padded):
            if f != only:
                bounds[pair, f] = np.inf
    elif 0 <= hidden < padded:
        bounds[pair, hidden] = np.inf
    # Floats of 0 and more are in the order of their bits.
    lowest = np.int32(2**31 - 1)
    for f in range(padded):
        lowest = min(lowest, (bits[pair, f] & ~_FRAME_BITS) | (f & _FRAME_BITS))
    likely = lowest & _FRAME_BITS
    return int(likely) if bounds[pair, likely] < np.inf else -1


@_compiled
def nearest_frames(
    sequences: tuple[int, int],
    lead: NDArray[np.float32],
    halves: NDArray[np.float32],
    vectors: NDArray[np.float32],
    offsets: NDArray[np.float64],
    slack: NDArray[np.float64],
    first_is_audio: bool,
    first: tuple[Any, ...],
    second: tuple[Any, ...],
    masks: NDArray[np.float32],
    which: NDArray[np.int64],
    closed: NDArray[np.bool_],
    standing_on: NDArray[np.int64],
    only: NDArray[np.int64],
    frames: NDArray[np.int16],
    first_distances: NDArray[np.float64],
    second_distances: NDArray[np.float64],
) -> None:
    """Find, for every sequence and query, the nearest eligible frame and both its distances.

    Args:
        sequences: First sequence, and the one after the last.
        lead: ``(M, L, S')`` leading coordinates of each start, starts padded to S'; L is a multiple
            of 4.
        halves: ``(M, S')`` half the squared length of each start's features; infinite for starts
            that no query may use.
        vectors: ``(B, L)`` of each query; ``vectors @ lead[m] + halves[m] + offsets`` is at most
            half the squared distance, but for rounding.
        offsets: ``(B,)``.
        slack: ``(B,)`` how much more than half the squared distance that sum may be.
        first_is_audio: Whether audio is the modality that preselects; else poses are.
        first: Of the preselecting modality: rows ``(M, T, D)``, their lengths ``(M, S)``, queries
            ``(B, D)`` and their lengths ``(B,)``.
        second: The same of the other one.
        masks: ``(E, M, S')`` infinite for starts that a query may not use, else 0.
        which: ``(B,)`` each query's mask; -1 for none.
        closed: ``(B, M)`` sequences that a query may not use.
        standing_on: ``(B, 2)`` a sequence and a frame that a query may not use; -1 for none.
        only: ``(B, 2)`` a sequence and the one frame that it offers if it may, even if the
            query stands on it; -1 for none.
        frames: ``(B, M)``, written: the nearest frame; -1 where none is eligible.
        first_distances: ``(B, M)``, written: infinite where none is eligible.
        second_distances: ``(B, M)``, written, the same.
    """
    rows_1, lengths_1, queries_1, query_lengths_1 = first
    rows_2, lengths_2, queries_2, query_lengths_2 = second
    count, padded = len(vectors), lead.shape[2]
    # Pairs of a sequence and a query are worked on in groups, first all bounds, then all distances:
    # the processor then waits for many rows from memory at once, not for one after the other.
    together = max(1, _PAIRS_AT_ONCE // count)
    scores = np.empty((count, padded), dtype=np.float32)
    bounds = np.empty((together * count, padded), dtype=np.float32)
    bits = bounds.view(np.int32)
    likely = np.empty(together * count, dtype=np.int64)
    distances = np.empty(together * count)
    for group in range(sequences[0], sequences[1], together):
        stop = min(group + together, sequences[1])
        for m in range(group, stop):
            if count < _LIBRARY_FROM:
                _scores(lead[m], vectors, scores)
            else:
                np.dot(vectors, lead[m], scores)
            for b in range(count):
                pair = (m - group) * count + b
                likely[pair] = _likely_frame(
                    scores,
                    b,
                    halves,
                    m,
                    np.float32(offsets[b]),
                    masks,
                    which[b],
                    only[b, 1] if only[b, 0] == m else -1,
                    standing_on[b, 1] if standing_on[b, 0] == m else -1,
                    bounds,
                    bits,
                    pair,
                )
                if closed[b, m]:
                    likely[pair] = -1
        for m in range(group, stop):
            for b in range(count):
                pair, f = (m - group) * count + b, likely[(m - group) * count + b]
                if f >= 0:
                    distances[pair] = _distance(
                        first_is_audio, rows_1, lengths_1, queries_1, query_lengths_1, b, m, f
                    )
        for m in range(group, stop):
            for b in range(count):
                pair, nearest = (m - group) * count + b, likely[(m - group) * count + b]
                frames[b, m] = nearest
                first_distances[b, m] = second_distances[b, m] = np.inf
                if nearest < 0:
                    continue
                best = distances[pair]
                # 1 - cos is half the squared distance of two vectors of length 1.
                limit = np.float32((best if first_is_audio else best / 2) + slack[b])
                near = 0
                for f in range(padded):
                    near += bounds[pair, f] <= limit
                if near > 1:
                    for f in range(padded):
                        if bounds[pair, f] > limit or f == likely[pair]:
                            continue
                        distance = _distance(
                            first_is_audio, rows_1, lengths_1, queries_1, query_lengths_1, b, m, f
                        )
                        if distance < best or (distance == best and f < nearest):
                            best, nearest = distance, f
                            limit = np.float32((best if first_is_audio else best / 2) + slack[b])
                frames[b, m], first_distances[b, m] = nearest, best
        for m in range(group, stop):
            for b in range(count):
                f = frames[b, m]
                if f >= 0:
                    second_distances[b, m] = _distance(
                        not first_is_audio, rows_2, lengths_2, queries_2, query_lengths_2, b, m, f
                    )
