"""Fréchet gesture distance over batches, epochs and processes."""

from __future__ import annotations

import warnings
from typing import Any

import torch
from torch import Tensor
from torchmetrics import Metric

from cospeech.metrics.encoder import GestureEncoder
from cospeech.metrics.functional import FrechetTerms, frechet_terms
from cospeech.metrics.moments import Moments, feature_moments


class FrechetGestureDistance(Metric):
    """Fréchet distance between real and generated windows in a frozen encoder's feature space.

    Yoon et al. 2020, equation 6, with unbiased covariances (docs/facts/trimodal.md, section 4.1).
    Sums are float64, so the value doesn't depend on batch size or on the number of processes. The
    encoder is held outside the module tree: it is neither trained with the module that owns the
    metric nor saved in its checkpoints, and it follows the positions to their device.

    Args:
        encoder: Makes the features; its `sha256` belongs next to every value.
        reset_real_features: False keeps the real windows' sums over `reset`, for a real set that
            is the same each epoch: give it once.
    """

    is_differentiable = False
    higher_is_better = False
    full_state_update = False
    plot_lower_bound = 0.0

    real_samples: Tensor
    real_total: Tensor
    real_outer: Tensor
    generated_samples: Tensor
    generated_total: Tensor
    generated_outer: Tensor

    def __init__(self, encoder: GestureEncoder, reset_real_features: bool = True) -> None:
        super().__init__()
        # In a tuple, because an attribute that is a module would be registered as a child.
        self._held_encoder = (encoder,)
        self.reset_real_features = reset_real_features
        size = encoder.size
        for side in ("real", "generated"):
            for name, shape in (("samples", ()), ("total", (size,)), ("outer", (size, size))):
                zeros = torch.zeros(shape, dtype=torch.float64)
                self.add_state(f"{side}_{name}", default=zeros, dist_reduce_fx="sum")

    @property
    def encoder(self) -> GestureEncoder:
        """The frozen encoder."""
        return self._held_encoder[0]

    @property
    def has_real_features(self) -> bool:
        """Whether real windows have been given since they were last reset."""
        return self.real_samples.item() > 0

    @torch.no_grad()
    def update(self, positions: Tensor, real: bool) -> None:
        """Add windows to one side.

        Args:
            positions: ``(B, 34, 10, 3)`` root-relative positions, house axes, metres.
            real: Whether they are real or generated.

        Raises:
            ValueError: A coordinate is NaN or infinite, or the windows have another length.
        """
        moments = feature_moments(self.encoder.to(positions.device).encode_positions(positions))
        side = "real" if real else "generated"
        for name, value in moments._asdict().items():
            state: Tensor = getattr(self, f"{side}_{name}")
            # Not in place: Lightning may have reset the state inside inference mode.
            setattr(self, f"{side}_{name}", state + value.to(state.device))

    def compute(self) -> Tensor:
        """The distance, a float64 scalar.

        Raises:
            RuntimeError: Fewer than two windows on a side.
        """
        return self._local_terms().total

    def terms(self) -> FrechetTerms:
        """Mean and covariance term of the distance, over all processes.

        Raises:
            RuntimeError: Fewer than two windows on a side.
        """
        with self.sync_context(
            dist_sync_fn=self.dist_sync_fn,
            should_sync=self._to_sync,
            should_unsync=self._should_unsync,
        ):
            return self._local_terms()

    def forward(self, *args: Any, **kwargs: Any) -> None:
        """`update` alone: a single batch's distance says nothing, and resetting for it is unsafe.

        Torchmetrics would reset, update and merge, which counts kept real features twice.
        """
        self.update(*args, **kwargs)

    def reset(self) -> None:
        """Forget the windows; the real ones only if `reset_real_features`."""
        if self.reset_real_features:
            super().reset()
            return
        names = ("real_samples", "real_total", "real_outer")
        kept = {name: getattr(self, name) for name in names}
        super().reset()
        for name, value in kept.items():
            setattr(self, name, value)

    def _local_terms(self) -> FrechetTerms:
        counts = int(self.real_samples.item()), int(self.generated_samples.item())
        if min(counts) < 2:
            raise RuntimeError(
                "a Fréchet gesture distance needs two windows or more on each side, got"
                f" {counts[0]} real and {counts[1]} generated"
            )
        if min(counts) <= self.encoder.size:
            warnings.warn(
                f"Fréchet gesture distance of {counts[0]} real and {counts[1]} generated windows in"
                f" {self.encoder.size} dimensions: the covariances are singular and the value is"
                " mostly sampling error",
                stacklevel=2,
            )
        real = Moments(self.real_samples, self.real_total, self.real_outer)
        generated = Moments(self.generated_samples, self.generated_total, self.generated_outer)
        return frechet_terms(*real.mean_and_covariance(), *generated.mean_and_covariance())
