"""Motion matching as a method: nothing is trained, a database is fitted."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.corpus.facts import CorpusFacts
from cospeech.matching.control import Controls
from cospeech.matching.features import MatchingSpec
from cospeech.matching.reference import STEP_FRAMES, Preselect
from cospeech.matching.seams import Seam
from cospeech.matching.streaming import MatchedPieces
from cospeech.matching.synthesis import InitialPose, MatchingSettings
from cospeech.methods.fitted import FittedWithoutSteps
from cospeech.methods.motion_matching.matched import K_NN, MatchedMethod
from cospeech.methods.streams import Stream
from cospeech.motion.motion import Motion
from cospeech.speech.speech import Speech, Word


class MotionMatching(MatchedMethod, FittedWithoutSteps):
    """k-NN search over recorded motion, by pose and by sound (Habibie et al. 2022, section 3.1).

    Training is fitting the database.

    Args:
        corpus: Where the store is, and its speakers.
        preselect: By what each sequence's candidate is found: ``"pose"``, ``"audio"`` or
            ``"pose_only"``, which hears nothing.
        step_frames: Frames that each search adds.
        k: Which candidate is taken, from 1.
        start_offset: 1 leaves out the frame that is like the one before.
        natural_continuation: Offer what goes on from the window before.
        initial_pose: ``"random"``: near a random frame; ``"mean"``: near the mean pose.
        seam: ``"cut"``, ``"crossfade"`` or ``"inertialise"`` (`cospeech.matching.seams`).
        true_future: See `MatchingSpec`.
        chunk_frames: Length of the database's sequences.
        same_speaker: Use the motion of one speaker at a time.
        database: Folder of a database, in place of the corpus's own.

    Raises:
        ConfigError: A value that is out of its range or not among the choices.
    """

    def __init__(
        self,
        corpus: CorpusFacts,
        preselect: Preselect = "pose",
        step_frames: int = STEP_FRAMES,
        k: int = 1,
        start_offset: int = 0,
        natural_continuation: bool = False,
        initial_pose: InitialPose = "random",
        seam: Seam = "cut",
        true_future: bool = False,
        chunk_frames: int = 64,
        same_speaker: bool = True,
        database: str | None = None,
    ) -> None:
        super().__init__(
            corpus,
            MatchingSpec(chunk_frames=chunk_frames, true_future=true_future),
            MatchingSettings(
                preselect,
                step_frames,
                k,
                start_offset,
                natural_continuation,
                initial_pose,
                seam,
            ),
            same_speaker,
            database,
        )
        self.save_hyperparameters(logger=False)

    def stages(
        self,
        speech: Speech,
        controls: Controls | None,
        generator: torch.Generator,
        speaker: str | None = None,
    ) -> dict[str, NDArray]:
        """The search's output, under its name."""
        closed = self.closed_sequences(speaker, generator)
        return {K_NN: self.matcher(speech, controls, generator, closed).poses}

    def stream(self, pieces: MatchedPieces) -> Stream:
        """The search's output, a step at a time."""
        return _SteppedStream(pieces, self.upper_body_motion)


class _SteppedStream(Stream):
    """The search of an uncontrolled speech, as far as its sound is known."""

    def __init__(
        self, pieces: MatchedPieces, to_motion: Callable[[NDArray[np.float32]], Motion]
    ) -> None:
        super().__init__(pieces.look_ahead_s, max(0.0, pieces.look_ahead_s))
        self._pieces, self._to_motion = pieces, to_motion

    def _hear(self, samples: NDArray[np.float32], words: Sequence[Word] | None) -> Motion:
        return self._to_motion(self._pieces.hear(samples))

    def _end(self) -> Motion:
        return self._to_motion(self._pieces.finish())
