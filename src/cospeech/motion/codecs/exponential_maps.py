"""Rotations as exponential maps: the axis times the angle (Grassia 1998), three numbers a joint."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from cospeech.motion.codecs.rotations import RotationCodec, matrices_of_quaternions

_SMALL = 1e-8
"""Square of half an angle below which the series are exact in float32."""


def exponential_maps(quaternions: Tensor) -> Tensor:
    """Rotation vectors of at most pi of unit quaternions ``(..., 4)``, scalar last: ``(..., 3)``.

    No arc cosine: accurate and differentiable at every angle from 0 to pi.
    """
    # -q is the same rotation; of the two, the one that turns by pi at most.
    quaternions = torch.where(quaternions[..., 3:] < 0, -quaternions, quaternions)
    axis, w = quaternions[..., :3], quaternions[..., 3:]
    square = axis.square().sum(dim=-1, keepdim=True)
    is_small = square < _SMALL
    sine = square.where(~is_small, 1.0).sqrt()
    return axis * torch.where(is_small, 2 + square / 3, 2 * torch.atan2(sine, w) / sine)


def quaternions_of_exponential_maps(vectors: Tensor) -> Tensor:
    """Unit quaternions ``(..., 4)``, scalar last, of rotation vectors ``(..., 3)``."""
    square = vectors.square().sum(dim=-1, keepdim=True) / 4
    is_small = square < _SMALL
    half = square.where(~is_small, 1.0).sqrt()
    factor = torch.where(is_small, 0.5 - square / 12, half.sin() / (2 * half))
    return torch.cat([vectors * factor, torch.where(is_small, 1 - square / 2, half.cos())], dim=-1)


def nearest_branch(vectors: Tensor) -> Tensor:
    """A sequence of rotation vectors without the jump at pi.

    A rotation by ``a`` about ``n`` is one by ``2 pi - a`` about ``-n``, too. Each frame takes
    whichever of the two is nearer to the frame before it; the first frame keeps its own. What is
    left: a joint that turns on until the longer of them is near 2 pi jumps, as there is no
    representation in three numbers without a jump, and parts of a sequence that are encoded by
    themselves can begin on different branches.

    Args:
        vectors: ``(..., T, C, 3)``, of at most pi.

    Returns:
        The same rotations, of less than 2 pi or at it.
    """
    length = vectors.norm(dim=-1, keepdim=True)
    other = vectors * (1 - 2 * math.pi / length.clamp(min=1e-9))

    def wants_other(before: Tensor) -> Tensor:
        now, then = vectors[..., 1:, :, :], other[..., 1:, :, :]
        near = (now - before[..., :-1, :, :]).square().sum(dim=-1)
        return (then - before[..., :-1, :, :]).square().sum(dim=-1) < near

    # What a frame takes is a function of what the one before took, of which there are two values:
    # either the same for both ("decided"), or that of the one before, or its opposite ("turned").
    after_own, after_other = wants_other(vectors), wants_other(other)
    start = torch.zeros_like(vectors[..., :1, :, 0], dtype=torch.bool)
    is_decided = torch.cat([~start, after_own == after_other], dim=-2)
    decision = torch.cat([start, after_own], dim=-2)
    is_turned = torch.cat([start, after_own & ~after_other], dim=-2)
    frames = torch.arange(vectors.shape[-3], device=vectors.device)[:, None]
    last = torch.where(is_decided, frames, 0).cummax(dim=-2).values
    turns = is_turned.long().cumsum(dim=-2)
    since = (turns - turns.gather(-2, last)) % 2 == 1
    return torch.where((decision.gather(-2, last) ^ since)[..., None], other, vectors)


class ExponentialMapCodec(RotationCodec):
    """Exponential maps of the coded joints: 45 numbers for Gesticulator's 15 joints.

    Encoding a sequence keeps clear of the jump at pi where it can (`nearest_branch`). Statistics,
    where a method wants any, are a `ZScores` behind it.
    """

    values_per_joint = 3

    def _features(self, quaternions: Tensor) -> Tensor:
        return nearest_branch(exponential_maps(quaternions))

    def _matrices(self, features: Tensor) -> Tensor:
        return matrices_of_quaternions(quaternions_of_exponential_maps(features))

    def _quaternions(self, features: Tensor) -> Tensor:
        return quaternions_of_exponential_maps(features)
