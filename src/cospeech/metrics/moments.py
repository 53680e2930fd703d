"""Sums of features that are enough for means and covariances, added up window by window."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import NamedTuple

import torch
from torch import Tensor


class Moments(NamedTuple):
    """Sums over samples, float64; leading dimensions are batches (one entry per recording).

    Attributes:
        samples: ``(...)`` number of samples.
        total: ``(..., d)`` sum of x.
        outer: ``(..., d, d)`` sum of x xᵀ.
    """

    samples: Tensor
    total: Tensor
    outer: Tensor

    def mean_and_covariance(self) -> tuple[Tensor, Tensor]:
        """Mean ``(..., d)`` and unbiased covariance ``(..., d, d)`` (divisor n - 1).

        See docs/facts/trimodal.md, section 4.1.
        """
        samples = self.samples.double().unsqueeze(-1)
        mean = self.total / samples
        scatter = self.outer - self.total.unsqueeze(-1) * mean.unsqueeze(-2)
        return mean, scatter / (samples.unsqueeze(-1) - 1)

    def weighted(self, weights: Tensor) -> Moments:
        """Sums over the batch of recordings with a weight each.

        Args:
            weights: ``(..., R)``, how often each recording counts.

        Returns:
            Moments with the leading dimensions of ``weights``.
        """
        weights = weights.to(self.total)
        return Moments(
            weights @ self.samples.double(),
            weights @ self.total,
            torch.tensordot(weights, self.outer, dims=1),
        )


def feature_moments(features: Tensor) -> Moments:
    """Moments of features ``(n, d)``."""
    features = features.double()
    samples = torch.tensor(float(len(features)), dtype=torch.float64, device=features.device)
    return Moments(samples, features.sum(0), features.T @ features)


def recording_moments(features: Tensor, recording_ids: Sequence[Hashable]) -> Moments:
    """Moments of each recording, in order of first appearance.

    The resampling of `cospeech.metrics.uncertainty` draws whole recordings, because neighbouring
    windows are too alike to count as independent samples.

    Args:
        features: ``(n, d)``.
        recording_ids: The recording of each row.

    Returns:
        Moments with one leading dimension R.

    Raises:
        ValueError: Not one id per row.
    """
    if len(recording_ids) != len(features):
        raise ValueError(f"{len(recording_ids)} recording ids for {len(features)} rows")
    numbers: dict[Hashable, int] = {}
    index = torch.tensor([numbers.setdefault(key, len(numbers)) for key in recording_ids])
    counts = torch.bincount(index, minlength=len(numbers)).tolist()
    sorted_features = features[torch.argsort(index, stable=True).to(features.device)]
    per_recording = [feature_moments(rows) for rows in sorted_features.split(counts)]
    samples, totals, outers = zip(*per_recording, strict=True)
    return Moments(torch.stack(samples), torch.stack(totals), torch.stack(outers))
