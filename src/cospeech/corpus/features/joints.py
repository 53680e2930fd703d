"""Joints as a person's body sees them, in the skeletons' own names or by role, and their labels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.field import MotionField
from cospeech.corpus.features.span_motion import SpanMotion
from cospeech.motion.gesture_joints import gesture_joints
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.motion.velocities import wrists

HEAD_ROLES = ("nose", "head")
"""What a pose holds beside the gesturing joints, so that the evaluation's joints are complete."""

UNLABELLED = -1
"""The phase of a frame that nobody annotated."""

_METRES = "metres, relative to the pelvis, facing +z"


def gesture_roles(skeleton: Skeleton) -> tuple[str, ...]:
    """Roles of the gesturing joints.

    Raises:
        CospeechError: No joint map fits (`gesture_joints`).
    """
    return gesture_joints(skeleton).roles


def pose_roles(skeleton: Skeleton) -> tuple[str, ...]:
    """Roles of a pose's joints: the gesturing joints, then nose and head.

    Raises:
        CospeechError: No joint map fits (`gesture_joints`).
    """
    return (*gesture_roles(skeleton), *HEAD_ROLES)


def _joints(motion: SpanMotion) -> NDArray[np.float32]:
    return motion.joints(gesture_joints(motion.motion.skeleton).body)


def _poses(motion: SpanMotion) -> NDArray[np.float32]:
    gesture, upper = _joints(motion), motion.upper_body()
    neck, *head = (UPPER_BODY.index[name] for name in ("neck", *HEAD_ROLES))
    offsets = motion.between(upper[:, head] - upper[:, [neck]])
    own_neck = gesture_roles(motion.motion.skeleton).index("neck")
    return np.concatenate([gesture, gesture[:, own_neck, None] + offsets], axis=1)


def _wrists(motion: SpanMotion) -> NDArray[np.float32]:
    return motion.joints(wrists(motion.motion.skeleton))


def _phases(motion: SpanMotion) -> NDArray[np.int8]:
    labels = motion.phases()
    return np.full(motion.frames, UNLABELLED, dtype=np.int8) if labels is None else labels


JOINTS = MotionField(
    name="joints",
    reads="upper body",
    width=None,
    unit=_METRES,
    of_motion=_joints,
    roles=gesture_roles,
)
POSES = MotionField(
    name="poses", reads="upper body", width=None, unit=_METRES, of_motion=_poses, roles=pose_roles
)
WRISTS = MotionField(
    name="wrists",
    reads="motion",
    width=6,
    unit="metres, relative to the spine, facing +z",
    of_motion=_wrists,
)
PHASES = MotionField(
    name="phases",
    reads="phases",
    unit="index into cospeech.motion.phases.PHASES, -1 where nobody annotated",
    dtype=np.int64,
    of_motion=_phases,
)
