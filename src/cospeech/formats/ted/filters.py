"""What the published preprocessing of the TED set keeps (docs/facts/trimodal.md, section 3.6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

PUBLISHED_MEAN_POSE = (
    0.0000306, 0.0004946, 0.0008437, 0.0033759, -0.2051629, -0.0143453,
    0.0031566, -0.3054764, 0.0411491, 0.0029072, -0.4254303, -0.001311,
    -0.1458413, -0.1505532, -0.0138192, -0.2835603, 0.0670333, 0.0107002,
    -0.2280813, 0.112117, 0.2087789, 0.1523502, -0.1521499, -0.0161503,
    0.291909, 0.0644232, 0.0040145, 0.2452035, 0.1115339, 0.2051307,
)  # fmt: skip
"""Mean of the training poses, which the pose filter compares with.

See docs/facts/trimodal.md, section 3.2.
"""

PASSED = "PASS"

_WRISTS = (6, 9)


@dataclass(frozen=True)
class WindowRules:
    """What the published preprocessing keeps (docs/facts/trimodal.md, section 3.6).

    Attributes:
        fps: Frame rate that poses are resampled to.
        frames: Frames per window, filters and audio included: round(34 * 1.25). The published
            loader hands out the first 34 of them.
        stride: Frames from one window's start to the next.
        least_words: Words that a window must hold at least.
        least_pose_difference: Below this mean absolute difference from `mean_pose`, the speaker
            is taken not to move at all.
        largest_spine_angle: Degrees from the vertical that no frame may exceed.
        largest_mean_spine_angle: Degrees from the vertical, averaged over the window.
        least_wrist_variance: A wrist whose variance, summed over the axes, is below this is still;
            a window in which both are is left out.
        mean_pose: 30 numbers.
    """

    fps: float = 15.0
    frames: int = 42
    stride: int = 10
    least_words: int = 2
    least_pose_difference: float = 0.02
    largest_spine_angle: float = 30.0
    largest_mean_spine_angle: float = 20.0
    least_wrist_variance: float = 0.0014
    mean_pose: tuple[float, ...] = PUBLISHED_MEAN_POSE


PUBLISHED_RULES = WindowRules()


def judge_motion(poses: NDArray[np.floating], rules: WindowRules = PUBLISHED_RULES) -> str:
    """`PASSED`, or the first motion filter that a window fails.

    See docs/facts/trimodal.md, section 3.6, step 6.

    Args:
        poses: ``(T, 10, 3)``.
        rules: Thresholds.

    Returns:
        ``"PASS"``, ``"pose"``, ``"spine angle"`` or ``"motion"``.
    """
    poses = poses.astype(np.float64)
    mean_pose = np.reshape(rules.mean_pose, (10, 3))
    if np.abs(poses - mean_pose).mean() < rules.least_pose_difference:
        return "pose"
    spine = poses[:, 1] - poses[:, 0]
    upward = -spine[:, 1] / np.maximum(np.linalg.norm(spine, axis=1), np.finfo(np.float64).tiny)
    angles = np.degrees(np.arccos(upward.clip(-1, 1)))
    if angles.max() > rules.largest_spine_angle or angles.mean() > rules.largest_mean_spine_angle:
        return "spine angle"
    variances = poses[:, _WRISTS].var(axis=0).sum(axis=1)
    return "motion" if (variances < rules.least_wrist_variance).all() else PASSED
