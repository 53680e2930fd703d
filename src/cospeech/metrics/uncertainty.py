"""How far a Fréchet gesture distance can be trusted, from the moments of each recording.

Windows overlap and neighbours are alike, so what is resampled is recordings. A plain percentile
interval misses a true zero always, since repeated recordings add a second dose of the bias that the
distance of a finite sample has; the *reflected* interval (twice the estimate minus the quantiles)
covers, conservatively.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor

from cospeech.metrics.functional import frechet_distance
from cospeech.metrics.moments import Moments

LEFT_OUT_AT_ONCE = 512
"""Leave-one-out sets weighed together: a weight per recording each."""


class FgdInterval(NamedTuple):
    """A distance with its uncertainty over recordings.

    Attributes:
        estimate: The value on all recordings.
        extrapolated: The jackknife's value for infinitely many recordings: a bias that falls as one
            over their number is removed. Not clipped, so it may be slightly negative.
        low: Lower end of the reflected interval.
        high: Upper end.
        recordings: How many recordings were resampled.
    """

    estimate: float
    extrapolated: float
    low: float
    high: float
    recordings: int


def fgd_interval(
    real: Moments,
    generated: Moments,
    level: float = 0.95,
    resamples: int = 400,
    seed: int = 0,
) -> FgdInterval:
    """Interval of one system's FGD.

    Args:
        real: Moments of the real windows, one entry per recording (`recording_moments`).
        generated: Those of the generated windows of the same recordings, in the same order.
        level: Share of the resampling distribution inside the interval.
        resamples: Number of draws.
        seed: Of the draws.

    Returns:
        The interval, its ends clipped at 0 because a distance is not negative.

    Raises:
        ValueError: Fewer than two recordings, or the recordings don't correspond.
    """
    _require_recordings(real, generated)

    def distance(weights: Tensor) -> Tensor:
        return frechet_distance(
            *real.weighted(weights).mean_and_covariance(),
            *generated.weighted(weights).mean_and_covariance(),
        )

    interval = _reflected(distance, real.samples, level, resamples, seed)
    return interval._replace(low=max(0.0, interval.low), high=max(0.0, interval.high))


def _reflected(
    statistic: Callable[[Tensor], Tensor], counts: Tensor, level: float, resamples: int, seed: int
) -> FgdInterval:
    recordings = len(counts)
    everything = torch.ones(recordings, dtype=torch.float64, device=counts.device)
    estimate = statistic(everything)
    left_out = torch.cat(
        [
            statistic(everything - torch.nn.functional.one_hot(some, recordings))
            for some in torch.arange(recordings, device=counts.device).split(LEFT_OUT_AT_ONCE)
        ]
    )
    extrapolated = recordings * estimate - (recordings - 1) * left_out.mean()

    generator = torch.Generator().manual_seed(seed)
    draws = torch.randint(recordings, (resamples, recordings), generator=generator)
    weights = torch.zeros(resamples, recordings, dtype=torch.float64)
    weights.scatter_add_(1, draws, torch.ones_like(weights))
    resampled = statistic(weights.to(counts.device))
    tail = (1 - level) / 2
    quantiles = torch.quantile(
        resampled, torch.tensor([1 - tail, tail], dtype=torch.float64, device=counts.device)
    )
    low, high = (2 * estimate - quantiles).tolist()
    return FgdInterval(estimate.item(), extrapolated.item(), low, high, recordings)


def _require_recordings(real: Moments, generated: Moments) -> None:
    if real.samples.ndim != 1 or real.total.shape != generated.total.shape:
        raise ValueError(
            "expected one entry per recording and the same recordings on both sides, got"
            f" {tuple(real.total.shape)} and {tuple(generated.total.shape)}"
        )
    if len(real.samples) < 2:
        raise ValueError("an interval over recordings needs at least two recordings")
    for moments in (real, generated):
        if (moments.samples.sum() - moments.samples).min() < 2:
            raise ValueError("one recording has all windows but one: no interval over recordings")
