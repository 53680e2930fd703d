"""What every method owes to evaluation. Training belongs to the method."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import torch
from lightning import LightningModule
from torch import Tensor

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.windows import WindowSpec
from cospeech.errors import ConfigError
from cospeech.methods.capabilities import TakesControls
from cospeech.methods.streams import Stream, check_seed_motion, check_speaker
from cospeech.motion.motion import Motion
from cospeech.speech.speech import Speech


class GestureMethod(LightningModule, ABC):
    """Base of the methods: windows in, motion out.

    A subclass sets its attributes, implements `sample` and `begin`, and trains itself by manual
    optimisation. Schedules are pure values of ``current_epoch``; every random number in training
    comes from torch's global generator, which the run seeds anew for each step, so that a resumed
    run continues exactly.

    Attributes:
        window: Frame rate, length, seed frames and stride of the windows it works on.
        needs: Names of the fields it reads (`cospeech.corpus.features`).
        derived_from: Names of the evaluation's values that `derived_values` reads.
        speakers: Names of those in the training.
    """

    window: WindowSpec
    needs: ClassVar[frozenset[str]]
    derived_from: ClassVar[frozenset[str]] = frozenset()
    speakers: list[str]

    def __init__(self) -> None:
        super().__init__()
        self.automatic_optimization = False

    @abstractmethod
    def sample(self, batch: GestureBatch, generator: torch.Generator) -> Tensor:
        """One window per item, given its real seed poses, as the paper evaluates.

        Args:
            batch: Windows with the fields of `needs`.
            generator: Source of every random draw; same seed, same motion.

        Returns:
            ``(B, E, 10, 3)`` root-relative positions of the upper-body joints, metres, at the E
            evaluation frames of the field ``positions``: 15 fps over the time of the window,
            whatever the method's own rate (`at_evaluation_rate` of
            `cospeech.corpus.features.positions`).
        """

    def open(
        self,
        speaker: str | None = None,
        controls: Any = None,
        seed_motion: Motion | None = None,
        generator: torch.Generator | None = None,
    ) -> Stream:
        """Begin the motion for a speech of any length.

        Args:
            speaker: A training speaker's name; None lets the method choose.
            controls: What `TakesControls.parse_controls` reads; None for none.
            seed_motion: Upper-body motion to continue from, facing +z, at the method's frame rate;
                its last ``window.seed_frames`` frames are read.
            generator: Source of every random draw; None seeds one with 0.

        Raises:
            CospeechError: An unknown speaker, controls that the method doesn't take or can't read,
                or a motion that it can't continue.
        """
        check_speaker(speaker, self.speakers)
        if isinstance(self, TakesControls):
            controls = None if controls is None else self.parse_controls(controls)
        elif controls:
            wanted = f"a {type(self).__name__} takes no controls: {controls!r:.80}"
            raise ConfigError(wanted, "leave controls out")
        check_seed_motion(seed_motion, self.window)
        generator = generator or torch.Generator().manual_seed(0)
        return self.begin(speaker, controls, seed_motion, generator)

    @abstractmethod
    def begin(
        self,
        speaker: str | None,
        controls: Any,
        seed_motion: Motion | None,
        generator: torch.Generator,
    ) -> Stream:
        """What `open` gives: its arguments are checked, the controls are parsed.

        Its motion is on one skeleton that `to_upper_body` has a way from: `UPPER_BODY` where the
        method makes no more.
        """

    def generate(
        self,
        speech: Speech,
        speaker: str | None = None,
        seed_motion: Motion | None = None,
        controls: Any = None,
        generator: torch.Generator | None = None,
    ) -> Motion:
        """Motion for speech of any length: all of it is pushed into a stream, which is finished.

        Args:
            speech: Waveform and, if the method reads them, words.
            speaker: As for `open`, like the other three.
            seed_motion: See `open`.
            controls: See `open`.
            generator: See `open`.

        Returns:
            Motion that covers the audio exactly, ``ceil(duration * fps)`` frames, on the fullest
            skeleton that the method knows, with rotations where it makes them. `to_upper_body` of
            `cospeech.motion.upper_body` derives the ten evaluation joints.

        Raises:
            CospeechError: As `open` and `Stream.push`.
        """
        stream = self.open(speaker, controls, seed_motion, generator)
        begun = stream.push(speech.waveform, speech.words)
        rest = stream.finish()
        return rest if begun is None else begun.followed_by(rest)

    def validation_step(self, batch: GestureBatch, batch_idx: int) -> Tensor:
        """Sampled positions of the batch, for the evaluation callback.

        The draws depend on the batch's index alone, so epochs are compared under the same noise.
        """
        generator = torch.Generator(device=self.device).manual_seed(batch_idx)
        return self.sample(batch, generator)

    def read_files(self) -> None:
        """Read the files that the settings name, before a new training and anything slow.

        A resumed training has what it needs of them in its checkpoint. Raises `CospeechError`
        where one can't be read or doesn't fit.
        """

    def derived_values(self, values: dict[str, Tensor]) -> dict[str, Tensor]:
        """Values of an evaluation to be logged beside those given, by name without the stage."""
        return {}

    def test_step(self, batch: GestureBatch, batch_idx: int) -> Tensor:
        """As `validation_step`."""
        return self.validation_step(batch, batch_idx)
