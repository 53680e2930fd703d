"""The ten evaluation joints and the way from any skeleton to them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import CospeechError
from cospeech.motion.joint_map import (
    EVALUATION_JOINTS,
    JointBlend,
    JointMap,
    JointSource,
    bare_names,
    find_joint_map,
    load_joint_map,
    refuse_missing_joints,
)
from cospeech.motion.kinematics import (
    heading_angles,
    rotate_vectors,
    turn_about_vertical,
    world_rotations,
)
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton

__all__ = [
    "EVALUATION_FPS",
    "EVALUATION_FRAMES",
    "EVALUATION_STRIDE",
    "MOVING_JOINTS",
    "TED_AXES",
    "UPPER_BODY",
    "JointBlend",
    "JointMap",
    "JointSource",
    "doubts_about",
    "find_joint_map",
    "load_joint_map",
    "to_upper_body",
]

EVALUATION_FRAMES = 34
"""Frames of a window in the evaluation space."""
EVALUATION_FPS = 15.0
"""Frames per second in the evaluation space."""
EVALUATION_STRIDE = 10
"""Frames from one evaluation window's start to the next."""

UPPER_BODY = Skeleton(
    name="upper_body",
    joints=EVALUATION_JOINTS,
    parents=(-1, 0, 1, 2, 1, 4, 5, 1, 7, 8),
)
"""The ten evaluation joints, in the order of the TED set (left arm first)."""

MOVING_JOINTS = tuple(j for j, parent in enumerate(UPPER_BODY.parents) if parent >= 0)
"""All of the ten but the root, which is the origin in every frame."""

TED_AXES = (-1.0, -1.0, 1.0)
"""Signs that take house axes to those of the TED set (x right, y down, z forward)."""


def to_upper_body(motion: Motion, joint_map: JointMap | None = None) -> Motion:
    """The ten evaluation joints of a motion, seen from the body.

    The spine joint is at the origin in every frame, and every frame is turned about the vertical so
    that the right-hip to left-hip direction, seen from above, points to +x: the body's travel and
    heading are gone, its lean is not. A point with an offset (a nose, where the skeleton has none)
    moves with its joint's rotation.

    Args:
        motion: Any skeleton that has a joint map, in house axes. One on `UPPER_BODY` has gone this
            way already and comes back as it is.
        joint_map: Where the ten joints are; by the skeleton (`find_joint_map`) when None.

    Returns:
        The same frames on `UPPER_BODY`: positions ``(T, 10, 3)`` float32, no rotations.

    Raises:
        CospeechError: The motion is two-dimensional, no map fits, the skeleton lacks a joint of the
            map, or the map needs a joint's rotation and the motion has positions only.
    """
    if motion.dimensions != 3:
        raise CospeechError("2-D keypoints have no 3-D upper body")
    if motion.skeleton is UPPER_BODY and joint_map is None:
        return motion
    if joint_map is None:
        joint_map = find_joint_map(motion.skeleton)
    names = bare_names(motion.skeleton)
    refuse_missing_joints(joint_map, motion.skeleton)
    points = _points(motion, joint_map, names)
    points -= points[:, :1].copy()
    if joint_map.hips is not None:
        right, left = (motion.positions[:, names[hip]] for hip in joint_map.hips)
        angles = heading_angles(right, left)
        if angles is None and len(motion):
            raise CospeechError(
                f"the hips {joint_map.hips[0]} and {joint_map.hips[1]} are never apart, so the"
                " body's heading is unknown",
                hint="name two other joints under 'hips' in the joint map",
            )
        if angles is not None:
            points = turn_about_vertical(points, angles)
    return Motion(UPPER_BODY, motion.fps, points.astype(np.float32))


def _points(motion: Motion, joint_map: JointMap, names: dict[str, int]) -> NDArray[np.float64]:
    points = np.empty((len(motion), len(EVALUATION_JOINTS), 3))
    for i, source in enumerate(joint_map.joints):
        if isinstance(source, JointBlend):
            blended = [
                w * motion.positions[:, names[joint]].astype(np.float64)
                for joint, w in source.weights
            ]
            points[:, i] = np.sum(blended, axis=0)
        else:
            points[:, i] = motion.positions[:, names[source.joint]]
    carried = {
        i: source
        for i, source in enumerate(joint_map.joints)
        if isinstance(source, JointSource) and any(source.offset)
    }
    if not carried:
        return points
    if motion.rotations_local is None:
        wanted = ", ".join(EVALUATION_JOINTS[i] for i in carried)
        raise CospeechError(
            f"joint map {joint_map.name} places {wanted} by a joint's rotation, and this motion has"
            " positions only",
            hint="use a map without offsets, or motion with rotations",
        )
    world = world_rotations(motion.skeleton.parents, motion.rotations_local)
    offsets = np.array([source.offset for source in carried.values()])
    turns = world[:, [names[source.joint] for source in carried.values()]]
    points[:, list(carried)] += rotate_vectors(turns, offsets)
    return points


def doubts_about(upper_body: Motion) -> list[str]:
    """What makes an upper body look wrongly scaled, turned or mirrored; empty when nothing does.

    Looks at the average pose: the head above the spine, the left shoulder to the left, the nose in
    front of the line from neck to head, and an upper arm of human length.

    Args:
        upper_body: On `UPPER_BODY`, in house axes.

    Returns:
        One sentence per doubt, each with the likely cause.
    """
    if len(upper_body) == 0:
        return []
    average = upper_body.positions.astype(np.float64).mean(axis=0)
    mean = dict(zip(EVALUATION_JOINTS, average, strict=True))
    doubts = []
    up = mean["head"] - mean["spine"]
    if up[1] < 0.7 * np.linalg.norm(up):
        doubts.append(
            "the head is not above the spine: the vertical may not be y (data.up_axis=z reads files"
            " whose vertical is z)"
        )
    elif (mean["left_shoulder"] - mean["right_shoulder"])[0] <= 0:
        doubts.append("the left shoulder is not on the left: left and right may be exchanged")
    elif (mean["nose"] - (mean["neck"] + mean["head"]) / 2)[2] <= 0:
        doubts.append("the nose is behind the head: the nose's offset or the hips may be wrong")
    arm = upper_body.positions[:, UPPER_BODY.index["left_elbow"]].astype(np.float64)
    arm = arm - upper_body.positions[:, UPPER_BODY.index["left_shoulder"]]
    length = float(np.linalg.norm(arm, axis=1).mean())
    if not 0.12 < length < 0.6:
        doubts.append(
            f"the upper arm is {length:.3g} m long, a person's about 0.3 m: set data.unit_scale,"
            " metres per unit of the BVH file (1 for metres, 0.01 for centimetres)"
        )
    return doubts
