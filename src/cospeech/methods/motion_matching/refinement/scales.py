"""Between poses in metres and what the networks see: parent-relative and normalised."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from cospeech.motion.codecs.parent_relative import ParentRelative

CONSTANT_M = 1e-4
"""A coordinate that varies by less, metres, is no motion: networks see 0, its mean comes out."""

SILENT = 1e-6
"""Speech channels that vary by less, as those of silence do, are 0 to the networks."""


class Scales(nn.Module):
    """One set of statistics, that of real motion, for matched, real and refined poses alike (D 7).

    Args:
        roles: Of the joints.
        audio: Speech channels.
    """

    pose_mean: Tensor
    pose_deviation: Tensor
    audio_mean: Tensor
    audio_deviation: Tensor

    def __init__(self, roles: Sequence[str], audio: int) -> None:
        super().__init__()
        self.tree = ParentRelative(roles)
        for name, size in (("pose", 3 * len(roles)), ("audio", audio)):
            self.register_buffer(f"{name}_mean", torch.zeros(size))
            self.register_buffer(f"{name}_deviation", torch.ones(size))

    @torch.no_grad()
    def fit(self, joints: Tensor, cepstra: Tensor) -> None:
        """Take the statistics of real motion ``(N, J, 3)``, metres, and speech ``(N, C)``."""
        offsets = self.tree.to_offsets(joints).flatten(-2)
        for name, values in (("pose", offsets), ("audio", cepstra)):
            values = values.double()
            getattr(self, f"{name}_mean").copy_(values.mean(dim=0))
            deviation = values.std(dim=0, correction=0)
            if name == "pose":
                deviation = torch.where(deviation < CONSTANT_M, 0.0, deviation)
            getattr(self, f"{name}_deviation").copy_(deviation)

    def poses(self, joints: Tensor) -> Tensor:
        """Normalised offsets ``(..., 3 J)`` of positions ``(..., J, 3)``."""
        moved = self.tree.to_offsets(joints).flatten(-2) - self.pose_mean
        varies = self.pose_deviation > 0
        return torch.where(varies, moved / self.pose_deviation.where(varies, 1.0), 0.0)

    def joints(self, poses: Tensor) -> Tensor:
        """Positions ``(..., J, 3)``, metres, of normalised offsets ``(..., 3 J)``."""
        offsets = poses * self.pose_deviation + self.pose_mean
        return self.tree.to_positions(offsets.unflatten(-1, (-1, 3)))

    def speech(self, cepstra: Tensor) -> Tensor:
        """Normalised speech ``(..., C)``."""
        varies = self.audio_deviation > SILENT
        moved = (cepstra - self.audio_mean) / self.audio_deviation.where(varies, 1.0)
        return torch.where(varies, moved, 0.0)
