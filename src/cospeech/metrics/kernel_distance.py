"""Kernel distance of two sets of windows."""

from __future__ import annotations

from typing import ClassVar, Literal

import torch
from torch import Tensor
from torchmetrics.utilities import dim_zero_cat

from cospeech.metrics.evaluation_windows import EvaluationWindows
from cospeech.metrics.functional import kernel_distance
from cospeech.metrics.window_metric import WindowMetric


class KernelDistance(WindowMetric):
    """Unbiased squared kernel distance of the windows' features, as `kernel_distance` gives it."""

    title = "kernel distance"
    compares: ClassVar[Literal["sets"]] = "sets"
    higher_is_better = False

    generated_features: list[Tensor]
    real_features: list[Tensor]

    def __init__(self) -> None:
        super().__init__()
        for side in ("generated", "real"):
            self.add_state(f"{side}_features", default=[], dist_reduce_fx="cat")

    @torch.no_grad()
    def update(self, generated: EvaluationWindows, real: EvaluationWindows) -> None:
        """Add windows of both sides, pair by pair where they are pairs."""
        self.generated_features.append(generated.features)
        self.real_features.append(real.features)

    def compute(self) -> Tensor:
        """The distance, a float64 scalar; it may come out slightly negative.

        Raises:
            ValueError: Fewer than two windows on a side.
        """
        generated, real = map(dim_zero_cat, (self.generated_features, self.real_features))
        return kernel_distance(generated, real, self.are_pairs)
