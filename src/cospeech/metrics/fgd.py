"""Fréchet gesture distance over batches, epochs and processes."""

from __future__ import annotations

import warnings
from typing import ClassVar, Literal

import torch
from torch import Tensor

from cospeech.metrics.encoder import FEATURE_SIZE
from cospeech.metrics.evaluation_windows import EvaluationWindows
from cospeech.metrics.functional import frechet_terms
from cospeech.metrics.moments import Moments, feature_moments
from cospeech.metrics.window_metric import VALUE, WindowMetric


class FrechetGestureDistance(WindowMetric):
    """Fréchet distance between real and generated windows in a frozen encoder's feature space.

    Yoon et al. 2020, equation 6, with unbiased covariances (docs/facts/trimodal.md, section 4.1).
    Sums are float64, so the value doesn't depend on batch size or on the number of processes. The
    encoder's `sha256` belongs next to every value.
    """

    title = "FGD"
    compares: ClassVar[Literal["sets"]] = "sets"
    higher_is_better = False
    plot_lower_bound = 0.0

    real_samples: Tensor
    real_total: Tensor
    real_outer: Tensor
    generated_samples: Tensor
    generated_total: Tensor
    generated_outer: Tensor

    def __init__(self) -> None:
        super().__init__()
        size = FEATURE_SIZE
        for side in ("real", "generated"):
            for name, shape in (("samples", ()), ("total", (size,)), ("outer", (size, size))):
                zeros = torch.zeros(shape, dtype=torch.float64)
                self.add_state(f"{side}_{name}", default=zeros, dist_reduce_fx="sum")

    @torch.no_grad()
    def update(self, generated: EvaluationWindows, real: EvaluationWindows) -> None:
        """Add windows of both sides, as many of each as there are."""
        for side, windows in (("generated", generated), ("real", real)):
            for name, value in feature_moments(windows.features)._asdict().items():
                state: Tensor = getattr(self, f"{side}_{name}")
                # Not in place: Lightning may have reset the state inside inference mode.
                setattr(self, f"{side}_{name}", state + value.to(state.device))

    def compute(self) -> dict[str, Tensor]:
        """The distance, and its terms ``mean_term`` and ``covariance_term``.

        Raises:
            RuntimeError: Fewer than two windows on a side.
        """
        counts = int(self.real_samples.item()), int(self.generated_samples.item())
        if min(counts) < 2:
            raise RuntimeError(
                "a Fréchet gesture distance needs two windows or more on each side, got"
                f" {counts[0]} real and {counts[1]} generated"
            )
        if min(counts) <= FEATURE_SIZE:
            warnings.warn(
                f"Fréchet gesture distance of {counts[0]} real and {counts[1]} generated windows in"
                f" {FEATURE_SIZE} dimensions: the covariances are singular and the value is"
                " mostly sampling error",
                stacklevel=2,
            )
        real = Moments(self.real_samples, self.real_total, self.real_outer)
        generated = Moments(self.generated_samples, self.generated_total, self.generated_outer)
        terms = frechet_terms(*real.mean_and_covariance(), *generated.mean_and_covariance())
        return {
            VALUE: terms.total,
            "mean_term": terms.mean_term,
            "covariance_term": terms.covariance_term,
        }
