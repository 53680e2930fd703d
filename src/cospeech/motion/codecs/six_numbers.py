"""Rotations as six numbers a joint (Zhou et al. 2019): two columns of the rotation matrix."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from cospeech.motion.codecs.rotations import RotationCodec, matrices_of_quaternions


def matrices_of_six_numbers(numbers: Tensor) -> Tensor:
    """Rotation matrices ``(..., 3, 3)`` of any six numbers, by Gram-Schmidt (section B).

    The first three become the first column, the rest of the last three beside it the second.
    """
    first = nn.functional.normalize(numbers[..., :3], dim=-1)
    beside = numbers[..., 3:] - (first * numbers[..., 3:]).sum(dim=-1, keepdim=True) * first
    second = nn.functional.normalize(beside, dim=-1)
    third = torch.linalg.cross(first, second)
    return torch.stack([first, second, third], dim=-1)


class SixNumberCodec(RotationCodec):
    """The first two columns of each coded joint's rotation matrix, column by column.

    Continuous everywhere: near rotations have near features, whatever the angle.
    """

    values_per_joint = 6

    def _features(self, quaternions: Tensor) -> Tensor:
        return matrices_of_quaternions(quaternions)[..., :2].transpose(-1, -2).flatten(-2)

    def _matrices(self, features: Tensor) -> Tensor:
        return matrices_of_six_numbers(features)
