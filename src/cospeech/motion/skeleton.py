"""Joint hierarchies."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cospeech.motion.joint_map_values import JointMap


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A named joint hierarchy, parents before children.

    Attributes:
        name: What the skeleton is called in manifests and messages.
        joints: Joint names.
        parents: Index of each joint's parent; -1 for a root.
        offsets: Rest offset of each joint from its parent, metres, house axes, shape ``(J, 3)``;
            None where only positions are known.
        end_sites: Joints that carry no rotation of their own (BVH end sites).
        joint_map: Where the evaluation joints are, as it was chosen when the motion was read; None
            where it is found by the joints' names (`cospeech.motion.joint_map.find_joint_map`).

    Raises:
        ValueError: Names repeat, a parent comes after its child, or the shapes disagree.
    """

    name: str
    joints: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: NDArray[np.float64] | None = None
    end_sites: frozenset[str] = frozenset()
    joint_map: JointMap | None = None

    def __post_init__(self) -> None:
        if len(set(self.joints)) != len(self.joints):
            repeated = sorted({name for name in self.joints if self.joints.count(name) > 1})
            raise ValueError(f"skeleton {self.name}: repeated joint names {repeated}")
        if len(self.parents) != len(self.joints):
            raise ValueError(
                f"skeleton {self.name}: {len(self.parents)} parents, {len(self.joints)} joints"
            )
        if any(parent >= child or parent < -1 for child, parent in enumerate(self.parents)):
            raise ValueError(f"skeleton {self.name}: a parent must come before its children")
        if self.offsets is not None and self.offsets.shape != (len(self.joints), 3):
            raise ValueError(f"skeleton {self.name}: offsets of shape {self.offsets.shape}")

    def __len__(self) -> int:
        return len(self.joints)

    @cached_property
    def index(self) -> dict[str, int]:
        """Joint name -> index."""
        return {joint: i for i, joint in enumerate(self.joints)}

    @property
    def bones(self) -> tuple[tuple[int, int], ...]:
        """(parent, child) index pairs, in joint order."""
        return tuple((parent, child) for child, parent in enumerate(self.parents) if parent >= 0)

    @cached_property
    def mirror_pairs(self) -> tuple[tuple[int, int], ...]:
        """(left, right) index pairs of joints whose names differ only in the side."""
        pairs = []
        for i, joint in enumerate(self.joints):
            for left, right in (("Left", "Right"), ("left", "right"), ("L_", "R_"), ("l_", "r_")):
                other = joint.replace(left, right, 1)
                if left in joint and other in self.index:
                    pairs.append((i, self.index[other]))
                    break
        return tuple(pairs)

    def to_dict(self) -> dict[str, object]:
        """Plain values for a JSON manifest; `from_dict` reads them back."""
        return {
            "name": self.name,
            "joints": list(self.joints),
            "parents": list(self.parents),
            "offsets": None if self.offsets is None else self.offsets.tolist(),
            "end_sites": sorted(self.end_sites),
            "joint_map": None if self.joint_map is None else self.joint_map.to_dict(),
        }

    @classmethod
    def from_dict(cls, values: dict) -> Skeleton:
        """The skeleton that `to_dict` wrote.

        Raises:
            InputFileError: Its joint map is none.
        """
        offsets, joint_map = values["offsets"], values.get("joint_map")
        return cls(
            name=values["name"],
            joints=tuple(values["joints"]),
            parents=tuple(values["parents"]),
            offsets=None if offsets is None else np.asarray(offsets, dtype=np.float64),
            end_sites=frozenset(values["end_sites"]),
            joint_map=None if joint_map is None else JointMap.from_dict(joint_map),
        )
