"""Matched motion for speech that is heard piece by piece, step by step as the search goes."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.matching.matching import Walk
from cospeech.matching.seams import SmoothedSeams
from cospeech.matching.synthesis import MotionMatcher
from cospeech.speech.feature_sets.sphinx import FRAME_SAMPLES, STATIC_CHANNELS, sphinx_features
from cospeech.speech.speech import SAMPLE_RATE, covering_frames


class MatchedPieces:
    """The motion of one speech, uncontrolled, as far as what was heard allows.

    A step is searched as soon as the sound of its first frame's feature is complete. Only that
    sound is held, however long the speech becomes.

    Args:
        matcher: The database, and how it is searched.
        closed: Sequences that aren't used; None for none.
        generator: Draws the first pose.
    """

    def __init__(
        self,
        matcher: MotionMatcher,
        closed: Sequence[int] | NDArray[np.int64] | None,
        generator: torch.Generator,
    ) -> None:
        settings, self._database = matcher.settings, matcher.database
        self._search, self._step = matcher.search, settings.step_frames
        self._walk = Walk(
            self._search,
            settings.k,
            () if closed is None else np.asarray(closed, dtype=np.int64),
            settings.initial_pose == "mean",
            settings.natural_continuation,
            generator,
        )
        self._smoothed = SmoothedSeams(self._database, self._step, settings.seam)
        self._channels = _Channels(self._database.spec.fps)
        self._waiting = [self._database.poses[0, :0]]
        self._put_out = 0

    @property
    def look_ahead_s(self) -> float:
        """Sound after the first frame of a step that its search hears, s."""
        spec = self._database.spec
        # A frame of sound begins at a whole sample, up to half a one late.
        frame_s = (FRAME_SAMPLES + 1) / SAMPLE_RATE
        return spec.reach(spec.audio_taps) / spec.fps + frame_s

    def hear(self, samples: NDArray[np.float32]) -> NDArray[np.float32]:
        """The poses ``(F, J, 3)`` that further sound adds.

        They never go beyond the sound, which may be at its end.
        """
        self._channels.hear(samples)
        spec = self._database.spec
        reach = spec.reach(spec.audio_taps)
        while len(rows := self._channels.since(self._next_frame)) > reach:
            self._search_step(self._database.queries_of(rows[: reach + 1])[0])
        return self._due(covering_frames(self._channels.samples, spec.fps))

    def finish(self) -> NDArray[np.float32]:
        """The poses up to the end of the sound."""
        frames = covering_frames(self._channels.samples, self._database.spec.fps)
        self._channels.finish(frames)
        rows = self._channels.since(self._next_frame)
        if len(rows):
            for query in self._database.queries_of(rows)[:: self._step]:
                self._search_step(query)
        return self._due(frames)

    @property
    def _next_frame(self) -> int:
        return len(self._walk.taken) * self._step

    def _search_step(self, audio: NDArray[np.float32]) -> None:
        query = self._walk.query(audio)
        sequence, first = self._walk.take(query, self._search(query))
        window = self._database.poses[sequence, first : first + self._step]
        self._waiting.append(self._smoothed(window, sequence, first))

    def _due(self, frames: int) -> NDArray[np.float32]:
        due, *self._waiting = np.split(np.concatenate(self._waiting), [frames - self._put_out])
        self._put_out += len(due)
        return due


class _Channels:
    """`sphinx_features` of sound that grows at its end."""

    def __init__(self, fps: float) -> None:
        self.samples = 0
        self._fps = fps
        # So many frames on, a frame begins at a whole sample again.
        self._period = (SAMPLE_RATE / Fraction(fps)).denominator
        self._sound = np.zeros(0, dtype=np.float32)
        self._sound_from = 0
        self._rows = np.zeros((0, STATIC_CHANNELS), dtype=np.float32)
        self._rows_from = 0

    def hear(self, samples: NDArray[np.float32]) -> None:
        self.samples += len(samples)
        self._sound = np.concatenate([self._sound, samples])
        done = whole = self._rows_from + len(self._rows)
        while round(whole * SAMPLE_RATE / self._fps) + FRAME_SAMPLES <= self.samples:
            whole += 1
        if whole > done:
            self.finish(whole)
            # Pre-emphasis looks back to the end of the frame before.
            first = (whole - 1) // self._period * self._period
            drop = round((first - self._sound_from) * SAMPLE_RATE / self._fps)
            self._sound, self._sound_from = self._sound[drop:], first

    def finish(self, frames: int) -> None:
        """Take all frames up to a number, whether their sound is complete or not."""
        done = self._rows_from + len(self._rows)
        if frames > done:
            rows = sphinx_features(self._sound, self._fps, frames - self._sound_from)
            self._rows = np.concatenate([self._rows, rows[done - self._sound_from :]])

    def since(self, frame: int) -> NDArray[np.float32]:
        """The rows from a frame on; those before aren't asked for any more."""
        gone = min(frame - self._rows_from, len(self._rows))
        self._rows, self._rows_from = self._rows[gone:], self._rows_from + gone
        return self._rows
