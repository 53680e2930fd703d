"""A recording as interleaved sequences of 20 fps, and what was found for them back in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.acoustics import ACOUSTICS
from cospeech.corpus.features.span_motion import SteppedMotion
from cospeech.errors import CospeechError
from cospeech.judges.phase_classifier.network import STEP_FPS
from cospeech.motion.motion import Motion
from cospeech.motion.velocities import BodyJoints
from cospeech.speech.feature_sets.opensmile import COEFFICIENTS
from cospeech.speech.speech import Speech


@dataclass(frozen=True, eq=False)
class StepSequences:
    """The interleaved sequences of one recording.

    Attributes:
        joints: ``(T_i, J, 3)`` float32 of each interleave, body frame, metres.
        pitch: ``(T_i,)`` F0 of each, Hz, 0 where unvoiced; None each without speech.
        rate: Frames per second of all interleaves together.
    """

    joints: list[NDArray[np.float32]]
    pitch: list[NDArray[np.float32] | None]
    rate: float

    def placed(
        self, found: Sequence[NDArray[np.float32]], frames: int, fps: float
    ) -> NDArray[np.float32]:
        """Values of each sequence's steps, given to the frames nearest in time.

        A sequence's first frame has no velocity, and the value of its first step.

        Args:
            found: ``(T_i - 1, K)`` per sequence.
            frames: Frames of the motion.
            fps: Their rate.

        Returns:
            ``(frames, K)``.
        """
        count = len(self.joints)
        total = sum(map(len, self.joints))
        together = np.empty((total, found[0].shape[1]), dtype=found[0].dtype)
        for interleave, values in enumerate(found):
            together[interleave::count] = np.concatenate([values[:1], values])
        nearest = np.rint(np.arange(frames) / fps * self.rate).astype(np.int64)
        return together[nearest.clip(max=total - 1)]


def step_sequences(motion: Motion, joints: BodyJoints, speech: Speech | None) -> StepSequences:
    """Every interleaved sequence of a motion, as `cospeech.corpus.tracks` makes them.

    Args:
        motion: At any rate; one that is no multiple of 20 fps is put on the next multiple.
        joints: The joints wanted.
        speech: Of the same time, for the pitch; None for none.

    Raises:
        CospeechError: The skeleton lacks a joint, or a sequence would have no step.
    """
    stepped = SteppedMotion(motion, STEP_FPS)
    positions, count = stepped.joints(joints), stepped.multiple
    if len(positions) < 2 * count:
        raise CospeechError(
            f"the motion is {motion.duration:.2f} s long; phases need at least {2 / STEP_FPS:g} s"
        )
    hertz = None
    if speech is not None:
        hertz = ACOUSTICS.of_speech(speech, stepped.rate, len(positions))[:, COEFFICIENTS]
    chosen = [slice(interleave, None, count) for interleave in range(count)]
    return StepSequences(
        [positions[rows] for rows in chosen],
        [None if hertz is None else hertz[rows] for rows in chosen],
        stepped.rate,
    )


def centred(frames: int, window: int) -> tuple[NDArray[np.int64], tuple[NDArray[np.int64], ...]]:
    """Overlapping windows of a sequence, and for each step the window that has it in its middle.

    Windows begin every quarter of a window, and one more ends with the sequence. A sequence shorter
    than a window is one shorter window.

    Args:
        frames: Length of the sequence.
        window: Frames per window.

    Returns:
        ``(N, window)`` frame indices, and the (window, step) index arrays, each ``(frames - 1,)``,
        of the step that leads to each frame but the first.
    """
    window = min(window, frames)
    last = frames - window
    starts = np.array(sorted({*range(0, last, max(1, window // 4)), last}))
    # Ties go to the earlier window.
    distance = np.abs(np.arange(frames - 1) - starts[:, None] - (window - 2) / 2)
    steps = np.arange(frames - 1)
    inside = (steps >= starts[:, None]) & (steps < starts[:, None] + window - 1)
    best = np.where(inside, distance, np.inf).argmin(axis=0)
    return starts[:, None] + np.arange(window), (best, steps - starts[best])
