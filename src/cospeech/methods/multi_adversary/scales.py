"""Between metres and z-scores: the statistics of the training part, kept with the weights."""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor, nn

from cospeech.corpus.batch import GestureBatch
from cospeech.methods.multi_adversary.losses import finger_offsets
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

    speech_mean: Tensor
    speech_deviation: Tensor
    pose_mean: Tensor
    pose_deviation: Tensor
    finger_deviation: Tensor

    def __init__(self, joints: GestureJoints) -> None:
        super().__init__()
        self.finger_tips = joints.finger_tips
        poses, fingers = (len(joints.roles), 3), (len(joints.finger_tips), 3)
        self.register_buffer("speech_mean", torch.zeros(ACOUSTICS))
        self.register_buffer("speech_deviation", torch.ones(ACOUSTICS))
        self.register_buffer("pose_mean", torch.zeros(poses))
        self.register_buffer("pose_deviation", torch.ones(poses))
        self.register_buffer("finger_deviation", torch.ones(fingers))

    def fit(self, batches: Iterable[GestureBatch]) -> None:
        """Take the statistics of the training part, which has at least one window."""
        speech, poses, fingers = _Moments(), _Moments(), _Moments()
        for batch in batches:
            joints = batch.require("joints")
            speech.add(batch.require("acoustics"))
            poses.add(joints)
            if self.finger_tips:
                fingers.add(finger_offsets(joints, self.finger_tips))
        self.speech_mean.copy_(speech.mean)
        self.speech_deviation.copy_(speech.deviation)
        self.pose_mean.copy_(poses.mean)
        self.pose_deviation.copy_(poses.deviation)
        if self.finger_tips:
            self.finger_deviation.copy_(fingers.deviation)

    def speech(self, acoustics: Tensor) -> Tensor:
        """Z-scores ``(..., 27)`` of speech features."""
        return (acoustics - self.speech_mean) / self.speech_deviation

    def poses(self, joints: Tensor) -> Tensor:
        """Z-scores ``(..., 3 J)`` of positions ``(..., J, 3)`` in metres."""
        return ((joints - self.pose_mean) / self.pose_deviation).flatten(-2)

    def joints(self, poses: Tensor) -> Tensor:
        """The positions of `poses`, metres."""
        return poses.unflatten(-1, self.pose_mean.shape) * self.pose_deviation + self.pose_mean


class _Moments:
    """Mean and standard deviation over the first two dimensions of batches, in float64."""

    def __init__(self) -> None:
        self.count, self.total, self.squares = 0, torch.zeros(1).double(), torch.zeros(1).double()

    def add(self, values: Tensor) -> None:
        values = values.flatten(0, 1).double().cpu()
        self.count += len(values)
        self.total = self.total + values.sum(dim=0)
        self.squares = self.squares + values.square().sum(dim=0)

    @property
    def mean(self) -> Tensor:
        return self.total / self.count

    @property
    def deviation(self) -> Tensor:
        variance = (self.squares / self.count - self.mean.square()).clamp(min=0)
        return variance.sqrt().clamp(min=LEAST_DEVIATION)
