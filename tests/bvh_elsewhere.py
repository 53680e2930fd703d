"""A BVH file as another program reads it: the hierarchy and positions that upc-pymotion finds."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from pymotion.io.bvh import BVH
from pymotion.ops.skeleton_np import fk_quat
from pymotion.rotations.quat_np import from_euler


class ReadElsewhere(NamedTuple):
    """Joints without end sites, their parents (-1: none), s per frame, positions in cm."""

    names: list[str]
    parents: list[int]
    frame_s: float
    positions_world: np.ndarray


def read_elsewhere(path: Path) -> ReadElsewhere:
    """Its reader and its forward kinematics; it wants "End Site" in this spelling."""
    theirs = BVH()
    theirs.load(str(path))
    data = theirs.data
    rotations = from_euler(  # scalar-first
        np.radians(data["rotations"]),
        order=np.broadcast_to(data["rot_order"], data["rotations"].shape),
    )
    positions, _ = fk_quat(
        rotations, data["positions"][:, 0], data["offsets"].astype(float), data["parents"]
    )
    parents = [-1, *data["parents"][1:].tolist()]  # its root is its own parent
    return ReadElsewhere(data["names"].tolist(), parents, data["frame_time"], positions)
