"""Numbers as multiples of their standard deviation from their mean: z-scored joints and others."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn


class Moments:
    """Mean and standard deviation of what is added, part by part, in float64.

    Args:
        shape: Shape of one sample; dimensions before it are samples.
    """

    def __init__(self, shape: Sequence[int]) -> None:
        self._shape = tuple(shape)
        self._count = 0
        self._total = torch.zeros(self._shape, dtype=torch.float64)
        self._squares = torch.zeros(self._shape, dtype=torch.float64)

    def add(self, values: Tensor) -> None:
        """Count ``(..., *shape)`` in."""
        values = values.detach().double().cpu().reshape(-1, *self._shape)
        self._count += len(values)
        self._total = self._total + values.sum(dim=0)
        self._squares = self._squares + values.square().sum(dim=0)

    @property
    def mean(self) -> Tensor:
        """``shape``, float64.

        Raises:
            ValueError: Nothing was added.
        """
        return self._total / self._require()

    def deviation(self, least: float) -> Tensor:
        """The population's standard deviation, ``shape``, float64; at least ``least``."""
        variance = (self._squares / self._require() - self.mean.square()).clamp(min=0)
        return variance.sqrt().clamp(min=least)

    def _require(self) -> int:
        if not self._count:
            raise ValueError("statistics of nothing")
        return self._count


class ZScores(nn.Module):
    """``(x - mean) / deviation`` of numbers of one shape, and the way back.

    The statistics are buffers, so a checkpoint is enough to decode. Until they are taken they are 0
    and 1, so that a new model can be tried out. Of shape ``(J, 3)`` this is the codec of z-scored
    joints; behind another codec it standardises its features.

    Args:
        shape: Of what is encoded, e.g. ``(J, 3)``.
        least_deviation: Deviations below count as this: what never moves has no deviation of its
            own, and its rounding errors must not count as motion.
    """

    mean: Tensor
    deviation: Tensor

    def __init__(self, shape: Sequence[int], least_deviation: float) -> None:
        super().__init__()
        self.least_deviation = least_deviation
        self.register_buffer("mean", torch.zeros(*shape))
        self.register_buffer("deviation", torch.ones(*shape))

    def take(self, moments: Moments) -> None:
        """Take the statistics that were gathered.

        Raises:
            ValueError: Nothing was added to them.
        """
        self.mean.copy_(moments.mean)
        self.deviation.copy_(moments.deviation(self.least_deviation))

    def encode(self, values: Tensor) -> Tensor:
        """Z-scores ``(..., D)`` of ``(..., *shape)``; D is the product of ``shape``."""
        return ((values - self.mean) / self.deviation).flatten(-self.mean.ndim)

    def decode(self, scores: Tensor) -> Tensor:
        """The values ``(..., *shape)`` of `encode`."""
        return scores.unflatten(-1, self.mean.shape) * self.deviation + self.mean
