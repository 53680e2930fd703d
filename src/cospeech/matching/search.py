"""The search of motion matching, exact and fast.

The published loops compare a query with every frame of the database, in every number. Here

1. each sequence's nearest frame is found from bounds that need half of the numbers, as 16-bit
   integers; only frames that the bounds leave open are measured (`kernels.nearest_frames`);
2. ranks are found only for candidates that can win, a few hundred (`ranking.choose`).

Distances in double precision decide, so the result is that of `search_reference`, ties included.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.reading import usable_cores
from cospeech.errors import ConfigError
from cospeech.matching.database import MatchingDatabase
from cospeech.matching.kernels import MOST_STARTS, Allowed, Found, Side, nearest_frames
from cospeech.matching.leading import UNIT_ROUNDOFF, LeadingCoordinates, row_lengths
from cospeech.matching.ranking import choose
from cospeech.matching.reference import STEP_FRAMES, Match, Preselect

_QUERIES_AT_ONCE = 256


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
        _, frames = database.usable.shape
        self.starts = frames - step + 1 - start_offset
        if step < 1 or self.starts < 1:
            raise ConfigError(
                f"windows of {step} frames in sequences of {frames}",
                f"search in steps of 1 to {frames - start_offset} frames",
            )
        if frames > MOST_STARTS:
            raise ConfigError(
                f"sequences of {frames} frames", f"fit sequences of {MOST_STARTS} frames or fewer"
            )
        self.database, self.step, self.preselect = database, step, preselect
        self.start_offset = start_offset
        self.threads = threads or usable_cores()
        self._usable = np.array(database.usable[:, : self.starts])
        pose, audio = np.asarray(database.pose_features), np.asarray(database.audio_features)
        lengths = row_lengths(audio, self.starts)
        ones = np.ones_like(lengths)
        self._by_audio = preselect == "audio"
        self._audio, self._pose = (audio, lengths), (pose, ones)
        rows, by = self._audio if self._by_audio else self._pose
        self._leading = LeadingCoordinates(rows, by, self._usable, self._by_audio)

    @property
    def streamed_bytes(self) -> int:
        """Bytes that a query reads, and a group of queries together, whatever is then measured."""
        return self._leading.nbytes

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
        sequences, answers = len(self.database), len(queries)
        pose = self._side(False, np.array([query.pose for query in queries], dtype=np.float32))
        audio = self._side(True, np.array([query.audio for query in queries], dtype=np.float32))
        first, second = (audio, pose) if self._by_audio else (pose, audio)
        bounds = self._leading.bounds(first.queries)
        allowed = self._allowed(queries)
        found = Found(
            np.empty((answers, sequences), dtype=np.int16),
            *(np.empty((answers, sequences), dtype=np.float32) for _ in range(3)),
        )
        # A sum of D products or squares in single precision is off by at most D u times the sum of
        # their magnitudes: the product of both lengths, or the sum itself.
        error = (second.rows.shape[2] + 16) * UNIT_ROUNDOFF

        alone = self.preselect == "pose_only"
        ks = np.array([query.k for query in queries], dtype=np.int64)
        chosen = np.empty((answers, 3), dtype=np.int64)

        def search(start: int, end: int) -> None:
            nearest_frames(start, end, bounds, first, second, allowed, found)

        def rank(start: int, end: int) -> None:
            choose(start, end, ks, first, second, found, error, alone, chosen)

        self._share(search, sequences)
        self._share(rank, answers)
        return [Match(*values) for values in chosen.tolist()]

    def _share(self, work: Callable[[int, int], None], count: int) -> None:
        """Do work on parts of a range, in threads."""
        edges = np.linspace(0, count, min(self.threads, count) + 1).astype(int).tolist()
        if len(edges) == 2:
            work(0, count)
            return
        with ThreadPoolExecutor(len(edges) - 1) as pool:
            list(pool.map(work, edges[:-1], edges[1:]))

    def _side(self, is_audio: bool, queries: NDArray[np.float32]) -> Side:
        rows, lengths = self._audio if is_audio else self._pose
        wanted = queries.astype(np.float64)
        query_lengths = np.sqrt((wanted * wanted).sum(axis=1))
        return Side(is_audio, rows, lengths, wanted, queries, query_lengths)

    def _allowed(self, queries: Sequence[Query]) -> Allowed:
        closed = np.zeros((len(queries), len(self.database)), dtype=np.bool_)
        for i, query in enumerate(queries):
            closed[i, np.asarray(query.closed, dtype=np.int64)] = True
        standing_on = np.array([query.standing_on or (-1, -1) for query in queries], dtype=np.int64)
        only = np.array([query.goes_on or (-1, -1) for query in queries], dtype=np.int64)
        return Allowed(*self._masks([query.mask for query in queries]), closed, standing_on, only)

    def _masks(
        self, masks: Sequence[NDArray[np.bool_] | None]
    ) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """Each mask once, as `nearest_frames` wants it, and which of them every query has."""
        distinct = list({id(mask): mask for mask in masks if mask is not None}.values())
        places = {id(mask): i for i, mask in enumerate(distinct)}
        added = np.zeros((len(distinct), *self._leading.padded_shape), dtype=np.float32)
        for i, mask in enumerate(distinct):
            added[i, :, : self.starts][~self.eligible(mask)] = np.inf
        which = [-1 if mask is None else places[id(mask)] for mask in masks]
        return added, np.array(which, dtype=np.int64)
