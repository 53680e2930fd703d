"""How fast and how far the wrists move: the numbers behind the paper's figures 1 and 11."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def wrist_velocities(windows: ArrayLike, wrists: Sequence[int], fps: float) -> Array:
    """Velocity of the wrists at each step of each window, as printed in equation 6.

    ``v(t) = |x(t) - x(t-1)| + |y(t) - y(t-1)| + |z(t) - z(t-1)|`` per wrist: a sum of absolute
    values, which is up to 1.73 times the Euclidean speed. The paper does not say which wrist it
    draws; this is the mean over ``wrists``.

    Args:
        windows: ``(N, T, J, 3)``, metres.
        wrists: Indices of the wrists.
        fps: Steps per second.

    Returns:
        ``(N, T - 1)`` m/s; divided by ``fps`` they are the paper's offsets per frame.
    """
    steps = np.abs(np.diff(np.asarray(windows, dtype=np.float64)[:, :, list(wrists)], axis=1))
    velocities: Array = steps.sum(-1).mean(-1) * fps
    return velocities


def median_curve(velocities: Array) -> Array:
    """Median over windows at each step, ``(T - 1,)``, of ``(N, T - 1)`` (equation 7)."""
    curve: Array = np.median(velocities, axis=0)
    return curve


def area_between(curve: Array, other: Array, fps: float) -> float:
    """Area between two curves, ``sum |a(t) - b(t)| / fps``.

    Of two velocity curves in m/s it is in metres: how much further one travels than the other,
    where what it lacks in one place does not make up for another.

    Raises:
        ValueError: The curves have different lengths.
    """
    if curve.shape != other.shape:
        raise ValueError(f"curves of {curve.shape} and {other.shape} steps")
    return float(np.abs(curve - other).sum() / fps)


def farthest_reaches(windows: ArrayLike, wrists: Sequence[int], mean_pose: ArrayLike) -> Array:
    """How far each window takes a wrist from where it is in the mean pose.

    ``max over t, w of || p(t, w) - mean(w) ||``, the paper's "maximum distance of the wrists from
    mean pose".

    Args:
        windows: ``(N, T, J, 3)``, metres.
        wrists: Indices of the wrists.
        mean_pose: ``(J, 3)`` mean of the training part, metres.

    Returns:
        ``(N,)`` metres.
    """
    chosen = list(wrists)
    away = np.asarray(windows, dtype=np.float64)[:, :, chosen] - np.asarray(mean_pose)[chosen]
    reaches: Array = np.linalg.norm(away, axis=-1).max(axis=(1, 2))
    return reaches


def scattered_positions(
    recordings: Sequence[ArrayLike], fps: float, seconds: float = 120.0, rate: float = 4.0
) -> Array:
    """Positions of the first two minutes, four per second (figure 1).

    Recordings follow one another until the time is full; each is sampled from its own start.

    Args:
        recordings: ``(T, J, 3)`` each, metres.
        fps: Frames per second of the recordings.
        seconds: Time covered; less where there is less.
        rate: Positions per second.

    Returns:
        ``(n, J, 3)`` with ``n <= seconds * rate``.

    Raises:
        ValueError: No recordings.
    """
    if not len(recordings):
        raise ValueError("no recordings")
    sampled = []
    for recording in recordings:
        positions = np.asarray(recording, dtype=np.float64)
        count = int(np.ceil(len(positions) * rate / fps - 1e-9))
        sampled.append(positions[np.rint(np.arange(count) * fps / rate).astype(np.int64)])
    return np.concatenate(sampled)[: round(seconds * rate)]
