"""Direction vectors along the bones of the upper body."""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor, nn

from cospeech.motion.upper_body import UPPER_BODY


def direction_vectors(positions: Tensor) -> Tensor:
    """Unit vectors along the nine upper-body bones.

    Args:
        positions: ``(..., 10, 3)`` positions of the `UPPER_BODY` joints.

    Returns:
        ``(..., 9, 3)``: child minus parent, normalised; a zero-length bone stays zero.
    """
    children = list(range(1, 10))
    parents = [UPPER_BODY.parents[child] for child in children]
    bones = positions[..., children, :] - positions[..., parents, :]
    return nn.functional.normalize(bones, dim=-1, eps=1e-12)


class DirectionVectorCodec(nn.Module):
    """Mean-subtracted direction vectors (Yoon et al. 2020, section 4.1), 27 numbers a frame.

    Features are ``axes * direction - mean_direction``; nothing is divided by a standard deviation.
    The statistics are buffers, so a checkpoint is enough to decode.

    Args:
        mean_direction: 27 numbers, the training mean in the feature's own axes.
        bone_lengths: Nine bone lengths in metres, used by `decode`.
        axes: Sign per axis from house axes to the feature's (`TED_AXES` for published weights).
    """

    size = 27

    def __init__(
        self,
        mean_direction: list[float],
        bone_lengths: list[float],
        axes: tuple[float, float, float] = (1.0, 1.0, 1.0),
    ) -> None:
        super().__init__()
        if len(mean_direction) != 27 or len(bone_lengths) != 9:
            raise ValueError(
                f"expected 27 mean values and 9 bone lengths, got {len(mean_direction)} and"
                f" {len(bone_lengths)}"
            )
        self.register_buffer("mean_direction", torch.tensor(mean_direction, dtype=torch.float32))
        self.register_buffer("bone_lengths", torch.tensor(bone_lengths, dtype=torch.float32))
        self.register_buffer("axes", torch.tensor(axes, dtype=torch.float32))

    def encode(self, positions: Tensor) -> Tensor:
        """Positions ``(..., 10, 3)`` in house axes to features ``(..., 27)``."""
        directions = direction_vectors(positions) * cast(Tensor, self.axes)
        return directions.flatten(-2) - cast(Tensor, self.mean_direction)

    def decode(self, features: Tensor, unit_length: bool = False) -> Tensor:
        """Features ``(..., 27)`` to positions ``(..., 10, 3)``, spine at the origin, metres.

        Args:
            features: Network output or `encode`'s result.
            unit_length: Normalise each vector first. The published code does not, so its bones
                come out shorter or longer than the table (docs/facts/trimodal.md, section 3.3).
        """
        directions = (features + cast(Tensor, self.mean_direction)).unflatten(-1, (9, 3))
        directions = directions * cast(Tensor, self.axes)
        if unit_length:
            directions = nn.functional.normalize(directions, dim=-1, eps=1e-12)
        bones = directions * cast(Tensor, self.bone_lengths).unsqueeze(-1)
        joints = [torch.zeros_like(bones[..., 0, :])]
        for child in range(1, 10):
            joints.append(joints[UPPER_BODY.parents[child]] + bones[..., child - 1, :])
        return torch.stack(joints, dim=-2)
