"""Numbers with the spread that other recordings would have given them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

FEWEST_GROUPS = 5
"""Recordings under which resampling them says nothing."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """A number and what it is on resampled recordings.

    Numbers from the same `Resampling` were taken on the same draws, so that differences and ratios
    of two systems are compared recording by recording.

    Attributes:
        value: On all recordings.
        draws: ``(R,)`` on each draw; empty where resampling would say nothing.
    """

    value: float
    draws: Array

    @classmethod
    def of(cls, rows: Array) -> Estimate:
        """From ``(1 + R,)`` values of `Resampling.rows`."""
        return cls(float(rows[0]), rows[1:])

    def interval(self, level: float = 0.95, reflected: bool = False) -> tuple[float, float] | None:
        """The range that holds ``level`` of the draws.

        Args:
            level: Share inside.
            reflected: For distances, which resampling makes larger on average: twice the value
                minus the draws' quantiles, not below 0.

        Returns:
            Its ends; None without finite draws.
        """
        finite = self.draws[np.isfinite(self.draws)]
        if not len(finite) or not np.isfinite(self.value):
            return None
        low, high = np.quantile(finite, [(1 - level) / 2, (1 + level) / 2]).tolist()
        if reflected:
            low, high = max(0.0, 2 * self.value - high), max(0.0, 2 * self.value - low)
        return low, high


def combined(combine: Callable[..., ArrayLike], *estimates: Estimate) -> Estimate:
    """What ``combine`` makes of several numbers, draw by draw; no draws where one has none."""
    draws = [estimate.draws for estimate in estimates]
    paired = len({len(each) for each in draws}) == 1
    return Estimate(
        float(np.asarray(combine(*(estimate.value for estimate in estimates)))),
        np.asarray(combine(*draws), dtype=np.float64) if paired else np.zeros(0),
    )


class Resampling:
    """Draws of items (windows, recordings) in whole groups, with replacement.

    What is drawn are recordings, because the windows of one are alike. Under `FEWEST_GROUPS`
    recordings nothing is drawn, and no number has an interval.

    Args:
        groups: ``(N,)`` which recording each item is of.
        resamples: Number of draws.
        seed: Of the draws.
    """

    def __init__(self, groups: ArrayLike, resamples: int, seed: int) -> None:
        labels, members = np.unique(np.asarray(groups), return_inverse=True)
        self.items, self.groups = len(members), len(labels)
        self.draws: list[NDArray[np.int64]] = []
        if self.groups < FEWEST_GROUPS:
            return
        of_group = [np.flatnonzero(members == group) for group in range(self.groups)]
        rng = np.random.default_rng(seed)
        for _ in range(resamples):
            drawn = rng.integers(self.groups, size=self.groups)
            self.draws.append(np.concatenate([of_group[group] for group in drawn]))

    def rows(self, statistic: Callable[[NDArray[np.int64]], ArrayLike]) -> Array:
        """``(1 + R, ...)``: a statistic of all items, and then of those of every draw."""
        chosen = (np.arange(self.items), *self.draws)
        return np.array([statistic(items) for items in chosen], dtype=np.float64)

    def estimate(self, statistic: Callable[[NDArray[np.int64]], float]) -> Estimate:
        """A statistic of chosen items, on all of them and on every draw."""
        return Estimate.of(self.rows(statistic))

    def mean(self, values: ArrayLike) -> Estimate:
        """The mean of ``(N,)`` values."""
        values = np.asarray(values, dtype=np.float64)
        return self.estimate(lambda chosen: values[chosen].mean())
