"""Refined motion for speech that is heard piece by piece."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.cepstra import CEPSTRA
from cospeech.corpus.features.streaming import FieldStream
from cospeech.matching.streaming import MatchedPieces
from cospeech.methods.motion_matching.refinement.networks import POOLED, Refiner
from cospeech.methods.streams import Stream
from cospeech.motion.motion import Motion
from cospeech.speech.speech import Word

Poses = NDArray[np.float32]


class RefinedStream(Stream):
    """Matched motion, refined as soon as all that the network looks at is there.

    The network is shown `POOLED` frames and those around that they depend on, always as many, so
    that the motion is the same to the bit however the sound is cut. From one pass over the whole
    speech it differs by rounding.

    Args:
        pieces: The search.
        fps: Frames per second.
        network: What `refine` shows them to.
        refine: ``(F, J, 3)`` refined poses of matched ones and of their ``(F, 28)`` sound.
        to_motion: What is put out of refined poses.
    """

    def __init__(
        self,
        pieces: MatchedPieces,
        fps: float,
        network: Refiner,
        refine: Callable[[Poses, NDArray[np.float32]], Poses],
        to_motion: Callable[[Poses], Motion],
    ) -> None:
        self._pieces, self._cepstra = pieces, FieldStream(CEPSTRA, fps)
        self._context = network.context
        last = POOLED - 1 + self._context  # frame that is seen, counted from the first refined one
        places = np.arange(pieces.step_frames) * POOLED
        begins = (places + last) // pieces.step_frames * pieces.step_frames - places
        wait_s = max(
            float(begins.max()) / fps + pieces.look_ahead_s,
            last / fps + self._cepstra.look_ahead_s,
        )
        super().__init__(wait_s, wait_s)
        self._refine, self._to_motion = refine, to_motion
        nothing = np.zeros(0, dtype=np.float32)
        self._poses, self._sound = pieces.hear(nothing), self._cepstra.hear(nothing)
        self._refined = 0  # of the frames that are held

    def _hear(self, samples: NDArray[np.float32], words: Sequence[Word] | None) -> Motion:
        self._hold(self._pieces.hear(samples), self._cepstra.hear(samples))
        made = [self._poses[:0]]
        while min(len(self._poses), len(self._sound)) >= self._refined + POOLED + self._context:
            made.append(self._next(POOLED))
        return self._to_motion(np.concatenate(made))

    def _end(self) -> Motion:
        self._hold(self._pieces.finish(), self._cepstra.finish())
        left = len(self._poses) - self._refined
        return self._to_motion(self._next(left) if left else self._poses)

    def _hold(self, poses: Poses, sound: NDArray[np.float32]) -> None:
        self._poses = np.concatenate([self._poses, poses])
        self._sound = np.concatenate([self._sound, sound])

    def _next(self, frames: int) -> Poses:
        first, stop = self._refined, self._refined + frames
        seen = slice(stop + self._context)
        refined = self._refine(self._poses[seen], self._sound[seen])[first:stop]
        gone = max(0, stop - self._context)
        self._poses, self._sound = self._poses[gone:], self._sound[gone:]
        self._refined = stop - gone
        return refined
