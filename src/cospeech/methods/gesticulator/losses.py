"""Losses of Gesticulator (Kucherenko et al. 2020, section 4.3)."""

from __future__ import annotations

from typing import Literal

from torch import Tensor
from torch.nn.functional import mse_loss

VelocityAxis = Literal["time", "batch"]


def pose_loss(poses: Tensor, truth: Tensor) -> Tensor:
    """Mean squared difference of poses ``(B, T, D)``."""
    return mse_loss(poses, truth)


def velocity_loss(poses: Tensor, truth: Tensor, axis: VelocityAxis = "time") -> Tensor:
    """Mean squared difference of the steps from frame to frame.

    Args:
        poses: ``(B, T, D)``.
        truth: The same of the recording.
        axis: ``"batch"`` takes steps from one window of the batch to the next, as the published
            code did when the paper was written (docs/facts/trinity_and_gesticulator.md, 4.4).
    """
    dim = 1 if axis == "time" else 0
    return mse_loss(poses.diff(dim=dim), truth.diff(dim=dim))
