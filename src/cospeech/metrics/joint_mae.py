"""Joint position error over batches."""

from __future__ import annotations

import torch
from torch import Tensor
from torchmetrics import Metric

from cospeech.metrics.functional import SEED_FRAMES, joint_mae


class JointMAE(Metric):
    """Mean absolute error per joint coordinate, metres, weighted by batch size.

    See docs/facts/trimodal.md, section 4.3.

    Args:
        seed_frames: Leading frames that were given to the method and are left out.
    """

    is_differentiable = False
    higher_is_better = False
    full_state_update = False
    plot_lower_bound = 0.0

    error: Tensor
    count: Tensor

    def __init__(self, seed_frames: int = SEED_FRAMES) -> None:
        super().__init__()
        self.seed_frames = seed_frames
        self.add_state("error", torch.zeros((), dtype=torch.float64), dist_reduce_fx="sum")
        self.add_state("count", torch.zeros((), dtype=torch.float64), dist_reduce_fx="sum")

    def update(self, generated: Tensor, real: Tensor) -> None:
        """Add paired windows ``(B, T, 10, 3)``, root-relative, metres."""
        self.error = self.error + joint_mae(generated, real, self.seed_frames) * len(generated)
        self.count = self.count + len(generated)

    def compute(self) -> Tensor:
        """Metres, a float64 scalar."""
        return self.error / self.count
