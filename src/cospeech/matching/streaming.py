"""Matched motion for speech that is heard piece by piece, step by step as the search goes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.corpus.features.cepstra import STATIC_CEPSTRA
from cospeech.corpus.features.streaming import FieldStream
from cospeech.matching.matching import Walk
from cospeech.matching.seams import SmoothedSeams
from cospeech.matching.synthesis import MotionMatcher
from cospeech.speech.speech import covering_frames


class MatchedPieces:
    """The motion of one speech, uncontrolled, as far as what was heard allows.

    A step is searched as soon as the sound of its first frame's feature is complete. Only that
    sound is held, however long the speech becomes. A search by pose only hears nothing, and waits
    for nothing.

    Args:
        matcher: The database, and how it is searched.
        closed: Sequences that aren't used; None for none.
        generator: Draws the first pose.

    Attributes:
        step_frames: Frames that each search adds.
    """

    def __init__(
        self,
        matcher: MotionMatcher,
        closed: Sequence[int] | NDArray[np.int64] | None,
        generator: torch.Generator,
    ) -> None:
        settings, self._database = matcher.settings, matcher.database
        self._search, self.step_frames = matcher.search, settings.step_frames
        self._walk = Walk(
            self._search,
            settings.k,
            () if closed is None else np.asarray(closed, dtype=np.int64),
            settings.initial_pose == "mean",
            settings.natural_continuation,
            generator,
        )
        self._smoothed = SmoothedSeams(self._database, self.step_frames, settings.seam)
        self._hears_nothing = self._search.preselect == "pose_only"
        self._channels = FieldStream(STATIC_CEPSTRA, self._database.spec.fps)
        self._rows, self._rows_from = self._channels.hear(np.zeros(0, dtype=np.float32)), 0
        self._waiting = [self._database.poses[0, :0]]
        self._put_out = 0

    @property
    def look_ahead_s(self) -> float:
        """Sound after the first frame of a step that its search hears, s; -inf for none at all."""
        spec = self._database.spec
        if self._hears_nothing:
            return -math.inf
        return spec.reach(spec.audio_taps) / spec.fps + self._channels.look_ahead_s

    def hear(self, samples: NDArray[np.float32]) -> NDArray[np.float32]:
        """The poses ``(F, J, 3)`` that further sound adds.

        They never go beyond the sound, which may be at its end.
        """
        self._take(self._channels.hear(samples))
        spec = self._database.spec
        heard = covering_frames(self._channels.samples, spec.fps)
        reach = spec.reach(spec.audio_taps)
        while self._hears_nothing and self._next_frame < heard:
            self._search_step(np.zeros(self._database.audio_features.shape[2], np.float32))
        while len(self._rows) > reach:
            self._search_step(self._database.queries_of(self._rows[: reach + 1])[0])
        return self._due(heard)

    def finish(self) -> NDArray[np.float32]:
        """The poses up to the end of the sound."""
        self._take(self._channels.finish())
        queries = self._database.queries_of(self._rows)
        for query in queries[:: self.step_frames]:
            self._search_step(query)
        return self._due(covering_frames(self._channels.samples, self._database.spec.fps))

    def _take(self, rows: NDArray[np.float32]) -> None:
        """Hold further rows of sound, from the next step's first frame on."""
        self._rows = np.concatenate([self._rows, rows])
        gone = min(self._next_frame - self._rows_from, len(self._rows))
        self._rows, self._rows_from = self._rows[gone:], self._rows_from + gone

    @property
    def _next_frame(self) -> int:
        return len(self._walk.taken) * self.step_frames

    def _search_step(self, audio: NDArray[np.float32]) -> None:
        query = self._walk.query(audio)
        sequence, first = self._walk.take(query, self._search(query))
        window = self._database.poses[sequence, first : first + self.step_frames]
        self._waiting.append(self._smoothed(window, sequence, first))
        self._take(self._rows[:0])

    def _due(self, frames: int) -> NDArray[np.float32]:
        due, *self._waiting = np.split(np.concatenate(self._waiting), [frames - self._put_out])
        self._put_out += len(due)
        return due
