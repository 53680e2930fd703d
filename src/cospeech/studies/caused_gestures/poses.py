"""How far poses are from those of the training, and how much they vary."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

EXPLAINED = 0.95
"""Share of the training poses' variance in the directions that distances are measured in.

What is left is mostly the lengths of bones, where millimetres would count as much as an arm's way.
"""


@dataclass(frozen=True, eq=False)
class PoseSpace:
    """The training poses as a Gaussian in their own principal directions.

    Attributes:
        mean: ``(J * 3,)`` metres.
        directions: ``(k, J * 3)`` unit vectors over the deviation along each, per metre.
    """

    mean: Array
    directions: Array

    @classmethod
    def of(cls, poses: ArrayLike) -> PoseSpace:
        """From ``(n, J, 3)`` poses."""
        flat = np.asarray(poses, dtype=np.float64)
        flat = flat.reshape(len(flat), -1)
        mean = flat.mean(axis=0)
        variances, vectors = np.linalg.eigh(np.cov(flat, rowvar=False, bias=True))
        variances, vectors = variances[::-1].clip(min=0), vectors[:, ::-1]
        shares = np.cumsum(variances) / max(variances.sum(), 1e-12)
        count = int(np.searchsorted(shares, EXPLAINED)) + 1
        deviations = np.sqrt(variances[:count]).clip(min=1e-9)
        return cls(mean, vectors[:, :count].T / deviations[:, None])

    def distances(self, poses: ArrayLike) -> Array:
        """How far poses are from the mean, ``(T,)`` of ``(T, J, 3)``.

        Mahalanobis distance over the root of the number of directions, so that training poses are
        1 away in the root mean square.
        """
        flat = np.asarray(poses, dtype=np.float64)
        along = (flat.reshape(len(flat), -1) - self.mean) @ self.directions.T
        distances: Array = np.sqrt(np.square(along).mean(axis=1))
        return distances


def first_and_last_quarter(values: Array) -> tuple[float, float]:
    """Means of the first and of the last quarter of ``(T,)`` values, T >= 4."""
    count = len(values) // 4
    return float(values[:count].mean()), float(values[-count:].mean())


def pose_variance(poses: ArrayLike) -> float:
    """Variance over time of ``(T, J, 3)`` poses, summed over joints and axes, square metres."""
    return float(np.asarray(poses, dtype=np.float64).var(axis=0).sum())
