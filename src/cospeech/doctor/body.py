"""The evaluation joints as the doctor needs them: where they are, without turning the body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import CospeechError
from cospeech.motion.joint_map import (
    EVALUATION_JOINTS,
    JointBlend,
    bare_names,
    find_joint_map,
)
from cospeech.motion.motion import Motion

SPINE, NECK, NOSE, HEAD = range(4)
LEFT_ARM, RIGHT_ARM = (4, 5, 6), (7, 8, 9)
"""Shoulder, elbow and wrist among the evaluation joints."""

MEASURES: tuple[tuple[int, int, float], ...] = (
    (4, 5, 0.29),
    (5, 6, 0.26),
    (7, 8, 0.29),
    (8, 9, 0.26),
    (4, 7, 0.36),
    (0, 1, 0.27),
)
"""Joint, joint, and their distance in an average adult, m."""


@dataclass(frozen=True, eq=False)
class Body:
    """Points of the upper body over time.

    Attributes:
        points: ``(T, 10, 3)`` float64: the evaluation joints in the motion's own axes and units. A
            joint that the map places by a rotation is at the joint it is carried by.
        own: ``(10,)`` whether a point is not carried so.
        joints: Skeleton index of each point; None where it is blended of several.
        names: Names of the points for messages: the skeleton's joint where there is one.
        hips: Right and left hip, ``(T, 3)`` each; None where the map has none.
        scale: Size against an average adult; 1 for a person in metres.
    """

    points: NDArray[np.float64]
    own: NDArray[np.bool_]
    joints: tuple[int | None, ...]
    names: tuple[str, ...]
    hips: tuple[NDArray[np.float64], NDArray[np.float64]] | None
    scale: float


def find_body(motion: Motion) -> Body | None:
    """The upper body of a motion; None where it has none (2-D, or no joint map fits).

    Args:
        motion: Three-dimensional and finite.
    """
    if motion.dimensions != 3 or len(motion) == 0:
        return None
    try:
        joint_map = find_joint_map(motion.skeleton)
    except CospeechError:
        return None
    index = bare_names(motion.skeleton)
    if not joint_map.required <= index.keys():
        return None
    points = np.empty((len(motion), len(EVALUATION_JOINTS), 3))
    own = np.ones(len(EVALUATION_JOINTS), np.bool_)
    joints: list[int | None] = []
    for i, source in enumerate(joint_map.joints):
        if isinstance(source, JointBlend):
            weights = np.array([weight for _, weight in source.weights])
            parts = motion.positions[:, [index[joint] for joint, _ in source.weights]]
            points[:, i] = np.einsum("tjc,j->tc", parts, weights)
            joints.append(None)
        else:
            points[:, i] = motion.positions[:, index[source.joint]]
            own[i] = not any(source.offset)
            joints.append(index[source.joint])
    names = tuple(
        EVALUATION_JOINTS[i] if joint is None else motion.skeleton.joints[joint]
        for i, joint in enumerate(joints)
    )
    hips = None
    if joint_map.hips is not None:
        right, left = (motion.positions[:, index[hip]].astype(float) for hip in joint_map.hips)
        hips = (right, left)
    return Body(points, own, tuple(joints), names, hips, _scale(points))


def _scale(points: NDArray[np.float64]) -> float:
    sizes = [
        np.median(np.linalg.norm(points[:, a] - points[:, b], axis=-1)) / length
        for a, b, length in MEASURES
    ]
    return float(np.median(sizes))
