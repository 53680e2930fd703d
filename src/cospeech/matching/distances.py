"""The two distances of motion matching, in double precision: what decides in the end.

See docs/facts/motion_matching.md, section 3.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def pose_distances(query: NDArray[np.float32], poses: NDArray[np.float32]) -> NDArray[np.float64]:
    """Squared Euclidean distances; as only their order counts, no roots are taken.

    Args:
        query: ``(D,)`` normalised pose feature.
        poses: ``(N, D)``.

    Returns:
        ``(N,)``; equal rows have equal distances, to the last bit.
    """
    difference = poses.astype(np.float64)
    difference -= query
    difference *= difference
    distances: NDArray[np.float64] = difference.sum(axis=1)
    return distances


def audio_distances(query: NDArray[np.float32], audio: NDArray[np.float32]) -> NDArray[np.float64]:
    """Cosine distances, ``1 - cos``; 1 where either side is zero, which has no direction.

    Args:
        query: ``(D,)`` normalised audio feature.
        audio: ``(N, D)``.

    Returns:
        ``(N,)`` in 0 to 2; equal rows have equal distances, to the last bit.
    """
    rows = audio.astype(np.float64)
    wanted = query.astype(np.float64)
    lengths = np.sqrt((rows * rows).sum(axis=1)) * np.sqrt((wanted * wanted).sum())
    products = (rows * wanted).sum(axis=1)
    return 1 - np.divide(products, lengths, out=np.zeros_like(products), where=lengths > 0)
