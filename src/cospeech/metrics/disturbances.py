"""Synthetic disturbances of real motion (Yoon et al. 2020, section 5.2).

The paper's noise is in the coordinates of its data, whose poses are scaled until the nine bones
average 0.2. Ours are metres of real people. So each length is multiplied by the ratio of our mean
bone to 0.2, and a disturbance bends the poses as much as the paper's does. All ten joints are
disturbed, the root too (the paper's K = 30).
"""

from __future__ import annotations

import torch
from torch import Tensor

from cospeech.motion.upper_body import UPPER_BODY

PUBLISHED_MEAN_BONE = 0.2
"""Mean bone length in the coordinates of the paper's data (docs/facts/trimodal.md, section 3.1)."""
SALT_AND_PEPPER_SIZE = 0.2
"""Displacement of a salt-and-pepper coordinate, in those coordinates."""
TEMPORAL_VARIANCE = 0.003
"""Variance of the temporal noise, in those coordinates."""


def published_scale(positions: Tensor) -> float:
    """Metres per unit of the paper's coordinates: mean bone length over 0.2.

    Args:
        positions: ``(..., 10, 3)`` upper-body positions, metres.
    """
    children = list(range(1, 10))
    parents = [UPPER_BODY.parents[child] for child in children]
    bones = positions[..., children, :] - positions[..., parents, :]
    return bones.norm(dim=-1).mean().item() / PUBLISHED_MEAN_BONE


def gaussian(positions: Tensor, zeta: float, scale: float, generator: torch.Generator) -> Tensor:
    """Normal noise of variance ``zeta`` (published units), the same on every frame of a window.

    Args:
        positions: ``(N, T, 10, 3)``, metres.
        zeta: Variance.
        scale: Metres per published unit (`published_scale`).
        generator: Of the draws.
    """
    noise = torch.randn(len(positions), 1, *positions.shape[2:], generator=generator)
    return positions + noise * (scale * zeta**0.5)


def salt_and_pepper(
    positions: Tensor, zeta: float, scale: float, generator: torch.Generator
) -> Tensor:
    """Coordinates moved by +0.2 or -0.2, each with probability ``zeta / 2``, on all frames alike.

    Args:
        positions: ``(N, T, 10, 3)``, metres.
        zeta: Probability that a coordinate is moved.
        scale: Metres per published unit (`published_scale`).
        generator: Of the draws.
    """
    draw = torch.rand(len(positions), 1, *positions.shape[2:], generator=generator)
    sign = (draw <= zeta / 2).float() - ((draw > zeta / 2) & (draw <= zeta)).float()
    return positions + sign * (scale * SALT_AND_PEPPER_SIZE)


def temporal(positions: Tensor, zeta: int, scale: float, generator: torch.Generator) -> Tensor:
    """Normal noise of variance 0.003 on ``zeta`` successive frames from a random one on.

    Each of the frames has its own noise: it is meant to break the motion's continuity.

    Args:
        positions: ``(N, T, 10, 3)``, metres.
        zeta: Disturbed frames per window, at most T.
        scale: Metres per published unit (`published_scale`).
        generator: Of the draws.
    """
    count, frames = positions.shape[:2]
    start = torch.randint(frames - zeta + 1, (count, 1), generator=generator)
    frame = torch.arange(frames)
    chosen = (frame >= start) & (frame < start + zeta)
    noise = torch.randn(positions.shape, generator=generator)
    return positions + noise * chosen[..., None, None] * (scale * TEMPORAL_VARIANCE**0.5)


def multiplicative(positions: Tensor, zeta: float, mean_pose: Tensor) -> Tensor:
    """Eigenposes multiplied by ``zeta``: 0 gives the mean pose, 2 doubles every excursion.

    With all components kept, the principal axes are a rotation about the mean pose, and a common
    factor on them is the same factor on the deviation from the mean pose.

    Args:
        positions: ``(N, T, 10, 3)``, metres.
        zeta: Factor.
        mean_pose: ``(10, 3)``, metres.
    """
    return mean_pose + zeta * (positions - mean_pose)


def mismatched(positions: Tensor, zeta: float, generator: torch.Generator) -> Tensor:
    """A fraction ``zeta`` of the windows replaced by random windows of the same set.

    Args:
        positions: ``(N, T, 10, 3)``.
        zeta: Fraction replaced.
        generator: Of the draws.
    """
    count = len(positions)
    replaced = torch.randperm(count, generator=generator)[: round(zeta * count)]
    result = positions.clone()
    result[replaced] = positions[torch.randint(count, (len(replaced),), generator=generator)]
    return result


def time_reversed(positions: Tensor) -> Tensor:
    """Every window ``(N, T, 10, 3)`` played backwards."""
    return positions.flip(1)


def frozen_arms(positions: Tensor) -> Tensor:
    """Arms that keep each window's first pose while trunk and head move.

    Args:
        positions: ``(N, T, 10, 3)``, metres; elbows and wrists keep their offset from the shoulder.
    """
    result = positions.clone()
    for side in ("left", "right"):
        shoulder = positions[:, :, UPPER_BODY.index[f"{side}_shoulder"]]
        for joint in (f"{side}_elbow", f"{side}_wrist"):
            index = UPPER_BODY.index[joint]
            result[:, :, index] = shoulder + (positions[:, :1, index] - shoulder[:, :1])
    return result
