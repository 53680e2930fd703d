"""Writing BVH files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import CospeechError
from cospeech.files import replacing
from cospeech.motion.kinematics import local_translations, quaternion_to_euler, world_rotations
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton

_ROWS_PER_BLOCK = 512


def write_bvh(
    path: str | Path, motion: Motion, *, rotation_order: str = "ZXY", unit_scale: float = 0.01
) -> Path:
    """Write a motion as BVH.

    The root has position and rotation channels, other joints rotations alone, except that a joint
    whose distance from its parent changes over time gets position channels too, so that nothing is
    lost. Joints are written depth first, as the format wants it. The file appears when it is
    complete: a failed write leaves what was there before.

    Args:
        path: The file; missing folders are made.
        motion: With ``rotations_local`` and a skeleton with offsets.
        rotation_order: Order of the rotation channels, intrinsic.
        unit_scale: Metres per file unit; 0.01 writes centimetres.

    Returns:
        The path written.

    Raises:
        CospeechError: The motion has positions only, is empty, has NaN, or its skeleton has several
            roots; or the file can't be written.
    """
    path = Path(path)
    skeleton = motion.skeleton
    rotations, offsets = motion.rotations_local, skeleton.offsets
    if rotations is None or offsets is None:
        raise CospeechError(
            f"can't write {path}: the motion on skeleton {skeleton.name} has no joint rotations or"
            " rest offsets, and BVH stores rotations",
            hint="solve rotations for the positions first",
        )
    if len(motion) == 0 or motion.first_bad_frame() is not None or not np.isfinite(rotations).all():
        raise CospeechError(f"can't write {path}: the motion is empty or has NaN")
    if sum(parent < 0 for parent in skeleton.parents) != 1:
        raise CospeechError(f"can't write {path}: a BVH file has one root joint")
    translations = local_translations(
        skeleton.parents, motion.positions, world_rotations(skeleton.parents, rotations)
    )
    order = _depth_first(skeleton)
    ends = [joint for joint in range(len(skeleton)) if _is_end(skeleton, joint)]
    moving = _moving(motion, translations, offsets) - set(ends)
    header = _header(skeleton, offsets / unit_scale, order, moving, rotation_order)
    columns: list[NDArray[np.float64]] = []
    posed = [joint for joint in order if joint not in ends]
    angles = np.degrees(quaternion_to_euler(rotations[:, posed], rotation_order))
    for i, joint in enumerate(posed):
        if joint in moving:
            columns.append(translations[:, joint] / unit_scale)
        columns.append(angles[:, i])
    head = f"{header}MOTION\nFrames: {len(motion)}\nFrame Time: {1 / motion.fps:.9f}\n"
    _write(path, head, np.concatenate(columns, axis=1))
    return path


def _is_end(skeleton: Skeleton, joint: int) -> bool:
    return skeleton.joints[joint] in skeleton.end_sites and joint not in skeleton.parents


def _depth_first(skeleton: Skeleton) -> list[int]:
    children: dict[int, list[int]] = {}
    for joint, parent in enumerate(skeleton.parents):
        children.setdefault(parent, []).append(joint)
    order: list[int] = []
    stack = children[-1][::-1]
    while stack:
        joint = stack.pop()
        order.append(joint)
        stack.extend(reversed(children.get(joint, [])))
    return order


def _moving(
    motion: Motion, translations: NDArray[np.float64], offsets: NDArray[np.float64]
) -> set[int]:
    """Joints whose place on their parent is not the rest offset, and the root."""
    # float32 positions far from the origin are only exact to a few units in the last place
    tolerance = 1e-5 + 8 * np.finfo(np.float32).eps * float(np.abs(motion.positions).max())
    changed = np.abs(translations - offsets).max(axis=(0, 2)) > tolerance
    return set(np.flatnonzero(changed).tolist()) | {motion.skeleton.parents.index(-1)}


def _header(
    skeleton: Skeleton,
    offsets: NDArray[np.float64],
    order: list[int],
    moving: set[int],
    rotation_order: str,
) -> str:
    turns = " ".join(f"{letter}rotation" for letter in rotation_order)
    lines = ["HIERARCHY"]
    open_joints: list[int] = []

    def close_down_to(parent: int) -> None:
        while open_joints and open_joints[-1] != parent:
            open_joints.pop()
            lines.append("\t" * len(open_joints) + "}")

    for joint in order:
        parent = skeleton.parents[joint]
        close_down_to(parent)
        indent = "\t" * len(open_joints)
        end = _is_end(skeleton, joint)
        kind = (
            "End Site" if end else ("JOINT " if parent >= 0 else "ROOT ") + skeleton.joints[joint]
        )
        lines.append(f"{indent}{kind}")
        lines.append(f"{indent}{{")
        lines.append(f"{indent}\tOFFSET " + " ".join(f"{value:.6f}" for value in offsets[joint]))
        if joint in moving:
            lines.append(f"{indent}\tCHANNELS 6 Xposition Yposition Zposition {turns}")
        elif not end:
            lines.append(f"{indent}\tCHANNELS 3 {turns}")
        open_joints.append(joint)
    close_down_to(-1)
    return "\n".join(lines) + "\n"


def _write(path: Path, head: str, values: NDArray[np.float64]) -> None:
    row = " ".join(["%.6f"] * values.shape[1]) + "\n"
    with (
        replacing(path) as temporary,
        temporary.open("w", encoding="utf-8", newline="\n") as file,
    ):
        file.write(head)
        for start in range(0, len(values), _ROWS_PER_BLOCK):
            block = values[start : start + _ROWS_PER_BLOCK]
            file.write(row * len(block) % tuple(block.ravel().tolist()))
