"""Positions of gesturing joints as offsets from their parents."""

from __future__ import annotations

import re
from collections.abc import Sequence

import torch
from torch import Tensor

from cospeech.errors import CospeechError

_SPINE = re.compile(r"spine_(\d+)")
_ARM = re.compile(r"(left|right)_(?:(shoulder|elbow|wrist)|\w+_tip)")
_PARENT_ON_ARM = {"shoulder": "neck", "elbow": "shoulder", "wrist": "elbow", None: "wrist"}


def parents_of(roles: Sequence[str]) -> tuple[int, ...]:
    """The parent of each joint, -1 for the root: the spine's lowest joint.

    The tree is that of `GestureJoints.bones`, with ``nose`` and ``head`` on the neck. It is found
    by the roles' names alone, as that is what a checkpoint keeps.

    Args:
        roles: Roles of gesturing joints (`cospeech.motion.gesture_joints`), and perhaps ``nose``
            and ``head``, in any order.

    Raises:
        CospeechError: A role that has no place in the tree, or whose parent is missing.
    """
    index = {role: i for i, role in enumerate(roles)}
    numbers = sorted(int(found[1]) for role in roles if (found := _SPINE.fullmatch(role)))
    spine = [*(f"spine_{number}" for number in numbers), "neck"]
    parents = []
    for role in roles:
        if role == spine[0]:
            parents.append(-1)
            continue
        if role in spine:
            parent = spine[spine.index(role) - 1]
        elif role in ("nose", "head"):
            parent = "neck"
        elif found := _ARM.fullmatch(role):
            above = _PARENT_ON_ARM[found[2]]
            parent = above if above == "neck" else f"{found[1]}_{above}"
        else:
            raise CospeechError(f"joint {role!r} has no place in the tree of gesturing joints")
        if parent not in index:
            raise CospeechError(f"joint {role!r} has no parent {parent!r} among {', '.join(roles)}")
        parents.append(index[parent])
    return tuple(parents)


class ParentRelative:
    """Between positions and offsets from each joint's parent.

    The root keeps its position, which is relative to the pelvis. Bone lengths are free.

    Args:
        roles: See `parents_of`.

    Raises:
        CospeechError: See `parents_of`.
    """

    def __init__(self, roles: Sequence[str]) -> None:
        self.roles = tuple(roles)
        self.parents = parents_of(roles)
        # Parents come before their children, however the roles are ordered.
        self._order = sorted(range(len(roles)), key=self._depth)

    def _depth(self, joint: int) -> int:
        parent = self.parents[joint]
        return 0 if parent < 0 else 1 + self._depth(parent)

    def to_offsets(self, positions: Tensor) -> Tensor:
        """Each joint less its parent: ``(..., J, 3)`` of positions ``(..., J, 3)``."""
        origin = torch.zeros_like(positions[..., :1, :])
        # Index -1 is the origin's, which is what the root hangs on.
        return positions - torch.cat([positions, origin], dim=-2)[..., list(self.parents), :]

    def to_positions(self, offsets: Tensor) -> Tensor:
        """The positions of `to_offsets`: sums along the bones from the root, ``(..., J, 3)``."""
        joints = list(offsets.unbind(-2))
        for joint in self._order[1:]:
            joints[joint] = joints[joint] + joints[self.parents[joint]]
        return torch.stack(joints, dim=-2)
