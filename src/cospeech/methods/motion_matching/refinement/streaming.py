"""Refined motion for speech that is heard piece by piece."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.cepstra import CEPSTRA
from cospeech.corpus.features.streaming import FieldStream
from cospeech.matching.streaming import MatchedPieces
from cospeech.methods.motion_matching.refinement.networks import POOLED
from cospeech.methods.streams import Stream
from cospeech.motion.motion import Motion
from cospeech.speech.speech import Word

Poses = NDArray[np.float32]


class RefinedStream(Stream):
    """Matched motion, refined as soon as all that the network looks at is there.

    The network is shown `POOLED` frames after another, so that the motion is the same to the bit
    however the sound is cut. From one pass over the whole speech it differs by rounding.

    Args:
        pieces: The search.
        fps: Frames per second.
        behind: See `Refiner`.
        refine: ``(F, J, 3)`` refined poses that further matched ones ``(T, J, 3)`` and their sound
            ``(T, 28)`` complete, and whether they are the last; as `PiecewiseRefiner` takes them.
        to_motion: What is put out of refined poses.
    """

    def __init__(
        self,
        pieces: MatchedPieces,
        fps: float,
        behind: int,
        refine: Callable[[Poses, NDArray[np.float32], bool], Poses],
        to_motion: Callable[[Poses], Motion],
    ) -> None:
        self._pieces, self._cepstra = pieces, FieldStream(CEPSTRA, fps)
        # Frames that are seen last, the steps that they are in, and what is first refined then.
        last = np.arange(1, pieces.step_frames + 1) * POOLED - 1
        begins = last // pieces.step_frames * pieces.step_frames
        first = last + 1 - POOLED - behind
        wait_s = max(
            float((begins - first).max()) / fps + pieces.look_ahead_s,
            float((last - first).max()) / fps + self._cepstra.look_ahead_s,
        )
        super().__init__(wait_s, wait_s)
        self._refine, self._to_motion = refine, to_motion
        nothing = np.zeros(0, dtype=np.float32)
        self._poses, self._sound = pieces.hear(nothing), self._cepstra.hear(nothing)

    def _hear(self, samples: NDArray[np.float32], words: Sequence[Word] | None) -> Motion | None:
        self._hold(self._pieces.hear(samples), self._cepstra.hear(samples))
        frames = min(len(self._poses), len(self._sound)) // POOLED * POOLED
        return self._shown(frames, is_end=False) if frames else None

    def _end(self) -> Motion:
        self._hold(self._pieces.finish(), self._cepstra.finish())
        return self._shown(len(self._poses), is_end=True)

    def _hold(self, poses: Poses, sound: NDArray[np.float32]) -> None:
        self._poses = np.concatenate([self._poses, poses])
        self._sound = np.concatenate([self._sound, sound])

    def _shown(self, frames: int, is_end: bool) -> Motion:
        poses, self._poses = np.split(self._poses, [frames])
        sound, self._sound = np.split(self._sound, [frames])
        return self._to_motion(self._refine(poses, sound, is_end))
