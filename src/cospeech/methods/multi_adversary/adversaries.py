"""The four adversaries: how large they are, and what each is shown.

See docs/facts/multi_adversary.md, section 6.

Their sizes are defaults of ours; the paper draws the networks without numbers.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal

import torch
from torch import Tensor, nn

from cospeech.adversarial.settings import AdversarySettings, SettableAdversary
from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
from cospeech.judges.phase_classifier.network import PhaseFeatures
from cospeech.methods.multi_adversary.networks import MinibatchDiscriminator, SequenceDiscriminator
from cospeech.methods.multi_adversary.scales import ACOUSTICS, Scales
from cospeech.motion.gesture_joints import GestureJoints

Labels = Literal["soft", "hard"]


class Views:
    """What adversaries can be shown of a window; the same way for real and for generated motion.

    Differentiable in the poses, ``(B, T, 3 J)`` z-scores. Acoustics are ``(B, T, 27)``, not
    normalised. Velocities are differences of metres inside a window (docs/facts/multi_adversary.md,
    section 7, traps 3 and 4).

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

    def speech(self, acoustics: Tensor) -> Tensor:
        """Z-scores ``(B, T, 27)``, the pitch last."""
        return self.scales.speech(acoustics)

    def joints(self, poses: Tensor) -> Tensor:
        """Positions ``(B, T, J, 3)``, metres."""
        return self.scales.joints(poses)

    def velocities(self, poses: Tensor) -> Tensor:
        """Z-scores ``(B, T - 1, 3 A)`` of the arms' velocities."""
        return self.displacements(self.joints(poses)[..., list(self.layout.arms), :])

    def phases(self, poses: Tensor, acoustics: Tensor) -> Tensor:
        """Classes ``(B, T - 1, K)`` by the frozen classifier, as probabilities or one-hot."""
        assert self.classifier is not None
        soft = classified(self.classifier, self.layout, self.joints(poses), acoustics)
        if self.labels == "soft":
            return soft
        hard = nn.functional.one_hot(soft.argmax(dim=-1), soft.shape[-1]).to(soft)
        # The choice has no gradient: the generator feels the probabilities' instead.
        return hard + soft - soft.detach()


@dataclass(frozen=True)
class WindowSizes:
    """Sizes of what `Views` shows.

    Attributes:
        frames: Steps of a window.
        joints: Gesturing joints.
        arms: Those of the arms.
        classes: Phases that the classifier tells.
    """

    frames: int
    joints: int
    arms: int
    classes: int


class WindowAdversary(SettableAdversary):
    """Base of this method's adversaries: what one is shown of a window.

    Its ``network`` gets `WindowSizes` and gives probabilities ``(B,)`` of what `view` shows.
    """

    sees_phases: ClassVar[bool] = False

    @abstractmethod
    def view(self, views: Views, poses: Tensor, acoustics: Tensor) -> Tensor:
        """What it is shown of windows, real or generated.

        Args:
            views: What can be shown.
            poses: ``(B, T, 3 J)`` z-scores; the view is differentiable in them.
            acoustics: ``(B, T, 27)``, not normalised.
        """


class PhaseAdversary(WindowAdversary):
    """Sees the order of gesture phases, beside the pitch."""

    sees_phases = True

    @staticmethod
    def network(
        sizes: WindowSizes, dense: int = 64, hidden: int = 64, dropout: float = 0.3
    ) -> nn.Module:
        """Reads ``(B, T - 1, K + 1)``."""
        return SequenceDiscriminator(sizes.classes + 1, dense, hidden, dropout)

    def view(self, views: Views, poses: Tensor, acoustics: Tensor) -> Tensor:
        """Phases, and the z-scored pitch."""
        pitch = views.speech(acoustics)[:, 1:, -1:]
        return torch.cat([views.phases(poses, acoustics), pitch], dim=-1)


class MotionAdversary(WindowAdversary):
    """Sees whether poses look real and belong to the speech."""

    @staticmethod
    def network(
        sizes: WindowSizes, dense: int = 256, hidden: int = 256, dropout: float = 0.3
    ) -> nn.Module:
        """Reads ``(B, T, 3 J + 27)``."""
        return SequenceDiscriminator(3 * sizes.joints + ACOUSTICS, dense, hidden, dropout)

    def view(self, views: Views, poses: Tensor, acoustics: Tensor) -> Tensor:
        """Poses and speech, both z-scored."""
        return torch.cat([poses, views.speech(acoustics)], dim=-1)


class MinibatchAdversary(WindowAdversary):
    """Sees whether the windows of a batch differ as real ones do."""

    @staticmethod
    def network(
        sizes: WindowSizes,
        kernels: int = 100,
        kernel_size: int = 3,
        dense: int = 128,
        hidden: int = 64,
        dropout: float = 0.3,
    ) -> nn.Module:
        """Reads ``(B, T, 3 J)``."""
        poses = 3 * sizes.joints
        return MinibatchDiscriminator(
            sizes.frames, poses, kernels, kernel_size, dense, hidden, dropout
        )

    def view(self, views: Views, poses: Tensor, acoustics: Tensor) -> Tensor:
        """The poses themselves."""
        return poses


class DisplacementAdversary(WindowAdversary):
    """Sees how the arms move from step to step."""

    @staticmethod
    def network(
        sizes: WindowSizes, dense: int = 128, hidden: int = 128, dropout: float = 0.3
    ) -> nn.Module:
        """Reads ``(B, T - 1, 3 A)``."""
        return SequenceDiscriminator(3 * sizes.arms, dense, hidden, dropout)

    def view(self, views: Views, poses: Tensor, acoustics: Tensor) -> Tensor:
        """The arms' velocities."""
        return views.velocities(poses)


Settings = dict[str, AdversarySettings[WindowAdversary]]

ADVERSARIES: dict[str, type[WindowAdversary]] = {
    "phase": PhaseAdversary,
    "motion": MotionAdversary,
    "minibatch": MinibatchAdversary,
    "displacement": DisplacementAdversary,
}
"""The paper's, by their names in settings."""


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
