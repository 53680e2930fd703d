"""Between metres and z-scores: the statistics of the training part, kept with the weights."""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor, nn

from cospeech.corpus.batch import GestureBatch
from cospeech.methods.multi_adversary.losses import finger_offsets
from cospeech.motion.codecs import Moments, ZScores
from cospeech.motion.gesture_joints import GestureJoints
from cospeech.speech.feature_sets.opensmile import COEFFICIENTS

ACOUSTICS = COEFFICIENTS + 1
"""Speech features per step: cepstra and F0."""

LEAST_DEVIATION = 1e-3
"""Of a position, metres, and of a speech feature. A joint that never moves against the pelvis has
none of its own, and its rounding errors must not count as motion."""


class Scales(nn.Module):
    """Means and standard deviations of speech, poses and finger offsets, as buffers.

    Until `fit` they are 0 and 1, so that a new model can be tried out.

    Args:
        joints: The gesturing joints.
    """

    finger_deviation: Tensor

    def __init__(self, joints: GestureJoints) -> None:
        super().__init__()
        self.finger_tips = joints.finger_tips
        self.acoustics = ZScores((ACOUSTICS,), LEAST_DEVIATION)
        self.pose = ZScores((len(joints.roles), 3), LEAST_DEVIATION)
        self.register_buffer("finger_deviation", torch.ones(len(joints.finger_tips), 3))

    @property
    def pose_mean(self) -> Tensor:
        """Mean positions ``(J, 3)``, metres."""
        return self.pose.mean

    def fit(self, batches: Iterable[GestureBatch]) -> None:
        """Take the statistics of the training part, which has at least one window."""
        speech, poses = Moments((ACOUSTICS,)), Moments(self.pose.mean.shape)
        fingers = Moments(self.finger_deviation.shape)
        for batch in batches:
            joints = batch.require("joints")
            speech.add(batch.require("acoustics"))
            poses.add(joints)
            if self.finger_tips:
                fingers.add(finger_offsets(joints, self.finger_tips))
        self.acoustics.take(speech)
        self.pose.take(poses)
        if self.finger_tips:
            self.finger_deviation.copy_(fingers.deviation(LEAST_DEVIATION))

    def speech(self, acoustics: Tensor) -> Tensor:
        """Z-scores ``(..., 27)`` of speech features."""
        return self.acoustics.encode(acoustics)

    def poses(self, joints: Tensor) -> Tensor:
        """Z-scores ``(..., 3 J)`` of positions ``(..., J, 3)`` in metres."""
        return self.pose.encode(joints)

    def joints(self, poses: Tensor) -> Tensor:
        """The positions of `poses`, metres."""
        return self.pose.decode(poses)
