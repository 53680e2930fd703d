"""The whole skeleton as it was recorded: every joint's rotation, and where the root is."""

from __future__ import annotations

from cospeech.corpus.features.field import MotionField
from cospeech.corpus.features.span_motion import SpanMotion
from cospeech.motion.skeleton import Skeleton


def _joint_names(skeleton: Skeleton) -> tuple[str, ...]:
    return tuple(skeleton.joints)


ROTATIONS = MotionField(
    name="rotations",
    reads="rotations",
    width=None,
    unit="unit quaternions (x, y, z, w) of each joint of the skeleton relative to its parent",
    of_motion=SpanMotion.rotations,
    roles=_joint_names,
)
ROOT = MotionField(
    name="root",
    reads="motion",
    width=3,
    unit="metres in the world, of the skeleton's first joint",
    of_motion=SpanMotion.root,
)
