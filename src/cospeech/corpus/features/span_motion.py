"""Motion at the next multiple of a method's rate: what the fields of motion are made from."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.field import nearest
from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.errors import CospeechError
from cospeech.motion.motion import Motion, resample_positions, resample_rotations
from cospeech.motion.upper_body import EVALUATION_FPS
from cospeech.motion.velocities import BodyJoints, body_positions


class SteppedMotion:
    """A motion as interleaved sequences: 60 fps give three of 20 fps, 100 fps five.

    Every frame is used and none interpolated where the rate is a multiple of the method's; a motion
    at another one is put on the next multiple (Ferstl et al. 2020, section 3).

    Args:
        motion: At any rate.
        fps: The sequences' frames per second.
    """

    def __init__(self, motion: Motion, fps: float) -> None:
        self.motion, self.fps = motion, fps
        self.multiple = math.ceil(motion.fps / fps - 1e-6)
        """How many sequences there are."""
        self.rate = self.multiple * fps
        """Frames per second of all together."""

    @cached_property
    def frames(self) -> int:
        """Frames of all sequences together."""
        return len(self._at_rate(self.motion.positions[:, :1]))

    def joints(self, body: BodyJoints) -> NDArray[np.float32]:
        """Positions in the body frame, metres: ``(frames, J, 3)``; sequence i is every n-th from i.

        Raises:
            CospeechError: The motion is 2-D, or its skeleton lacks a joint.
        """
        return self._at_rate(body_positions(self.motion, body))

    def root(self) -> NDArray[np.float32]:
        """World positions of the root, metres: ``(frames, 3)``."""
        return self._at_rate(self.motion.positions[:, 0])

    def rotations(self) -> NDArray[np.float32]:
        """Rotation of each joint relative to its parent: ``(frames, J, 4)`` unit quaternions.

        Raises:
            CospeechError: The motion holds positions alone.
        """
        rotations = self.motion.rotations_local
        if rotations is None:
            raise CospeechError("the motion holds positions alone, and rotations are needed")
        if self._is_at_rate:
            return rotations
        return resample_rotations(rotations, self.motion.fps, self.rate)

    @property
    def _is_at_rate(self) -> bool:
        return math.isclose(self.rate, self.motion.fps, rel_tol=1e-6)

    def _at_rate(self, positions: NDArray[np.float32]) -> NDArray[np.float32]:
        if self._is_at_rate:
            return positions
        return resample_positions(positions, self.motion.fps, self.rate)


class SpanMotion(SteppedMotion):
    """The motion of one span of a store, with what else is known of its frames.

    Args:
        store: The corpus.
        span: The stretch.
        fps: The sequences' frames per second.
    """

    def __init__(self, store: Store, span: Span, fps: float) -> None:
        motion = store.motion(span.recording)
        self.first, stop = native_frames(store, span)
        super().__init__(motion.slice(self.first, stop), fps)
        self.store, self.span = store, span

    @property
    def times_s(self) -> NDArray[np.float64]:
        """``(frames,)`` times in the recording, s."""
        return self.first / self.motion.fps + np.arange(self.frames) / self.rate

    def upper_body(self) -> NDArray[np.float32]:
        """``(n, 10, 3)`` the evaluation joints at the span's evaluation frames."""
        span = self.span
        return np.array(self.store.upper_body(span.recording, span.start, span.stop))

    def between(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """``(frames, ...)`` of ``(n, ...)`` values at the evaluation frames, linearly."""
        places = (self.times_s * EVALUATION_FPS - self.span.start).clip(0, len(values) - 1)
        low = places.astype(int)
        high = np.minimum(low + 1, len(values) - 1)
        share = (places - low).astype(np.float32).reshape(-1, *([1] * (values.ndim - 1)))
        between: NDArray[np.float32] = values[low] + share * (values[high] - values[low])
        return between

    def phases(self) -> NDArray[np.int8] | None:
        """``(frames,)`` label of the recorded frame that is nearest; None without annotation."""
        labels = self.store.phases(self.span.recording)
        if labels is None:
            return None
        return labels[nearest(self.times_s, self.motion.fps, len(labels))]


def native_frames(store: Store, span: Span) -> tuple[int, int]:
    """The first of a recording's own frames in a span, and the one after the last.

    A span that reaches to the recording's end has all frames that are left.
    """
    motion = store.motion(span.recording)
    first, stop = (
        math.ceil(edge / EVALUATION_FPS * motion.fps - 1e-6) for edge in (span.start, span.stop)
    )
    if span.stop >= store.recordings[span.recording].frames:
        return first, len(motion)
    return first, min(stop, len(motion))
