"""Distributions of more numbers than fit in memory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SPEED_EDGES: NDArray[np.float64] = np.concatenate([[0.0], np.geomspace(1e-4, 1e5, 1801)])
"""Bins of speeds, 1.2 % wide, in metres (or pixels) per second."""


class StreamingHistogram:
    """Counts in fixed bins, for one or more rows of numbers that are added bit by bit.

    Args:
        edges: ``(E,)`` ascending bin edges; what lies outside is counted apart.
        rows: How many distributions are kept side by side.
    """

    def __init__(self, edges: NDArray[np.float64], rows: int = 1) -> None:
        self.edges = edges
        self.counts = np.zeros((rows, len(edges) + 1), dtype=np.int64)
        self._sums = np.zeros(rows)

    def add(self, values: NDArray[np.floating]) -> None:
        """Count ``values``, ``(N, rows)``."""
        bins = np.searchsorted(self.edges, values, side="right")
        rows, width = self.counts.shape
        bins += np.arange(rows) * width
        self.counts += np.bincount(bins.ravel(), minlength=rows * width).reshape(rows, width)
        self._sums += values.sum(axis=0, dtype=np.float64)

    @property
    def total(self) -> int:
        """Numbers added per row."""
        return int(self.counts[0].sum())

    @property
    def mean(self) -> NDArray[np.float64]:
        """``(rows,)`` means, exact; NaN before anything was added."""
        return self._sums / (self.total or np.nan)

    def quantile(self, share: float) -> NDArray[np.float64]:
        """``(rows,)`` values below which a share of the numbers lies, to a fraction of a bin.

        Numbers outside the edges count as lying on the outermost one; NaN when there are none.
        """
        if not self.total:
            return np.full(len(self.counts), np.nan)
        return np.array([np.interp(share * self.total, *self._below(row)) for row in self.counts])

    def rebinned(self, edges: NDArray[np.float64]) -> NDArray[np.float64]:
        """``(rows, len(edges) + 1)`` counts in coarser bins; first and last are what lies outside.

        A fine bin across a coarse edge is shared out evenly.

        Args:
            edges: Ascending, from the first fine edge on.
        """
        result = []
        for row in self.counts:
            cumulated, points = self._below(row)
            at = np.interp(edges, points, cumulated)
            result.append(np.diff(at, prepend=0.0, append=row.sum()))
        return np.array(result)

    def _below(self, row: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Numbers below each edge, and the edge."""
        return np.cumsum(row[:-1]).astype(np.float64), self.edges


def evenly(count: int, most: int) -> NDArray[np.int64]:
    """At most ``most`` of the indices below ``count``, evenly spaced, first and last included."""
    if count <= most:
        return np.arange(count)
    return np.rint(np.linspace(0, count - 1, most)).astype(np.int64)
