"""The joints that gesture: arms, finger tips and spine, found on any skeleton with a joint map.

Ferstl et al. 2020 (section 3) use shoulder, elbow, wrist and five finger tips of each side, and
five joints of the spine: 16 joints for the classifier and the displacements, 21 for the motion.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from cospeech.errors import CospeechError
from cospeech.motion.joint_map import EVALUATION_JOINTS, bare_names, find_joint_map
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.velocities import BodyJoints

FINGERS = ("thumb", "index", "middle", "ring", "pinky")
SPINE_JOINTS = 5
_SIDES = ("left", "right")
_FINGER_NAMES = {"pinky": "pinky|little"} | {name: name for name in FINGERS[:-1]}


@dataclass(frozen=True)
class GestureJoints:
    """Where the gesturing joints are on one skeleton.

    Attributes:
        roles: What each joint is: ``left_shoulder``, ``left_elbow``, ``left_wrist``,
            ``left_thumb_tip`` ..., the same on the right, then ``spine_0`` ... ``neck``.
        body: The joints in the order of ``roles``, and the body frame they are seen in.
        evaluation_spine: Index of the joint that is the spine of the evaluation space.
    """

    roles: tuple[str, ...]
    body: BodyJoints
    evaluation_spine: int

    @cached_property
    def arms(self) -> tuple[int, ...]:
        """Indices of the arms' joints, finger tips included (the paper's 16)."""
        return tuple(i for i, role in enumerate(self.roles) if role.startswith(_SIDES))

    @cached_property
    def finger_tips(self) -> tuple[tuple[int, int], ...]:
        """(finger tip, its wrist) index pairs; empty without fingers."""
        index = {role: i for i, role in enumerate(self.roles)}
        return tuple(
            (i, index[f"{role.split('_')[0]}_wrist"])
            for i, role in enumerate(self.roles)
            if role.endswith("_tip")
        )

    @cached_property
    def bones(self) -> tuple[tuple[int, int], ...]:
        """(parent, child) index pairs of a tree over the joints, for drawing and bone lengths."""
        index = {role: i for i, role in enumerate(self.roles)}
        spine = [i for i, role in enumerate(self.roles) if not role.startswith(_SIDES)]
        bones = list(pairwise(spine))
        for side in _SIDES:
            chain = [index["neck"], *(index[f"{side}_{joint}"] for joint in _ARM)]
            bones += pairwise(chain)
        return (*bones, *((wrist, tip) for tip, wrist in self.finger_tips))


_ARM = ("shoulder", "elbow", "wrist")


def gesture_joints(skeleton: Skeleton) -> GestureJoints:
    """Find the gesturing joints of a skeleton.

    Without fingers the set is smaller and has no ``tip``. A spine of fewer than five joints gives
    those it has.

    Raises:
        CospeechError: No joint map fits, or it puts a shoulder, elbow, wrist, spine or neck between
            joints.
    """
    joint_map = find_joint_map(skeleton)
    names = bare_names(skeleton)

    def single(role: str) -> int:
        needed = joint_map.joints[EVALUATION_JOINTS.index(role)].needed
        if len(needed) != 1:
            raise CospeechError(f"joint map {joint_map.name} has no single joint for {role}")
        return names[needed[0]]

    chosen: dict[str, int] = {}
    for side in _SIDES:
        for joint in _ARM:
            chosen[f"{side}_{joint}"] = single(f"{side}_{joint}")
        tips = _finger_tips(skeleton, chosen[f"{side}_wrist"])
        chosen |= {f"{side}_{finger}_tip": tip for finger, tip in tips.items()}
    spine, neck = single("spine"), single("neck")
    reference = _pelvis(skeleton, joint_map.hips, names)
    chain = _spine(skeleton, spine, neck, reference)
    chosen |= {f"spine_{i}": joint for i, joint in enumerate(chain[:-1])} | {"neck": neck}
    return GestureJoints(
        roles=tuple(chosen),
        body=BodyJoints(
            tuple(skeleton.joints[joint] for joint in chosen.values()),
            skeleton.joints[spine if reference is None else reference],
            joint_map.hips,
        ),
        evaluation_spine=list(chosen.values()).index(spine),
    )


def _ancestors(skeleton: Skeleton, joint: int) -> list[int]:
    """The joint itself, its parent, and so on to the root."""
    line = [joint]
    while skeleton.parents[line[-1]] >= 0:
        line.append(skeleton.parents[line[-1]])
    return line


def _pelvis(skeleton: Skeleton, hips: tuple[str, str] | None, names: dict[str, int]) -> int | None:
    """The joint that both hips hang on; None without hips."""
    if hips is None:
        return None
    right, left = (_ancestors(skeleton, names[hip]) for hip in hips)
    return next(joint for joint in right[1:] if joint in left)


def _spine(skeleton: Skeleton, spine: int, neck: int, pelvis: int | None) -> list[int]:
    """Up to five joints from above the pelvis to the neck, the evaluation's spine among them."""
    line = _ancestors(skeleton, neck)
    if spine not in line:
        return [spine, neck]
    end = line.index(pelvis) if pelvis in line else line.index(spine) + 1
    chain = line[: max(end, line.index(spine) + 1)][::-1]
    if len(chain) > SPINE_JOINTS:
        kept = {0, chain.index(spine), len(chain) - 1}
        for i in np.linspace(0, len(chain) - 1, SPINE_JOINTS).round().astype(int):
            if len(kept) < SPINE_JOINTS:
                kept.add(int(i))
        chain = [chain[i] for i in sorted(kept)]
    return chain


def _finger_tips(skeleton: Skeleton, wrist: int) -> dict[str, int]:
    """The last joint of each finger, end sites included; empty unless all five are there."""
    depth = [len(_ancestors(skeleton, joint)) for joint in range(len(skeleton))]
    below = [j for j in range(len(skeleton)) if wrist in _ancestors(skeleton, j)[1:]]
    tips = {}
    for finger in FINGERS:
        pattern = re.compile(_FINGER_NAMES[finger], re.IGNORECASE)
        joints = [j for j in below if pattern.search(skeleton.joints[j])]
        if not joints:
            return {}
        tips[finger] = max(joints, key=lambda joint: depth[joint])
    return tips
