"""The search of motion matching, exact and fast.

The published loops compare a query with every frame of the database. Here

1. each sequence's nearest frame is found from a lower bound: a rotation to the principal axes of
   the features keeps distances, and the first few axes hold nearly all of one; the lengths of what
   the other axes hold are one more coordinate, as ``|x' - q'| >= ||x'| - |q'||``. Only frames that
   the bound leaves open are measured in full, usually one or two of a sequence
   (`kernels.nearest_frames`).
2. A sum of ranks is at least the rank in the preselecting modality. So once the best sum among the
   first K candidates in that order is below K, none of the others can be chosen, and K is of the
   order of the root of their number.

Distances in double precision decide, so the result is that of `search_reference`, ties included.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.reading import usable_cores
from cospeech.errors import ConfigError
from cospeech.matching.database import MatchingDatabase
from cospeech.matching.kernels import MOST_STARTS, nearest_frames
from cospeech.matching.reference import STEP_FRAMES, Match, Preselect

_LEAD_COORDINATES = {False: 39, True: 111}
_PADDED_TO = 16  # starts, so that whole vector registers are worked on
_SEQUENCES_AT_ONCE = 512
_ROWS_FOR_AXES = 1 << 16
_UNIT_ROUNDOFF = 2.0**-24
_QUERIES_AT_ONCE = 128


_Side = tuple[NDArray[np.float32], NDArray[np.float64]]
"""Features of one modality, and the lengths that make them directions."""


class Query(NamedTuple):
    """One step of one synthesis.

    Attributes:
        pose: ``(Dp,)`` normalised pose feature of the frame before.
        audio: ``(Da,)`` normalised audio feature of the first frame wanted.
        k: Which candidate, from 1; the last one where there are fewer.
        mask: ``(M, T)``: a window needs it at its first and last frame. None: everywhere. Queries
            with the same mask should share the array.
        standing_on: (sequence, frame) the pose comes from, which is no candidate.
        closed: Sequences that aren't searched, e.g. those around the query's own recording.
        goes_on: (sequence, frame) the one window that its sequence offers, if it is eligible; it
            may be the frame stood on.
    """

    pose: NDArray[np.float32]
    audio: NDArray[np.float32]
    k: int = 1
    mask: NDArray[np.bool_] | None = None
    standing_on: tuple[int, int] | None = None
    closed: Sequence[int] | NDArray[np.int64] = ()
    goes_on: tuple[int, int] | None = None


class MatchingSearch:
    """Search of one database; preparing it reads the whole database once.

    Args:
        database: What is searched.
        step: Frames of a window.
        preselect: By what each sequence's candidate is found.
        start_offset: 0: a window begins with the frame that is like the one before, which then
            shows twice, as published. 1: with the frame after it.
        threads: How many share the work; as many as there are cores when None.

    Raises:
        ConfigError: A window is longer than the database's sequences, or has no frame.
    """

    def __init__(
        self,
        database: MatchingDatabase,
        step: int = STEP_FRAMES,
        preselect: Preselect = "pose",
        start_offset: int = 0,
        threads: int | None = None,
    ) -> None:
        count, frames = database.usable.shape
        self.starts = frames - step + 1 - start_offset
        if step < 1 or self.starts < 1:
            raise ConfigError(
                f"windows of {step} frames in sequences of {frames}",
                f"search in steps of 1 to {frames} frames",
            )
        if frames > MOST_STARTS:
            raise ConfigError(
                f"sequences of {frames} frames", f"fit sequences of {MOST_STARTS} frames or fewer"
            )
        self.database, self.step, self.preselect = database, step, preselect
        self.start_offset = start_offset
        self.threads = threads or usable_cores()
        self._usable = np.array(database.usable[:, : self.starts])
        pose = np.asarray(database.pose_features), np.ones((count, self.starts))
        audio_rows = np.asarray(database.audio_features)
        audio = audio_rows, _lengths(audio_rows, self.starts)
        self._first: _Side
        self._second: _Side
        self._by_audio = preselect == "audio"
        self._first, self._second = (audio, pose) if self._by_audio else (pose, audio)
        rows, lengths = self._first
        self._lead = _Lead(rows, lengths, self._usable, self._by_audio)

    def eligible(self, mask: NDArray[np.bool_] | None = None) -> NDArray[np.bool_]:
        """``(M, S)``: the windows that a mask leaves, by sequence and first frame."""
        if mask is None:
            return self._usable
        first, last = self.start_offset, self.start_offset + self.step - 1
        ends = mask[:, first:][:, : self.starts], mask[:, last:][:, : self.starts]
        return self._usable & ends[0] & ends[1]

    def __call__(self, query: Query) -> Match:
        """Answer one query."""
        return self.answer([query])[0]

    def answer(self, queries: Sequence[Query]) -> list[Match]:
        """Answer queries; many at once take less time each.

        Returns:
            One match per query: that of `search_reference`.
        """
        groups = range(0, len(queries), _QUERIES_AT_ONCE)
        return [match for i in groups for match in self._answer(queries[i : i + _QUERIES_AT_ONCE])]

    def _answer(self, queries: Sequence[Query]) -> list[Match]:
        count, asked = len(self.database), len(queries)
        poses, audio = ([getattr(q, name) for q in queries] for name in ("pose", "audio"))
        pose_queries = np.array(poses, dtype=np.float64)
        audio_queries = np.array(audio, dtype=np.float64)
        sides = [
            (*self._first, audio_queries if self._by_audio else pose_queries),
            (*self._second, pose_queries if self._by_audio else audio_queries),
        ]
        vectors, offsets, slack = self._lead.queries(sides[0][2])
        masks, which = self._masks([query.mask for query in queries])
        closed = np.zeros((asked, count), dtype=np.bool_)
        for i, query in enumerate(queries):
            closed[i, np.asarray(query.closed, dtype=np.int64)] = True
        hidden = np.array([query.standing_on or (-1, -1) for query in queries], dtype=np.int64)
        only = np.array([query.goes_on or (-1, -1) for query in queries], dtype=np.int64)
        frames = np.empty((asked, count), dtype=np.int16)
        distances = np.empty((2, asked, count))
        first, second = (
            (rows, lengths, wanted, np.sqrt((wanted * wanted).sum(axis=1)))
            for rows, lengths, wanted in sides
        )

        def search(sequences: tuple[int, int]) -> None:
            nearest_frames(
                sequences,
                self._lead.coordinates,
                self._lead.halves,
                vectors,
                offsets,
                slack,
                self._by_audio,
                first,
                second,
                masks,
                which,
                closed,
                hidden,
                only,
                frames,
                distances[0],
                distances[1],
            )

        def choose(i: int) -> Match:
            return self._choose(queries[i].k, frames[i], distances[0, i], distances[1, i])

        edges = np.linspace(0, count, min(self.threads, count) + 1).astype(int).tolist()
        parts = list(pairwise(edges))
        if len(parts) == 1:
            search(parts[0])
            return [choose(i) for i in range(asked)]
        with ThreadPoolExecutor(len(parts)) as pool:
            list(pool.map(search, parts))
            return list(pool.map(choose, range(asked)))

    def _masks(
        self, masks: Sequence[NDArray[np.bool_] | None]
    ) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """Each mask once, as `nearest_frames` wants it, and which of them every query has."""
        distinct = list({id(mask): mask for mask in masks if mask is not None}.values())
        places = {id(mask): i for i, mask in enumerate(distinct)}
        added = np.zeros((len(distinct), *self._lead.halves.shape), dtype=np.float32)
        for i, mask in enumerate(distinct):
            added[i, :, : self.starts][~self.eligible(mask)] = np.inf
        which = [-1 if mask is None else places[id(mask)] for mask in masks]
        return added, np.array(which, dtype=np.int64)

    def _choose(
        self,
        k: int,
        frames: NDArray[np.int16],
        first: NDArray[np.float64],
        second: NDArray[np.float64],
    ) -> Match:
        """The k-th candidate by the sum of its ranks in ``(M,)`` distances."""
        everyone = int((frames >= 0).sum())
        if everyone == 0:
            return Match(-1, -1, 0)
        k = min(k, everyone)
        if self.preselect == "pose_only":
            chosen = _first_of(first, k)[k - 1]
            return Match(int(chosen), int(frames[chosen]), everyone)
        ordered = np.sort(second)
        wanted = min(everyone, math.ceil(math.sqrt(2 * k * everyone)) + k)
        while True:
            near = _first_of(first, wanted)
            first_ranks = np.arange(len(near))
            own = second[near]
            second_ranks = ordered.searchsorted(own, "left")
            # Of equals, earlier sequences come first.
            for i in np.flatnonzero(ordered.searchsorted(own, "right") - second_ranks > 1):
                second_ranks[i] += np.count_nonzero(second[: near[i]] == own[i])
            sums = first_ranks + second_ranks
            worst = int(np.partition(sums, k - 1)[k - 1])
            # The next candidate's rank in the first order alone is len(near).
            if worst < len(near) or len(near) == everyone:
                break
            wanted = min(everyone, worst + 1)
        pose_ranks = second_ranks if self._by_audio else first_ranks
        chosen = near[np.lexsort((pose_ranks, sums))[k - 1]]
        return Match(int(chosen), int(frames[chosen]), everyone)


class _Lead:
    """Leading principal coordinates of the rows, whose differences bound distances from below.

    Args:
        rows: ``(M, T, D)`` features.
        lengths: ``(M, S)`` what rows are divided by: their lengths where directions are compared.
        usable: ``(M, S)``.
        is_audio: Whether directions are compared.
    """

    def __init__(
        self,
        rows: NDArray[np.float32],
        lengths: NDArray[np.float64],
        usable: NDArray[np.bool_],
        is_audio: bool,
    ) -> None:
        self._is_audio = is_audio
        (count, starts), width = lengths.shape, rows.shape[2]
        every = max(1, count * starts // _ROWS_FOR_AXES)
        sample = _scaled(rows[::every, :starts], lengths[::every]).reshape(-1, width)
        self._axes = np.linalg.eigh(sample.T @ sample)[1][:, ::-1].copy()
        self._kept = min(_LEAD_COORDINATES[is_audio], width)
        padded = -(-starts // _PADDED_TO) * _PADDED_TO
        # The kernel adds up coordinates in fours.
        self._unused = -(self._kept + 1) % 4
        height = self._kept + 1 + self._unused
        self.coordinates = np.zeros((count, height, padded), dtype=np.float32)
        self.halves = np.full((count, padded), np.inf, dtype=np.float32)
        self._longest = 0.0
        for first in range(0, count, _SEQUENCES_AT_ONCE):
            chosen = slice(first, first + _SEQUENCES_AT_ONCE)
            scaled = _scaled(rows[chosen, :starts], lengths[chosen])
            lead, length = self._rotated(scaled)
            self.coordinates[chosen, :, :starts] = lead.transpose(0, 2, 1)
            self._longest = max(self._longest, length)
            squares = np.where(usable[chosen], (scaled * scaled).sum(axis=2) / 2, np.inf)
            self.halves[chosen, :starts] = squares

    def queries(
        self, queries: NDArray[np.float64]
    ) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.float64]]:
        """``(B, L)`` vectors of ``(B, D)`` queries, their offsets and slack (`nearest_frames`)."""
        if self._is_audio:
            queries = _scaled(queries, np.sqrt((queries * queries).sum(axis=1)))
        lead, _ = self._rotated(queries)
        lengths = np.sqrt((queries * queries).sum(axis=1))
        # A sum of L products in single precision is off by at most L u |x| |q|, in whatever order
        # it is added up; the rest is for rounding the numbers themselves and what is added.
        largest = (lengths + self._longest) ** 2
        slack = (lead.shape[1] + 32) * _UNIT_ROUNDOFF * largest
        return -lead.astype(np.float32), lengths**2 / 2, slack

    def _rotated(self, values: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        rotated = values @ self._axes
        squares = rotated * rotated
        rest = np.sqrt(squares[..., self._kept :].sum(axis=-1, keepdims=True))
        longest = math.sqrt(float(squares.sum(axis=-1).max(initial=0)))
        unused = np.zeros((*rest.shape[:-1], self._unused))
        return np.concatenate([rotated[..., : self._kept], rest, unused], axis=-1), longest


def _first_of(distances: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """The first ``count`` candidates or more by distance; of equals the earlier sequence first."""
    limit = np.partition(distances, count - 1)[count - 1]
    near = np.flatnonzero(distances <= limit)
    return near[np.argsort(distances[near], kind="stable")]


def _lengths(rows: NDArray[np.float32], starts: int) -> NDArray[np.float64]:
    """``(M, S)`` lengths of the rows, as `audio_distances` computes them."""
    lengths = np.empty((len(rows), starts))
    for first in range(0, len(rows), _SEQUENCES_AT_ONCE):
        values = rows[first : first + _SEQUENCES_AT_ONCE, :starts].astype(np.float64)
        lengths[first : first + len(values)] = np.sqrt((values * values).sum(axis=2))
    return lengths


def _scaled(rows: NDArray[np.floating], lengths: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows over lengths; 0 where the length is 0."""
    values = rows.astype(np.float64)
    by = lengths[..., None]
    return np.divide(values, by, out=np.zeros_like(values), where=by > 0)
