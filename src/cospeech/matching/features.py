"""What motion matching compares: where the arms go next, and what is heard next.

See docs/facts/motion_matching.md, section 3.

The feature of a frame is that frame and some later ones ("taps"), tap by tap, every dimension
normalised over the database.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import ConfigError
from cospeech.motion.gesture_joints import GestureJoints, gesture_joints
from cospeech.motion.skeleton import Skeleton

SMALLEST_DEVIATION = 1e-8
"""Added to deviations: a dimension that never changes counts nothing."""


MOST_FRAMES = 100_000
"""Of a sequence of a database or a feature; two hours at 15 fps."""


@dataclass(frozen=True)
class MatchingSpec:
    """How a database is cut and what a feature is made of; the published values by default.

    Attributes:
        fps: Frames per second of motion and audio features.
        chunk_frames: Length of the disjoint sequences.
        pose_taps: Frames in a pose feature.
        audio_taps: Frames in an audio feature.
        tap_spacing: Frames between taps.
        true_future: Beyond the end of a sequence, read on in the recording where it goes on
            (docs/facts/motion_matching.md, section 10, decision 5), and never start a window where
            it doesn't. Otherwise zeros, as published: the features of a sequence's last frames are
            then partly made up.

    Raises:
        ConfigError: A length below 1 or above `MOST_FRAMES`.
    """

    fps: float = 15.0
    chunk_frames: int = 64
    pose_taps: int = 4
    audio_taps: int = 8
    tap_spacing: int = 2
    true_future: bool = False

    def __post_init__(self) -> None:
        for name in ("chunk_frames", "pose_taps", "audio_taps", "tap_spacing"):
            if not 1 <= getattr(self, name) <= MOST_FRAMES:
                raise ConfigError(f"{name}={getattr(self, name)}: must be 1 to {MOST_FRAMES}")

    def reach(self, taps: int) -> int:
        """Frames from the first tap to the last."""
        return (taps - 1) * self.tap_spacing


@dataclass(frozen=True)
class Normalisation:
    """Mean and deviation of each dimension over a database.

    Attributes:
        mean: ``(D,)``.
        deviation: ``(D,)``, `SMALLEST_DEVIATION` included.
    """

    mean: NDArray[np.float64]
    deviation: NDArray[np.float64]

    @classmethod
    def over(cls, blocks: Callable[[], Iterable[NDArray[np.float32]]]) -> Normalisation:
        """Of ``(frames, D)`` blocks of features, which are gone through twice."""
        sums = [(len(block), block.sum(axis=0, dtype=np.float64)) for block in blocks()]
        count = sum(length for length, _ in sums)
        mean: NDArray[np.float64] = np.sum([total for _, total in sums], axis=0) / count
        squares = [((block - mean) ** 2).sum(axis=0) for block in blocks()]
        return cls(mean, np.sqrt(np.sum(squares, axis=0) / count) + SMALLEST_DEVIATION)

    def __call__(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """Normalise ``(..., D)`` features."""
        return ((features - self.mean) / self.deviation).astype(np.float32)


def stack_taps(channels: NDArray[np.float32], taps: int, spacing: int) -> NDArray[np.float32]:
    """Each frame beside its later taps, zeros beyond the end.

    Args:
        channels: ``(T, C)``.
        taps: Frames in a feature.
        spacing: Frames between them.

    Returns:
        ``(T, taps * C)``: all channels of the frame, then all of the next tap.
    """
    frames = len(channels)
    padded = np.pad(channels, ((0, (taps - 1) * spacing), (0, 0)))
    return np.concatenate([padded[tap * spacing :][:frames] for tap in range(taps)], axis=1)


@dataclass(frozen=True)
class SearchJoints:
    """The joints whose positions are compared.

    Attributes:
        roles: ``right_elbow``, ``right_wrist``, the same on the left, then, where there are
            fingers, ``right_index_root``, ``right_little_root``, the same on the left: the order
            of the paper's eight.
        joints: Their names on the skeleton.
        gesture: The gesturing joints, which a database keeps for its output.
    """

    roles: tuple[str, ...]
    joints: tuple[str, ...]
    gesture: GestureJoints


def search_joints(skeleton: Skeleton) -> SearchJoints:
    """Elbows, wrists and, on a skeleton with fingers, the roots of index and little fingers.

    Raises:
        CospeechError: No joint map fits the skeleton (see `gesture_joints`).
    """
    gesture = gesture_joints(skeleton)
    names = dict(zip(gesture.roles, gesture.body.joints, strict=True))
    sides = ("right", "left")
    roles = {
        f"{side}_{joint}": names[f"{side}_{joint}"]
        for side in sides
        for joint in ("elbow", "wrist")
    }
    if gesture.finger_tips:
        for side in sides:
            for finger, tip in (("index", "index_tip"), ("little", "pinky_tip")):
                wrist = skeleton.index[names[f"{side}_wrist"]]
                root = _finger_root(skeleton, skeleton.index[names[f"{side}_{tip}"]], wrist)
                roles[f"{side}_{finger}_root"] = skeleton.joints[root]
    return SearchJoints(tuple(roles), tuple(roles.values()), gesture)


def _finger_root(skeleton: Skeleton, tip: int, wrist: int) -> int:
    """The knuckle of a finger: its joint number 1 where joints are numbered, or its first.

    Skeletons with a metacarpal bone have an unnumbered joint near the wrist, which the finger
    doesn't move.
    """
    chain = [tip]
    while skeleton.parents[chain[-1]] not in (wrist, -1):
        chain.append(skeleton.parents[chain[-1]])
    numbered = [joint for joint in chain if skeleton.joints[joint].endswith("1")]
    return numbered[-1] if numbered else chain[-1]
