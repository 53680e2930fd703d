"""What is made with the generator: samples, motion for speech of any length, and its judging."""

from __future__ import annotations

from abc import abstractmethod

import torch
from torch import Tensor, distributed

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.features.acoustics import ACOUSTICS
from cospeech.corpus.features.positions import at_evaluation_rate
from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
from cospeech.methods.base import GestureMethod
from cospeech.methods.multi_adversary.adversaries import classified
from cospeech.methods.multi_adversary.players import Players
from cospeech.methods.multi_adversary.synthesis import (
    OVERLAP_FRAMES,
    LongForm,
    evaluation_joints,
    gesture_skeleton,
    long_poses,
)
from cospeech.methods.multi_adversary.tally import Tally
from cospeech.methods.streams import WholeUtterance
from cospeech.motion.gesture_joints import GestureJoints
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.nn.modes import evaluating
from cospeech.speech.speech import Speech

BEFORE_ADVERSARIAL = 1e9
"""The selecting value of epochs whose generator isn't the one wanted yet."""


class GeneratesGestures(GestureMethod):
    """A generator at work; how it is trained is its subclass's.

    Attributes:
        players: Hold the generator and the scales.
        layout: The gesturing joints.
        speakers: Of the training.
        long_form: How speech longer than a window is made.
        head: ``(2, 3)`` offsets of nose and head from the neck, metres.
    """

    players: Players
    layout: GestureJoints
    speakers: list[str]
    long_form: LongForm
    head: Tensor

    _tally: Tally | None = None

    @torch.no_grad()
    def sample(self, batch: GestureBatch, generator: torch.Generator) -> Tensor:
        """One window per item at the evaluation rate, ``(B, 75, 10, 3)``.

        There is nothing to draw: ``generator`` isn't used, and the same speech gives the same
        motion.
        """
        return self._upper_body(self.sample_joints(batch))

    def validation_step(self, batch: GestureBatch, batch_idx: int) -> Tensor:
        """Sampled positions for the evaluation callback; counts wrist velocities and phases."""
        generated = self.sample_joints(batch)
        self._count(batch, generated)
        return self._upper_body(generated)

    def on_validation_epoch_start(self) -> None:
        """Count anew, with the generator that a checkpoint would hold."""
        if distributed.is_available() and distributed.is_initialized():
            # Batch norm's running statistics are each process's own.
            for buffer in self.players.generator.buffers():
                distributed.broadcast(buffer, 0)
        wrists = [self.layout.roles.index(f"{side}_wrist") for side in ("left", "right")]
        self._tally = Tally(wrists, self.window.fps, self._judging_classifier())

    def on_validation_epoch_end(self) -> None:
        """Log what was counted."""
        self._log_tally("val")

    def on_test_epoch_start(self) -> None:
        """As for validation."""
        self.on_validation_epoch_start()

    def on_test_epoch_end(self) -> None:
        """As for validation."""
        self._log_tally("test")

    @abstractmethod
    def _judging_classifier(self) -> FrozenPhaseClassifier | None:
        """What tells phases at the moment; None where nothing does."""

    @property
    @abstractmethod
    def in_last_stage(self) -> bool:
        """Whether the generator is one that the training is for, and no stage's before."""

    def _count(self, batch: GestureBatch, generated: Tensor) -> None:
        tally = self._tally
        assert tally is not None
        acoustics, real = batch.require("acoustics"), batch.require("joints")
        for source, joints in (("generated", generated), ("real", real)):
            phases = None
            if tally.classifier is not None:
                phases = classified(tally.classifier, self.layout, joints, acoustics)
                if source == "real" and "phases" in batch.fields:
                    classes = torch.tensor(tally.classifier.merge.class_of, device=self.device)
                    annotated = batch.require("phases")[:, 1:]
                    known = annotated >= 0
                    tally.add_labels(phases[known], classes[annotated[known]])
            tally.add(source, joints, phases)

    def _log_tally(self, stage: str) -> None:
        assert self._tally is not None
        self._tally.gather()
        values = {f"{stage}/{name}": value for name, value in self._tally.values().items()}
        gap = values[f"{stage}/wrist_speed_gap"]
        values[f"{stage}/adversarial_gap"] = gap if self.in_last_stage else BEFORE_ADVERSARIAL
        self.log_dict(values, sync_dist=True)
        self._tally = None

    def border_frames(self) -> int:
        """Frames from the start of one window to the next in `generate_joints`."""
        return self.window.frames - (OVERLAP_FRAMES if self.long_form == "crossfade" else 0)

    @torch.no_grad()
    def sample_joints(self, batch: GestureBatch) -> Tensor:
        """The gesturing joints of each window, ``(B, T, J, 3)`` metres, without dropout."""
        scales = self.players.scales
        with evaluating(self.players.generator):
            poses = self.players.generator(scales.speech(batch.require("acoustics")))
        return scales.joints(poses)

    def _upper_body(self, joints: Tensor) -> Tensor:
        upper_body = evaluation_joints(joints, self.layout, self.head)
        return at_evaluation_rate(upper_body, self.window.fps)

    def begin(
        self,
        speaker: str | None,
        controls: None,
        seed_motion: Motion | None,
        generator: torch.Generator,
    ) -> WholeUtterance:
        """Begin upper-body motion at 20 fps on `UPPER_BODY`; see `LongForm`).

        See docs/facts/multi_adversary.md, section 9, decision 19.

        The whole speech is waited for: the network looks at no later step, but F0 does. What is
        voiced is judged against the loudest sample, and chosen along one path through all of it.

        The motion doesn't depend on the speaker, words aren't read, and there is nothing to draw.
        """
        return WholeUtterance(self._motion_of, reads_words=False)

    def _motion_of(self, speech: Speech) -> Motion:
        upper_body = evaluation_joints(self._joints_of(speech), self.layout, self.head)
        return Motion(UPPER_BODY, self.window.fps, upper_body.cpu().numpy())

    def generate_joints(self, speech: Speech) -> Motion:
        """All gesturing joints, fingers included, for speech of any length.

        Returns:
            As many frames as `generate`, relative to the pelvis and facing +z, on a skeleton of the
            joints' roles (`cospeech.motion.gesture_joints`), spine first.

        Raises:
            CospeechError: A waveform with NaN.
        """
        skeleton, order = gesture_skeleton(self.layout)
        return Motion(skeleton, self.window.fps, self._joints_of(speech)[:, order].cpu().numpy())

    @torch.no_grad()
    def _joints_of(self, speech: Speech) -> Tensor:
        features = torch.from_numpy(ACOUSTICS.of_speech(speech, self.window.fps)).to(self.device)
        scales, frames = self.players.scales, self.window.frames
        if not len(features):
            return scales.pose_mean[None][:0]
        with evaluating(self.players.generator):
            poses = long_poses(
                self.players.generator, scales.speech(features), frames, self.long_form
            )
        return scales.joints(poses)
