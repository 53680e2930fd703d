"""The inner loops of the search, compiled: each sequence's nearest eligible frame, by bounds.

Half the squared distance of a row ``x`` and a query ``q`` is ``h = |x|^2 / 2 - x.q + |q|^2 / 2``.
On axes that are turned (`cospeech.matching.leading`), ``x.q`` is the sum over the leading
coordinates plus at most ``r = |x'||q'|``, the lengths of what the other axes hold, and at least
minus that. So with ``low = |x|^2 / 2 - (sum + r) + |q|^2 / 2``

    low - slack <= h <= low + slack + 2 r

where ``slack`` covers that coordinates are 16-bit integers and that sums are in single precision.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

# Unlike `fastmath`, none of this assumes that there are no infinities.
_compiled = numba.njit(nogil=True, cache=True, error_model="numpy")

# Sums may be added up in another order, so that many terms are added at once. The order is the
# same for every row: equal rows are equally far, to the last bit.
_summing = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"reassoc", "contract"})

# Part of the caller: a call would count references to its arrays, which takes longer than a sum.
_inlined = numba.njit(nogil=True, cache=True, error_model="numpy", inline="always")

MOST_STARTS = 64
_FRAME_BITS = np.int32(MOST_STARTS - 1)
"""Low bits of a bound that make room for the frame it belongs to."""

_MOST_BITS = np.int32(2**31 - 1)
_PLACES = np.arange(MOST_STARTS, dtype=np.int32)
_PAIRS_AT_ONCE = 64
_LIBRARY_FROM = 8  # queries from which on a call of the linear algebra library pays
_LIBRARY_ALONE = 1 << 18
"""Multiplications up to which OpenBLAS starts no threads of its own, which would be in the way."""


class Side(NamedTuple):
    """What distances in one modality need.

    Attributes:
        is_audio: Whether distances are ``1 - cos``; else they are squared.
        rows: ``(M, T, D)`` features.
        lengths: ``(M, S)`` of the rows, for audio.
        queries: ``(B, D)``.
        short: ``(B, D)`` the same in single precision.
        query_lengths: ``(B,)``.
    """

    is_audio: bool
    rows: NDArray[np.float32]
    lengths: NDArray[np.float64]
    queries: NDArray[np.float64]
    short: NDArray[np.float32]
    query_lengths: NDArray[np.float64]


class Bounds(NamedTuple):
    """What bounds of the preselecting distance need; see the module for what they say.

    Attributes:
        coordinates: ``(M, L, S')`` of each start, starts padded to S'; L is a multiple of 4.
        halves: ``(M, S')`` of ``|x|^2 / 2``; infinite for starts that no query may use.
        vectors: ``(B, L)`` of each query; their product with a start's coordinates is
            ``-(sum + r)``.
        offsets: ``(B,)`` of ``|q|^2 / 2``.
        slack: ``(B,)``.
        rest: Which coordinate is the length of what the others leave out.
    """

    coordinates: NDArray[np.int16]
    halves: NDArray[np.float32]
    vectors: NDArray[np.float32]
    offsets: NDArray[np.float32]
    slack: NDArray[np.float32]
    rest: int


class Allowed(NamedTuple):
    """What queries may use.

    Attributes:
        masks: ``(E, M, S')`` infinite for starts that a query may not use, else 0.
        which: ``(B,)`` each query's mask; -1 for none.
        closed: ``(B, M)`` sequences that a query may not use.
        standing_on: ``(B, 2)`` a sequence and a frame that a query may not use; -1 for none.
        only: ``(B, 2)`` a sequence and the one frame that it offers if it may, even if the
            query stands on it; -1 for none.
    """

    masks: NDArray[np.float32]
    which: NDArray[np.int64]
    closed: NDArray[np.bool_]
    standing_on: NDArray[np.int64]
    only: NDArray[np.int64]


class Found(NamedTuple):
    """Each sequence's nearest eligible frame, written by `nearest_frames`.

    Attributes:
        frames: ``(B, M)``; -1 where none is eligible.
        low: ``(B, M)``: the preselecting distance is at least this.
        high: ``(B, M)``: and at most this. For poses both are of half the squared distance.
        second: ``(B, M)`` about the distance in the other modality.
    """

    frames: NDArray[np.int16]
    low: NDArray[np.float32]
    high: NDArray[np.float32]
    second: NDArray[np.float32]


@_inlined
def _squared(
    queries: NDArray[np.floating], b: int, rows: NDArray[np.float32], m: int, f: int
) -> np.floating:
    total = queries.dtype.type(0)
    for i in range(rows.shape[2]):
        difference = rows[m, f, i] - queries[b, i]
        total += difference * difference
    return total


@_inlined
def _product(
    queries: NDArray[np.floating], b: int, rows: NDArray[np.float32], m: int, f: int
) -> np.floating:
    total = queries.dtype.type(0)
    for i in range(rows.shape[2]):
        total += rows[m, f, i] * queries[b, i]
    return total


@_inlined
def _distance(
    is_audio: bool,
    rows: NDArray[np.float32],
    lengths: NDArray[np.float64],
    queries: NDArray[np.floating],
    query_lengths: NDArray[np.float64],
    b: int,
    m: int,
    f: int,
) -> float:
    """Distance of a query and a row, of one `Side`, in the precision of ``queries``."""
    if is_audio:
        length = lengths[m, f] * query_lengths[b]
        cosine = float(_product(queries, b, rows, m, f)) / length if length > 0 else 0.0
        measured = 1.0 - cosine
    else:
        measured = float(_squared(queries, b, rows, m, f))
    return measured


@_summing
def distance(side: Side, b: int, m: int, f: int) -> float:
    """Distance of query b and a row in double precision."""
    is_audio, rows, lengths, queries, _, query_lengths = side
    return _distance(is_audio, rows, lengths, queries, query_lengths, b, m, f)


@_inlined
def _few_scores(
    coordinates: NDArray[np.int16],
    m: int,
    vectors: NDArray[np.float32],
    scores: NDArray[np.float32],
    first: int,
) -> None:
    """``vectors @ coordinates[m]`` for few vectors, to scores from the first on."""
    for b in range(len(vectors)):
        for f in range(scores.shape[1]):
            scores[first + b, f] = 0
        for i in range(0, vectors.shape[1], 4):
            for f in range(scores.shape[1]):
                scores[first + b, f] += (
                    vectors[b, i] * np.float32(coordinates[m, i, f])
                    + vectors[b, i + 1] * np.float32(coordinates[m, i + 1, f])
                ) + (
                    vectors[b, i + 2] * np.float32(coordinates[m, i + 2, f])
                    + vectors[b, i + 3] * np.float32(coordinates[m, i + 3, f])
                )


@_inlined
def _many_scores(
    coordinates: NDArray[np.int16],
    m: int,
    vectors: NDArray[np.float32],
    scores: NDArray[np.float32],
    first: int,
    block: NDArray[np.float32],
) -> None:
    """The same for many vectors; ``block`` is worked in."""
    for i in range(block.shape[0]):
        for f in range(block.shape[1]):
            block[i, f] = coordinates[m, i, f]
    at_once = max(1, _LIBRARY_ALONE // block.size)
    for b in range(0, len(vectors), at_once):
        some = vectors[b : b + at_once]
        np.dot(some, block, scores[first + b : first + b + len(some)])


@_compiled
def _close(
    scores: NDArray[np.float32],
    pair: int,
    masks: NDArray[np.float32],
    mask: int,
    m: int,
    only: int,
    hidden: int,
) -> None:
    """Make infinite what a query may not use."""
    starts = scores.shape[1]
    if mask >= 0:
        for f in range(starts):
            scores[pair, f] += masks[mask, m, f]
    if 0 <= only < starts and scores[pair, only] < np.inf:
        for f in range(starts):
            if f != only:
                scores[pair, f] = np.inf
    elif 0 <= hidden < starts:
        scores[pair, hidden] = np.inf


@_summing
def nearest_frames(
    start: int, end: int, bounds: Bounds, first: Side, second: Side, allowed: Allowed, found: Found
) -> None:
    """Find the nearest eligible frame of sequences ``start`` to ``end``, for every query.

    Distances are measured only where bounds leave more than one frame open.
    """
    coordinates, halves, vectors, offsets, slacks, rest = bounds
    is_audio, rows, lengths, queries, _, query_lengths = first
    is_audio_2, rows_2, lengths_2, _, short_2, query_lengths_2 = second
    masks, which, closed, standing_on, only = allowed
    frames, low, high, other = found
    half = 1.0 if is_audio else 0.5  # 1 - cos is half of what two directions are apart, squared
    count, starts = len(vectors), coordinates.shape[2]
    # Worked on in tiles of sequences and queries: bounds stay in the nearest cache, and as all of
    # a tile come before its distances, rows come from memory together, not one after the other.
    wide = min(count, _PAIRS_AT_ONCE)
    tall = _PAIRS_AT_ONCE // wide
    block = np.empty((vectors.shape[1], starts), dtype=np.float32)
    scores = np.empty((tall * wide, starts), dtype=np.float32)
    bits = scores.view(np.int32)
    for tile in range(((end - start + tall - 1) // tall) * ((count + wide - 1) // wide)):
        row, column = divmod(tile, (count + wide - 1) // wide)
        m_from, b_from = start + row * tall, column * wide
        m_to, b_to = min(m_from + tall, end), min(b_from + wide, count)
        for m in range(m_from, m_to):
            at = (m - m_from) * wide
            if count < _LIBRARY_FROM:
                _few_scores(coordinates, m, vectors, scores, at)
            else:
                _many_scores(coordinates, m, vectors[b_from:b_to], scores, at, block)
        for m in range(m_from, m_to):
            for b in range(b_from, b_to):
                pair, offset = (m - m_from) * wide + b - b_from, offsets[b]
                for f in range(starts):
                    scores[pair, f] = max(scores[pair, f] + halves[m, f] + offset, np.float32(0))
                if which[b] >= 0 or only[b, 0] == m or standing_on[b, 0] == m:
                    forced = only[b, 1] if only[b, 0] == m else -1
                    hidden = standing_on[b, 1] if standing_on[b, 0] == m else -1
                    _close(scores, pair, masks, which[b], m, forced, hidden)
                # Floats of 0 and more are in the order of their bits.
                lowest = _MOST_BITS
                for f in range(starts):
                    lowest = min(lowest, (bits[pair, f] & ~_FRAME_BITS) | _PLACES[f])
                likely = lowest & _FRAME_BITS
                if closed[b, m] or scores[pair, likely] == np.inf:
                    frames[b, m], low[b, m], high[b, m] = -1, np.inf, np.inf
                    continue
                # Rounded, a coordinate is at most half too small; the vector's is negative.
                length = np.float32(coordinates[m, rest, likely]) + np.float32(0.5)
                width = np.float32(-2) * vectors[b, rest] * length
                frames[b, m] = likely
                low[b, m] = scores[pair, likely] - slacks[b]
                high[b, m] = scores[pair, likely] + width + slacks[b]
        for m in range(m_from, m_to):
            for b in range(b_from, b_to):
                pair, likely, slack = (m - m_from) * wide + b - b_from, frames[b, m], slacks[b]
                limit = high[b, m] + slack
                near = np.int32(0)
                for f in range(starts):
                    near += np.int32(scores[pair, f] <= limit)
                if near <= 1 or likely < 0:
                    continue
                best, nearest = np.inf, likely
                for turn in range(-1, starts):
                    f = likely if turn < 0 else turn
                    if turn >= 0 and (f == likely or scores[pair, f] > limit):
                        continue
                    measured = _distance(is_audio, rows, lengths, queries, query_lengths, b, m, f)
                    if measured < best or (measured == best and f < nearest):
                        best, nearest = measured, f
                        limit = np.float32(half * best) + slack
                frames[b, m] = nearest
                low[b, m] = np.float32(half * best) - slack
                high[b, m] = np.float32(half * best) + slack
        for m in range(m_from, m_to):
            for b in range(b_from, b_to):
                f = frames[b, m]
                if f >= 0:
                    other[b, m] = _distance(
                        is_audio_2, rows_2, lengths_2, short_2, query_lengths_2, b, m, f
                    )
