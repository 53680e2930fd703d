"""What one training step of each stage does (Ferstl et al. 2020, sections 4 to 7)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import torch
from torch import Tensor, nn

from cospeech.corpus.batch import GestureBatch
from cospeech.methods.multi_adversary.adversaries import Views
from cospeech.methods.multi_adversary.history import WeightHistory
from cospeech.methods.multi_adversary.losses import continuity_loss, finger_loss, finger_offsets
from cospeech.methods.multi_adversary.players import Players
from cospeech.training.losses import WeighedLosses
from cospeech.training.stages import Progress

Logs = dict[str, Tensor]

LARGEST_CLASSIFIER_NORM = 1.0
"""Of the classifier's gradient; the recurrent layers' gradients are clipped to it."""


@dataclass(frozen=True)
class StepSettings:
    """Numbers that the steps depend on.

    Attributes:
        run: Consecutive windows of a batch.
        frames: Steps per window.
        pretraining_dropout: Of the generator's dense layer and of its GRU.
        adversarial_dropout: The same, in all other stages.
        steps_per_correction: Adversarial steps per objective step.
        continuity_weight: 0 only logs it.
        finger_weight: 0 only logs it.
    """

    run: int
    frames: int
    pretraining_dropout: tuple[float, float]
    adversarial_dropout: tuple[float, float]
    steps_per_correction: int
    continuity_weight: float
    finger_weight: float


class Descend(Protocol):
    """Takes one step of a named optimiser."""

    def __call__(self, name: str, loss: Tensor, largest_norm: float | None = None) -> None:
        """Step down ``loss``."""


class StageSteps:
    """The steps of all stages, on one set of players.

    Args:
        players: The networks.
        views: What adversaries are shown.
        history: Of the generator's pre-training.
        settings: Numbers.
        descend: Takes a step of an optimiser: ``classifier``, ``pretraining``,
            ``pretraining_phase``, ``pretraining_motion``, ``rehearsal``, ``generator``,
            ``correction``, or ``adversary_NAME``.
    """

    def __init__(
        self,
        players: Players,
        views: Views,
        history: WeightHistory,
        settings: StepSettings,
        descend: Descend,
    ) -> None:
        self.players, self.views, self.history = players, views, history
        self.settings, self._descend = settings, descend

    def take(self, progress: Progress, batch: GestureBatch, level: int = 0) -> Logs:
        """One step of the stage that the training is in.

        Args:
            progress: Where it stands.
            batch: Windows, every ``run`` of them consecutive.
            level: Of the curriculum.

        Returns:
            What is to be logged.
        """
        first = progress.stage == "pretraining"
        settings = self.settings
        rates = settings.pretraining_dropout if first else settings.adversarial_dropout
        self.players.set_dropout(*rates)
        steps: dict[str, Callable[[], Logs]] = {
            "classifier": partial(self._classifier, batch),
            "pretraining": partial(self._pretraining, batch, progress.step),
            "phase_curriculum": partial(self._phase_curriculum, batch, level),
            "motion_pretraining": partial(self._motion_pretraining, batch),
            "adversarial": partial(self._adversarial, batch, progress.step),
        }
        return steps[progress.stage]()

    def _classifier(self, batch: GestureBatch) -> Logs:
        assert self.players.student is not None
        run, frames = self.settings.run, self.settings.frames
        shift = int(torch.randint(frames, ())) if run > 1 else 0
        loss, accuracy = self.players.student.loss(batch, shift, run)
        self._descend("classifier", loss, LARGEST_CLASSIFIER_NORM)
        return {"classifier_loss": loss, "classifier_accuracy": accuracy}

    def _pretraining(self, batch: GestureBatch, step: int) -> Logs:
        if step == 0:
            self.history.note(0, self.players.generator)
        speech, poses = self._inputs(batch)
        error = nn.functional.mse_loss(self.players.generator(speech), poses)
        self._descend("pretraining", error)
        self.history.note(step + 1, self.players.generator)
        return {"pretraining_mse": error}

    def _phase_curriculum(self, batch: GestureBatch, level: int) -> Logs:
        speech, poses = self._inputs(batch)
        # In training mode and with later stages' dropout: as the fakes that are to come.
        generator = self.history.generator(level, self.players.generator).train()
        generator.set_dropout(*self.settings.adversarial_dropout)
        with torch.no_grad():
            generated = generator(speech)
            views = [self._view("phase", shown, batch) for shown in (poses, generated)]
        logs = self._train_adversary("phase", "pretraining_phase", *views)
        accuracy = (logs["phase_real_accuracy"] + logs["phase_fake_accuracy"]) / 2
        found = {key.replace("phase", "curriculum"): value for key, value in logs.items()}
        return {
            **found,
            "curriculum_accuracy": accuracy,
            "curriculum_level": torch.tensor(float(level)),
        }

    def _motion_pretraining(self, batch: GestureBatch) -> Logs:
        assert self.players.rehearsal is not None
        speech, poses = self._inputs(batch)
        real = self._view("motion", poses, batch)
        fake = self._view("motion", self.players.rehearsal(speech), batch)
        logs = self._train_adversary("motion", "pretraining_motion", real, fake)
        against = self.players.adversaries["motion"].generator_loss(fake)
        self._descend("rehearsal", against)
        logs["motion_adversarial"] = against
        return {f"rehearsal_{key}": value for key, value in logs.items()}

    def _adversarial(self, batch: GestureBatch, step: int) -> Logs:
        """One step of every adversary, one against them, and at times an objective one.

        Both kinds of steps see the same batch, so that batch norm sees the same kind
        (docs/facts/multi_adversary.md, section 7, trap 6).
        """
        speech, poses = self._inputs(batch)
        adversaries, logs = self.players.adversaries, Logs()
        generated = self.players.generator(speech) if adversaries else poses
        # Equation 3: 2 : 4 : 4 : 1 over 11 with all four.
        sum_of_weights = sum(adversary.weight for adversary in adversaries.values()) or 1
        against = WeighedLosses()
        for name, adversary in adversaries.items():
            weight, shown = adversary.weight / sum_of_weights, (name, poses, generated, batch)
            against.add(f"{name}_adversarial", weight, self._play, *shown, logs)
        logs |= against.values
        if against.total is not None:
            self._descend("generator", against.total)
            logs["adversarial"] = against.total
        if (step + 1) % self.settings.steps_per_correction == 0:
            logs |= self._correct(speech, poses)
        return logs

    def _play(
        self, name: str, poses: Tensor, generated: Tensor, batch: GestureBatch, logs: Logs
    ) -> Tensor:
        """A step of an adversary, whose logs are added; then the generator's loss against it."""
        with torch.no_grad():
            real = self._view(name, poses, batch)
        fake = self._view(name, generated, batch)
        logs |= self._train_adversary(name, f"adversary_{name}", real, fake)
        return self.players.adversaries[name].generator_loss(fake)

    def _correct(self, speech: Tensor, poses: Tensor) -> Logs:
        """The objective step: MSE, continuity and finger distance (section 7.2)."""
        generated = self.players.generator(speech)
        settings, losses = self.settings, WeighedLosses()
        losses.add("mse", 1, nn.functional.mse_loss, generated, poses)
        losses.add(
            "continuity", settings.continuity_weight, continuity_loss, generated, settings.run
        )
        scales = self.players.scales
        if scales.finger_tips:
            losses.add("fingers", settings.finger_weight, self._fingers, generated, poses)
        assert losses.total is not None
        self._descend("correction", losses.total)
        return {**losses.values, "correction": losses.total}

    def _fingers(self, generated: Tensor, poses: Tensor) -> Tensor:
        scales = self.players.scales
        made, real = (
            finger_offsets(scales.joints(shown), scales.finger_tips) for shown in (generated, poses)
        )
        return finger_loss(made, real, scales.finger_deviation)

    @torch.enable_grad()
    def _train_adversary(
        self, name: str, optimizer: str, real_view: Tensor, fake_view: Tensor
    ) -> Logs:
        """A step of an adversary, which learns even where the generator doesn't feel it."""
        adversary = self.players.adversaries[name]
        real, fake = adversary.outputs(real_view, fake_view)
        loss = adversary.losses.discriminator(real, fake)
        self._descend(optimizer, loss)
        return {
            f"{name}_discriminator": loss,
            f"{name}_real_accuracy": (real > 0.5).float().mean(),
            f"{name}_fake_accuracy": (fake < 0.5).float().mean(),
        }

    def _inputs(self, batch: GestureBatch) -> tuple[Tensor, Tensor]:
        scales = self.players.scales
        return scales.speech(batch.require("acoustics")), scales.poses(batch.require("joints"))

    def _view(self, name: str, poses: Tensor, batch: GestureBatch) -> Tensor:
        adversary = self.players.adversaries[name]
        return adversary.view(self.views, poses, batch.require("acoustics"))
