"""How joints move, in numbers: speed, acceleration, jerk, reach, holds, seams, repetition, bones.

Positions are ``(..., J, 3)`` in metres.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.distance import pdist, squareform

Array = NDArray[np.float64]

HOLD_SPEED = 0.1
"""Metres per second under which a wrist counts as held; a held hand still sways with the body."""

JITTER_FREQUENCY = 4.0
"""Hz above which wrist motion counts as jitter; people gesture below it."""


def derivative_sizes(positions: ArrayLike, order: int, fps: float) -> Array:
    """Sizes of a derivative of position at each step: speed, acceleration or jerk of each joint.

    ``|| d(t) || * fps^order`` where ``d`` is the difference of positions from frame to frame, of
    order 1 for speed, 2 for acceleration and 3 for jerk. Both conventions of published tables are
    this number: of seconds with the motion's own ``fps``, and of frames with ``fps=1``, by which
    table 3 of Kucherenko et al. 2020 was printed (docs/facts/metrics.md, section 4).

    Args:
        positions: ``(..., T, J, 3)``, in any unit of length.
        order: 1 or more.
        fps: Frames per second; 1 leaves the frame as unit of time.

    Returns:
        ``(..., T - order, J)``, in that unit per second (or frame) to the power of ``order``.

    Raises:
        ValueError: ``order`` is below 1, or there are too few frames for one difference.
    """
    positions = np.asarray(positions, dtype=np.float64)
    if order < 1 or positions.shape[-3] <= order:
        raise ValueError(f"differences of order {order} of {positions.shape[-3]} frames")
    sizes: Array = np.linalg.norm(np.diff(positions, n=order, axis=-3), axis=-1) * fps**order
    return sizes


def histogram(sizes: ArrayLike, width: float, bins: int) -> NDArray[np.int64]:
    """How many sizes fall into each bin, per column, and how many are beyond the last one.

    Published histograms of speed leave out what is beyond: on the clip of Gesticulator's demo that
    is a tenth of all speeds and nearly half of the hands'. Whoever compares shares must have it.

    Args:
        sizes: ``(N, ...)``, none below 0.
        width: Of a bin; bin b holds ``b * width <= size < (b + 1) * width``.
        bins: How many.

    Returns:
        ``(bins + 1, ...)``; the last row counts ``size >= bins * width``. A column's sum is N.

    Raises:
        ValueError: A size is negative or NaN.
    """
    sizes = np.asarray(sizes, dtype=np.float64)
    if not (sizes >= 0).all():
        raise ValueError("sizes are 0 or more")
    edges = width * np.arange(bins + 1)
    found = np.searchsorted(edges, sizes, side="right") - 1
    return np.stack([(found == place).sum(axis=0) for place in range(bins + 1)])


def wrist_velocities(windows: ArrayLike, wrists: Sequence[int], fps: float) -> Array:
    """Velocity of the wrists at each step of each window (Ferstl et al. 2020, equation 6).

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
    """Median over windows at each step, ``(T - 1,)``, of ``(N, T - 1)`` (equation 7 there)."""
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


def bone_lengths(positions: ArrayLike, bones: Sequence[tuple[int, int]]) -> Array:
    """Lengths ``(..., B)``, metres, of bones given as (parent, child), in ``(..., J, 3)``."""
    positions = np.asarray(positions, dtype=np.float64)
    parents, children = ([bone[end] for bone in bones] for end in (0, 1))
    lengths: Array = np.linalg.norm(
        positions[..., children, :] - positions[..., parents, :], axis=-1
    )
    return lengths


def bone_variation(recording: ArrayLike, bones: Sequence[tuple[int, int]]) -> Array:
    """Coefficient of variation of each bone's length: standard deviation over time / mean.

    Rigid bones have 0. Joints that are not neighbours in the body (shoulder and neck) or have soft
    links between (spine, wrist to finger tip) vary in real motion too: read it beside real's.

    Args:
        recording: ``(T, J, 3)`` of one person, metres.
        bones: (parent, child) indices.

    Returns:
        ``(B,)``; 0 for a bone without length.
    """
    lengths = bone_lengths(recording, bones)
    mean = lengths.mean(axis=0)
    return np.divide(lengths.std(axis=0), mean, out=np.zeros_like(mean), where=mean > 0)


class WindowDistances:
    """How far apart the windows of a system are, and what that says of repetition.

    ``d(a, b) = sqrt(mean over t, j of || a(t, j) - b(t, j) ||^2)``, in metres: 0 where two windows
    are the same.

    Args:
        windows: ``(N, T, J, 3)``, metres, N >= 2.

    Attributes:
        matrix: ``(N, N)`` distances, symmetric, with 0 on the diagonal.

    Raises:
        ValueError: Fewer than two windows.
    """

    def __init__(self, windows: ArrayLike) -> None:
        windows = np.asarray(windows, dtype=np.float64)
        count, frames, joints = windows.shape[:3]
        if count < 2:
            raise ValueError("a distance between windows needs two of them")
        flat = windows.reshape(count, -1)
        self.matrix: Array = squareform(pdist(flat)) / np.sqrt(frames * joints)
        centred = windows - windows.mean(axis=(0, 1))
        self._means = centred.mean(axis=1)
        self._squares = np.square(centred).sum(-1).mean(axis=(1, 2))

    def mean(self, chosen: NDArray[np.int64] | None = None) -> float:
        """Mean over pairs of different windows: the diversity of the output, metres.

        Args:
            chosen: Windows, with repetitions when resampled; a window is never paired with itself.
                None takes each once.

        Returns:
            NaN where there is no pair.
        """
        return _over_pairs(self.matrix, self._weights(chosen))

    def variety(self, chosen: NDArray[np.int64] | None = None) -> float:
        """Which part of the motion differs from window to window.

        ``mean d^2 / (2 s^2)`` where ``s`` is the root mean square distance of all poses from the
        system's own mean pose: about 1 where windows have nothing in common, 0 where each repeats
        the same motion. Large and small motion score alike: damped is not repetitive.

        Args:
            chosen: As for `mean`.

        Returns:
            NaN where there is no pair or no motion.
        """
        weights = self._weights(chosen)
        shares = weights / weights.sum()
        mean_pose = np.tensordot(shares, self._means, axes=1)
        variance = float(shares @ self._squares - np.square(mean_pose).sum(-1).mean())
        if variance <= 1e-12:
            return float("nan")
        return _over_pairs(np.square(self.matrix), weights) / (2 * variance)

    @property
    def nearest(self) -> Array:
        """Distance of each window's nearest other window, ``(N,)`` metres."""
        nearest: Array = (self.matrix + np.diag(np.full(len(self.matrix), np.inf))).min(axis=1)
        return nearest

    def _weights(self, chosen: NDArray[np.int64] | None) -> Array:
        if chosen is None:
            return np.ones(len(self.matrix))
        return np.bincount(chosen, minlength=len(self.matrix)).astype(np.float64)


def _over_pairs(values: Array, weights: Array) -> float:
    pairs = weights.sum() ** 2 - np.square(weights).sum()
    return float(weights @ values @ weights / pairs) if pairs > 0 else float("nan")


def mean_jerk(windows: ArrayLike, joints: Sequence[int], fps: float) -> Array:
    """Mean size of the third derivative of position, per window.

    `derivative_sizes` of order 3, over time and ``joints``.

    Args:
        windows: ``(N, T, J, 3)``, metres, T >= 4.
        joints: Indices of the joints.
        fps: Steps per second.

    Returns:
        ``(N,)`` metres per second cubed.
    """
    chosen = np.asarray(windows, dtype=np.float64)[:, :, list(joints)]
    jerk: Array = derivative_sizes(chosen, 3, fps).mean(axis=(1, 2))
    return jerk


def velocity_power(windows: ArrayLike, joints: Sequence[int], fps: float) -> Array:
    """Power of the joints' velocity above `JITTER_FREQUENCY`, and in all, per window.

    Of the one-sided spectrum of the velocity's components under a Hann window. Their ratio, of
    sums over windows, is the share of jitter: unlike jerk, it does not grow with the motion.

    Args:
        windows: ``(N, T, J, 3)``.
        joints: Indices of the joints.
        fps: Steps per second.

    Returns:
        ``(N, 2)``: above that frequency, and at all.
    """
    steps = np.diff(np.asarray(windows, dtype=np.float64)[:, :, list(joints)], axis=1)
    taper = np.hanning(steps.shape[1] + 2)[1:-1].reshape(1, -1, 1, 1)
    power = np.square(np.abs(np.fft.rfft(steps * taper, axis=1))).sum(axis=(2, 3))
    frequencies = np.fft.rfftfreq(steps.shape[1], 1 / fps)
    return np.stack([power[:, frequencies > JITTER_FREQUENCY].sum(-1), power.sum(-1)], axis=-1)


def held_share(windows: ArrayLike, wrists: Sequence[int], fps: float) -> Array:
    """Share of steps in which every wrist is slower than `HOLD_SPEED` (Euclidean), ``(N,)``."""
    speeds = derivative_sizes(np.asarray(windows, dtype=np.float64)[:, :, list(wrists)], 1, fps)
    share: Array = (speeds < HOLD_SPEED).all(-1).mean(-1)
    return share


def border_steps(recording: ArrayLike, window: int) -> tuple[Array, Array]:
    """Steps across the borders of the windows that a motion was made of, and those inside.

    A step is how far joints move from a frame to the next, in the mean over joints.

    Args:
        recording: ``(T, J, 3)``, metres, cut into windows from its first frame on.
        window: Frames per window.

    Returns:
        Metres, at borders (from frame ``k * window - 1`` to ``k * window``) and inside.
    """
    positions = np.asarray(recording, dtype=np.float64)
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=-1).mean(-1)
    at_border = np.arange(1, len(positions)) % window == 0
    return steps[at_border], steps[~at_border]


def seam_jump(steps: Iterable[tuple[Array, Array]]) -> float:
    """How much larger the steps at the borders of windows are than those inside.

    Args:
        steps: From `border_steps` of each recording.

    Returns:
        The median at borders over the median inside: 1 where no seam can be told. NaN where there
        is no border or nothing moves inside.
    """
    at_border, inside = (np.concatenate(parts) for parts in zip(*steps, strict=True))
    usual = float(np.median(inside)) if len(inside) else 0.0
    return float(np.median(at_border)) / usual if len(at_border) and usual > 0 else float("nan")
