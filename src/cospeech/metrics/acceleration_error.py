"""Acceleration error over batches."""

from __future__ import annotations

import torch
from torch import Tensor
from torchmetrics import Metric

from cospeech.metrics.functional import acceleration_error


class AccelerationError(Metric):
    """Mean absolute difference of second frame differences, weighted by batch size.

    See docs/facts/trimodal.md, section 4.3.

    In metres per squared frame, as published: compare it at one frame rate only.
    """

    is_differentiable = False
    higher_is_better = False
    full_state_update = False
    plot_lower_bound = 0.0

    error: Tensor
    count: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.add_state("error", torch.zeros((), dtype=torch.float64), dist_reduce_fx="sum")
        self.add_state("count", torch.zeros((), dtype=torch.float64), dist_reduce_fx="sum")

    def update(self, generated: Tensor, real: Tensor) -> None:
        """Add paired windows ``(B, T, 10, 3)``, root-relative, metres."""
        self.error = self.error + acceleration_error(generated, real) * len(generated)
        self.count = self.count + len(generated)

    def compute(self) -> Tensor:
        """Metres per squared frame, a float64 scalar."""
        return self.error / self.count
