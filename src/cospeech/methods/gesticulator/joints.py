"""The joints whose rotations Gesticulator makes, found on any skeleton with a joint map."""

from __future__ import annotations

from cospeech.motion.gesture_joints import gesture_joints
from cospeech.motion.joint_map import EVALUATION_JOINTS, JointSource, bare_names, find_joint_map
from cospeech.motion.skeleton import Skeleton

JOINTS = (
    *("LeftHand", "LeftForeArm", "LeftArm", "LeftShoulder"),
    *("RightHand", "RightForeArm", "RightArm", "RightShoulder"),
    *("Head", "Neck1", "Neck", "Spine3", "Spine2", "Spine1", "Spine"),
)
"""As the Trinity skeleton calls them, in the published order of channels."""

_ROLES = {
    **{
        f"{name}{joint}": f"{side}_{role}"
        for side, name in (("left", "Left"), ("right", "Right"))
        for joint, role in (("Arm", "shoulder"), ("ForeArm", "elbow"), ("Hand", "wrist"))
    },
    "Neck": "neck",
    "Spine": "spine_0",
    "Spine1": "spine_1",
    "Spine2": "spine_2",
    "Spine3": "spine_3",
}
_ARMS = frozenset(joint for joint, role in _ROLES.items() if role.startswith(("left", "right")))


def joints_of(skeleton: Skeleton) -> tuple[str | None, ...]:
    """What a skeleton calls each of `JOINTS`; None for one that it lacks.

    A skeleton that calls the arms' joints as Trinity does is taken at its names, prefixes apart.
    Of another one the joint map says where the arms, the neck and the head are; what lies between
    them is the rest: shoulder blades from the trunk to the arms, the spine from the pelvis to the
    neck, a second neck joint before the head. Of several the blade is the one nearest the trunk and
    the second neck joint the one nearest the neck, as in a chain that is followed outwards.

    Raises:
        CospeechError: It has other names and no joint map fits, or the map puts a joint of the arms
            between others.
    """
    names = bare_names(skeleton)
    found = {joint: joint for joint in JOINTS if joint in names}
    if not found.keys() >= _ARMS:
        found = _by_role(skeleton, names)
    return tuple(found.get(joint) for joint in JOINTS)


def _by_role(skeleton: Skeleton, names: dict[str, int]) -> dict[str, str]:
    gesturing = gesture_joints(skeleton)
    named = dict(zip(gesturing.roles, gesturing.body.joints, strict=True))
    found = {joint: named[role] for joint, role in _ROLES.items() if role in named}
    neck = _line(skeleton, skeleton.index[named["neck"]])
    for side in ("Left", "Right"):
        arm = skeleton.index[found[f"{side}Arm"]]
        above = [joint for joint in _line(skeleton, arm) if joint not in neck]
        if len(above) > 1:
            found[f"{side}Shoulder"] = skeleton.joints[above[-1]]
    head = _head(skeleton, names)
    if head is not None and neck[0] in (line := _line(skeleton, head)):
        found["Head"] = skeleton.joints[head]
        between = line[1 : line.index(neck[0])]
        if between:
            found["Neck1"] = skeleton.joints[between[-1]]
    return found


def _head(skeleton: Skeleton, names: dict[str, int]) -> int | None:
    """The joint that nose or crown are fixed to."""
    joint_map = find_joint_map(skeleton)
    for role in ("nose", "head"):
        source = joint_map.joints[EVALUATION_JOINTS.index(role)]
        if isinstance(source, JointSource) and any(source.offset):
            return names[source.joint]
    return None


def _line(skeleton: Skeleton, joint: int) -> list[int]:
    """The joint itself, its parent, and so on to the root."""
    line = [joint]
    while skeleton.parents[line[-1]] >= 0:
        line.append(skeleton.parents[line[-1]])
    return line
