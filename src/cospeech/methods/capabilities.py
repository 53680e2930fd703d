"""What a method may be able to do beside `GestureMethod`, and what judges may hand over.

Rooms above the methods ask for one of these by ``isinstance``; they know no method by name.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from cospeech.corpus.batch import GestureBatch
from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
from cospeech.matching.control import Controls
from cospeech.matching.synthesis import MotionMatcher
from cospeech.metrics.encoder import GestureEncoder
from cospeech.motion.motion import Motion
from cospeech.speech.speech import Speech


@runtime_checkable
class TakesControls(Protocol):
    """A method whose motion can be asked to be like something."""

    def parse_controls(self, values: Any) -> Any:
        """Check what `GestureMethod.open` is given as controls, and return it as it is used.

        Args:
            values: Plain values, as a yaml or JSON file holds them.

        Raises:
            CospeechError: Something isn't understood; the message says what is.
        """


@runtime_checkable
class HasSchedule(Protocol):
    """A method whose training has an end of its own, whatever the number of epochs."""

    @property
    def steps_left(self) -> int:
        """Training steps to that end."""

    @property
    def in_last_stage(self) -> bool:
        """Whether the weights are such as the training is for, and not of a stage before."""


@runtime_checkable
class NeedsStore(Protocol):
    """A method that looks things up in its prepared corpus, as a checkpoint doesn't hold them."""

    @classmethod
    def needs_store(cls, arguments: Mapping[str, Any]) -> bool:
        """Whether it does so with these arguments of its constructor."""


@runtime_checkable
class MakesJoints(Protocol):
    """A method that makes all gesturing joints, fingers included."""

    def border_frames(self) -> int:
        """Frames from the start of one window to the next in `generate_joints`."""

    def sample_joints(self, batch: GestureBatch) -> Tensor:
        """``(B, 100, J, 3)`` gesturing joints of windows of speech, in the order of the roles.

        Relative to the pelvis and facing +z, metres (`cospeech.motion.gesture_joints`).
        """

    def generate_joints(self, speech: Speech) -> Motion:
        """The same joints at 20 fps for speech of any length, named by their roles."""


@runtime_checkable
class MakesStages(Protocol):
    """A method that searches recorded motion and may do more with what it found.

    Attributes:
        matcher: The search and its database.
        same_speaker: Whether the motion of one speaker at a time is used.
    """

    matcher: MotionMatcher
    same_speaker: bool

    def closed_sequences(
        self, speaker: str | None, generator: torch.Generator
    ) -> NDArray[np.int64] | None:
        """The sequences that aren't used for a speaker: the first draw of `stages`."""

    def stages(
        self,
        speech: Speech,
        controls: Controls | None,
        generator: torch.Generator,
        speaker: str | None = None,
    ) -> dict[str, NDArray[np.float32]]:
        """``(F, J, 3)`` of ``database.pose_roles`` after each stage of the method, by name."""


@runtime_checkable
class HoldsPhaseClassifier(Protocol):
    """A method that was trained against a phase classifier, which others may be judged by too."""

    @property
    def classifier(self) -> FrozenPhaseClassifier | None:
        """It; None where the training did without."""


@runtime_checkable
class HandsOverEncoder(Protocol):
    """What is trained to be the encoder of the evaluation."""

    @property
    def is_usual(self) -> bool:
        """Whether its settings are those of the encoders that runs train by themselves."""

    def encoder(self, source: str = ...) -> GestureEncoder:
        """The trained encoder; ``source`` says for people where it was trained."""
