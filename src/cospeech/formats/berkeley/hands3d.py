"""The 55 joints of the 3-D extension: 13 of the body, 21 of each hand."""

from __future__ import annotations

import numpy as np

from cospeech.motion.skeleton import Skeleton

_BODY_PARENTS = {
    "head_top": "neck",
    "neck": "spine",
    "r_shoulder": "neck",
    "r_elbow": "r_shoulder",
    "r_wrist": "r_elbow",
    "l_shoulder": "neck",
    "l_elbow": "l_shoulder",
    "l_wrist": "l_elbow",
    "r_hip": "pelvis",
    "l_hip": "pelvis",
    "pelvis": None,
    "spine": "pelvis",
    "head": "neck",
}
# Little before ring, and all finger tips at the end of the hand: as published.
_FINGERS = ("index", "middle", "little", "ring", "thumb")


def _hand(side: str) -> dict[str, str | None]:
    parents: dict[str, str | None] = {f"{side}_hand": f"{side}_wrist"}
    for finger in _FINGERS:
        parents[f"{side}_{finger}0"] = f"{side}_hand"
        parents[f"{side}_{finger}1"] = f"{side}_{finger}0"
        parents[f"{side}_{finger}2"] = f"{side}_{finger}1"
    return parents | {f"{side}_{finger}3": f"{side}_{finger}2" for finger in _FINGERS}


_PARENTS = _BODY_PARENTS | _hand("r") | _hand("l")

FILE_JOINTS = tuple(_PARENTS)
"""Joint names in the order of the files. A hand's root, its own parent there, hangs on the wrist
here: both are one point."""


def _parents_first() -> list[str]:
    order: list[str] = []
    waiting = list(FILE_JOINTS)
    while waiting:
        ready = [joint for joint in waiting if (_PARENTS[joint] or joint) in (joint, *order)]
        order.append(ready[0])
        waiting.remove(ready[0])
    return order


_ORDER = _parents_first()

FILE_INDEX = np.array([FILE_JOINTS.index(joint) for joint in _ORDER])
"""``(55,)``: where each joint of `BERKELEY_3D` is in the files."""

BERKELEY_3D = Skeleton(
    name="berkeley3d",
    joints=tuple(_ORDER),
    parents=tuple(
        -1 if (parent := _PARENTS[joint]) is None else _ORDER.index(parent) for joint in _ORDER
    ),
)
"""The joints, parents before children; the pelvis is the root."""
