"""The four adversaries: which there are, how large, and what each is shown (spec B.6)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import torch
from torch import Tensor, nn

from cospeech.adversarial.adversary import Adversary
from cospeech.adversarial.losses import NON_SATURATING
from cospeech.errors import ConfigError
from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
from cospeech.judges.phase_classifier.network import PhaseFeatures
from cospeech.methods.multi_adversary.networks import (
    MinibatchDiscriminator,
    SequenceDiscriminator,
)
from cospeech.methods.multi_adversary.scales import ACOUSTICS, Scales
from cospeech.motion.gesture_joints import GestureJoints

AdversaryName = Literal["phase", "motion", "minibatch", "displacement"]
Labels = Literal["soft", "hard"]

DEFAULTS: dict[str, dict[str, float]] = {
    "phase": {"dense": 64, "hidden": 64, "dropout": 0.3},
    "motion": {"dense": 256, "hidden": 256, "dropout": 0.3},
    "minibatch": {"kernels": 100, "kernel_size": 3, "dense": 128, "hidden": 64, "dropout": 0.3},
    "displacement": {"dense": 128, "hidden": 128, "dropout": 0.3},
}
"""Sizes that a setting may change; the paper draws the networks without numbers."""


def checked_settings(
    settings: Mapping[str, Mapping[str, float] | None],
) -> dict[str, dict[str, float]]:
    """The adversaries that play, each with its weight and every size.

    Args:
        settings: Name -> ``weight`` and sizes; None or an absent name leaves one out.

    Raises:
        ConfigError: An unknown name or size, no weight, or a number out of its range.
    """
    checked = {}
    for name, given in settings.items():
        if name not in DEFAULTS:
            names = ", ".join(DEFAULTS)
            raise ConfigError(f"model.adversaries.{name}: no such adversary; there are {names}")
        if given is None:
            continue
        values = {**DEFAULTS[name], **given}
        known = ["weight", *DEFAULTS[name]]
        for key, value in values.items():
            place = f"model.adversaries.{name}.{key}"
            if key not in known:
                raise ConfigError(f"{place}: no such setting; there are {', '.join(known)}")
            if isinstance(value, bool) or not isinstance(value, (int, float)):
                raise ConfigError(f"{place}={value!r}: not a number")
            if key == "dropout" and not 0 <= value < 1:
                raise ConfigError(f"{place}={value}: from 0 to below 1")
            if key == "weight" and value < 0:
                raise ConfigError(f"{place}={value}: must not be negative")
            if key not in ("dropout", "weight") and (value < 1 or value != int(value)):
                raise ConfigError(f"{place}={value}: a whole number from 1")
        if "weight" not in values:
            raise ConfigError(
                f"model.adversaries.{name} has no weight",
                f"say model.adversaries.{name}.weight=1, or model.adversaries.{name}=null to play"
                " without it",
            )
        checked[name] = values
    return {name: checked[name] for name in DEFAULTS if name in checked}


def build_adversary(
    name: str, settings: Mapping[str, float], joints: GestureJoints, classes: int, frames: int
) -> Adversary:
    """One adversary, untrained.

    Args:
        name: Which.
        settings: From `checked_settings`.
        joints: The gesturing joints.
        classes: Classes of the phase classifier.
        frames: Steps per window.
    """
    poses = 3 * len(joints.roles)
    inputs = {
        "phase": classes + 1,
        "motion": poses + ACOUSTICS,
        "minibatch": poses,
        "displacement": 3 * len(joints.arms),
    }[name]
    sizes = {key: int(value) for key, value in settings.items() if key not in ("weight", "dropout")}
    network: nn.Module
    if name == "minibatch":
        network = MinibatchDiscriminator(frames, inputs, dropout=settings["dropout"], **sizes)
    else:
        network = SequenceDiscriminator(inputs, dropout=settings["dropout"], **sizes)
    return Adversary(network, NON_SATURATING, weight=settings["weight"], start_epoch=0)


class Views:
    """What each adversary is shown of a window; the same way for real and for generated motion.

    Differentiable in the poses. Velocities are differences of metres inside a window (spec B.7,
    traps 3 and 4).

    Args:
        scales: Between metres and z-scores.
        displacements: Z-scores of the arms' velocities.
        joints: The gesturing joints.
        labels: How phases are shown: ``"soft"`` probabilities, or ``"hard"`` one-hot labels.
    """

    def __init__(
        self, scales: Scales, displacements: PhaseFeatures, joints: GestureJoints, labels: Labels
    ) -> None:
        self.scales, self.displacements = scales, displacements
        self.layout, self.labels = joints, labels
        self.classifier: FrozenPhaseClassifier | None = None

    def of(self, name: str, poses: Tensor, acoustics: Tensor) -> Tensor:
        """The view of one adversary.

        Args:
            name: Which.
            poses: ``(B, T, 3 J)`` z-scores.
            acoustics: ``(B, T, 27)``, not normalised.

        Returns:
            ``(B, T, C)``, or ``(B, T - 1, C)`` of phases and displacements.
        """
        if name == "minibatch":
            return poses
        if name == "motion":
            return torch.cat([poses, self.scales.speech(acoustics)], dim=-1)
        joints = self.scales.joints(poses)
        if name == "displacement":
            return self.displacements(joints[..., list(self.layout.arms), :])
        pitch = self.scales.speech(acoustics)[:, 1:, -1:]
        return torch.cat([self._shown_phases(joints, acoustics), pitch], dim=-1)

    def _shown_phases(self, joints: Tensor, acoustics: Tensor) -> Tensor:
        assert self.classifier is not None
        soft = classified(self.classifier, self.layout, joints, acoustics)
        if self.labels == "soft":
            return soft
        hard = nn.functional.one_hot(soft.argmax(dim=-1), soft.shape[-1]).to(soft)
        # The choice has no gradient: the generator feels the probabilities' instead.
        return hard + soft - soft.detach()


def classified(
    classifier: FrozenPhaseClassifier, layout: GestureJoints, joints: Tensor, acoustics: Tensor
) -> Tensor:
    """Class probabilities of motion, differentiable in the joints.

    Args:
        classifier: Moved to where the joints are.
        layout: The gesturing joints.
        joints: ``(B, T, J, 3)`` metres.
        acoustics: ``(B, T, 27)``, not normalised.

    Returns:
        ``(B, T - 1, K)``.
    """
    chosen = classifier.to(joints.device).choose(joints, layout)
    return classifier.class_probabilities(chosen, acoustics[..., -1])
