"""A motion clip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.motion.skeleton import Skeleton


@dataclass(frozen=True, eq=False)
class Motion:
    """Joint positions over time, in house axes (+x the speaker's left, +y up, +z forward).

    Frame i shows time ``i / fps``.

    Attributes:
        skeleton: The joints.
        fps: Frames per second.
        positions: ``(T, J, 3)`` float32, metres. World space for recordings; root-relative (root
            at the origin, heading removed) for upper-body and generated motion. ``(T, J, 2)`` for
            keypoints of a picture: pixels, +x the speaker's left, +y up.
        rotations_local: ``(T, J, 4)`` quaternions (x, y, z, w) of each joint relative to its
            parent, where known. Together with ``positions[:, root]`` and the skeleton's offsets
            they give the positions back.

    Raises:
        ValueError: The shapes disagree or fps is not positive.
    """

    skeleton: Skeleton
    fps: float
    positions: NDArray[np.float32]
    rotations_local: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        joints = len(self.skeleton)
        if self.positions.ndim != 3 or self.positions.shape[1:] not in ((joints, 3), (joints, 2)):
            raise ValueError(
                f"positions of shape {self.positions.shape} for skeleton {self.skeleton.name}"
                f" with {joints} joints"
            )
        if self.rotations_local is not None and self.rotations_local.shape != (
            *self.positions.shape[:2],
            4,
        ):
            raise ValueError(f"rotations of shape {self.rotations_local.shape}")
        if not self.fps > 0:
            raise ValueError(f"fps must be positive, got {self.fps}")

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def dimensions(self) -> int:
        """3, or 2 for keypoints of a picture."""
        return self.positions.shape[2]

    @property
    def duration(self) -> float:
        """Seconds covered: frames / fps."""
        return len(self) / self.fps

    def first_bad_frame(self) -> int | None:
        """Index of the first frame with a NaN or infinite coordinate, or None."""
        bad = ~np.isfinite(self.positions).all(axis=(1, 2))
        return int(bad.argmax()) if bad.any() else None

    def slice(self, start: int, stop: int, step: int = 1) -> Motion:
        """Every ``step``-th frame from ``start`` to ``stop`` (exclusive)."""
        rotations = self.rotations_local
        return Motion(
            self.skeleton,
            self.fps / step,
            self.positions[start:stop:step],
            None if rotations is None else rotations[start:stop:step],
        )

    def followed_by(self, other: Motion) -> Motion:
        """This motion and then another one, of the same joints and frame rate."""
        mine, others = self.rotations_local, other.rotations_local
        return Motion(
            self.skeleton,
            self.fps,
            np.concatenate([self.positions, other.positions]),
            None if mine is None or others is None else np.concatenate([mine, others]),
        )


def resample_positions(
    positions: NDArray[np.floating], fps: float, new_fps: float
) -> NDArray[np.float32]:
    """Positions at another frame rate, by linear interpolation between frames.

    New frame j shows time ``j / new_fps``; frames after the last source frame are not made, so
    ``ceil`` rounding never extrapolates. Bones shorten by at most the chord of one source frame.

    Args:
        positions: ``(T, ..., 3)`` at ``fps``.
        fps: Frame rate of ``positions``.
        new_fps: Frame rate wanted.

    Returns:
        ``(T', ..., 3)`` float32 with ``T' = floor((T - 1) / fps * new_fps) + 1``.
    """
    if len(positions) == 0:
        return np.asarray(positions, dtype=np.float32)
    low, high, share = _neighbours(len(positions), fps, new_fps)
    weight = share.reshape(-1, *([1] * (positions.ndim - 1)))
    return (positions[low] * (1 - weight) + positions[high] * weight).astype(np.float32)


def resample_rotations(
    rotations: NDArray[np.floating], fps: float, new_fps: float
) -> NDArray[np.float32]:
    """Rotations at another frame rate, on the shorter arc between frames at an even speed (slerp).

    Args:
        rotations: ``(T, ..., 4)`` unit quaternions (x, y, z, w) at ``fps``.
        fps: Frame rate of ``rotations``.
        new_fps: Frame rate wanted.

    Returns:
        ``(T', ..., 4)`` float32 unit quaternions, frames as of `resample_positions`.
    """
    if len(rotations) == 0:
        return np.asarray(rotations, dtype=np.float32)
    low, high, share = _neighbours(len(rotations), fps, new_fps)
    weight = share.reshape(-1, *([1] * (rotations.ndim - 1)))
    before, after = rotations[low].astype(np.float64), rotations[high].astype(np.float64)
    cosine = (before * after).sum(axis=-1, keepdims=True)
    after, cosine = np.where(cosine < 0, -after, after), np.abs(cosine).clip(max=1)
    angle = np.arccos(cosine)
    # Where both are almost the same there is no arc to divide by, and a straight line is as good.
    sine = np.where(angle > 1e-6, np.sin(angle), 1)
    own = np.where(angle > 1e-6, np.sin((1 - weight) * angle), 1 - weight) / sine
    others = np.where(angle > 1e-6, np.sin(weight * angle), weight) / sine
    between = own * before + others * after
    return (between / np.linalg.norm(between, axis=-1, keepdims=True)).astype(np.float32)


def _neighbours(
    count: int, fps: float, new_fps: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Of each new frame the frames before and after, and how far it is from one to the other."""
    new_count = int(np.floor((count - 1) / fps * new_fps + 1e-6)) + 1
    times = np.arange(new_count, dtype=np.float64) * (fps / new_fps)
    low = np.minimum(times.astype(np.int64), count - 1)
    high: NDArray[np.int64] = np.minimum(low + 1, count - 1)
    share: NDArray[np.float64] = times - low
    return low, high, share
