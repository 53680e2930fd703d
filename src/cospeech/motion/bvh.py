"""BVH files: reading and writing.

A BVH file's convention differs from the house's: centimetres, degrees, and Euler angles in the
order of each joint's channels (intrinsic: ``Zrotation Xrotation Yrotation`` is Rz Rx Ry). Position
channels hold the joint's offset from its parent and so replace the OFFSET of the header.
Most files are y up; a rest pose that faces +z with the left arm at +x is in house axes already.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Literal, TextIO

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import InputFileError
from cospeech.motion.bvh_hierarchy import Hierarchy, parse_hierarchy
from cospeech.motion.bvh_rate import checked_rate
from cospeech.motion.bvh_rows import MAX_HEADER_BYTES, Rows, decoded, opened
from cospeech.motion.bvh_writer import write_bvh
from cospeech.motion.kinematics import (
    euler_to_quaternion,
    forward_kinematics,
    multiply_quaternions,
    skeleton_positions,
)
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton

__all__ = [
    "UP_AXES",
    "UpAxis",
    "read_bvh",
    "read_bvh_skeleton",
    "read_bvh_timing",
    "write_bvh",
]

UpAxis = Literal["y", "z"]
UP_AXES: tuple[UpAxis, ...] = ("y", "z")
"""Axes that point up in files that are read."""

MAX_JOINT_FRAMES = 30_000_000
"""Each becomes 28 bytes of positions and rotations: 0.84 GB."""

FREE_JOINT_FRAMES = 2_000_000
"""Joint-frames (56 MB) that a file may make of joints which its rows don't move."""

MAX_JOINT_FRAMES_PER_NUMBER = 2
"""Of a longer one: most people have three numbers a joint, and an end site at every third joint."""

MAX_DISTANCE_M = 1e6
"""Squares of what is further away would not be numbers any more further on."""

SAME_OFFSET_M = 1e-6
"""Position channels that stay so close to a joint's OFFSET say the same as it does."""

POSED_AT_ONCE = 2**18
"""Joint-frames whose kinematics, some 220 bytes each, are in memory together."""

_MOTION = re.compile(rb"^[ \t]*MOTION[ \t\r]*$", re.IGNORECASE | re.MULTILINE)
_FRAMES = re.compile(rb"\s*Frames[ \t]*:?[ \t]*([^\s]+)", re.IGNORECASE)
_FRAME_TIME = re.compile(rb"\s*Frame[ \t]*Time[ \t]*:?[ \t]*([^\s]+)", re.IGNORECASE)
_log = logging.getLogger(__name__)


def read_bvh(
    source: str | Path | TextIO,
    *,
    frame_rate: float | None = None,
    unit_scale: float = 0.01,
    up_axis: UpAxis = "y",
    warn: Callable[[str], object] = _log.warning,
) -> Motion:
    """Read a BVH file.

    Any channel order, 0 to 6 channels on any joint, and end sites in any spelling. End sites become
    joints (``skeleton.end_sites``), called ``<parent>_end`` where the file gives no name.

    A few rows more or fewer than the header says (`tolerated_rows`), and a last row that the file
    ends in the middle of, are no reason to refuse a take: they are told to ``warn``, once.

    Args:
        source: Path, or an open text file.
        frame_rate: Frames per second of the rows. With it the header's frame count and frame time
            are not looked at: this is the way to read a file whose header is wrong.
        unit_scale: Metres per file unit: 0.01 for centimetres, 0.0564444 for CMU's files.
        up_axis: The file's vertical. With ``"z"`` the motion is turned by -90 degrees about x,
            (x, y, z) to (x, z, -y), and the joints' own axes with it where the rest pose is z up.
        warn: Called with what was odd about a file that was read all the same.

    Returns:
        World positions and local rotations of every joint; ``skeleton.name`` is ``"bvh"``, and its
        offsets are what position channels put in their place, on average over the rows. Peak
        memory is that of the returned arrays, 28 bytes per joint and frame, and some 60 MB.

    Raises:
        InputFileError: The file is absent, not BVH, cut off, its header contradicts its rows, it
            claims more joints than its rows move, or a number is missing, not finite, or too large.
            The message names the line, or the frame and joint.
        ValueError: ``frame_rate``, ``unit_scale`` or ``up_axis`` is none.
    """
    if frame_rate is not None and not 0 < frame_rate < np.inf:
        raise ValueError(f"frame_rate must be positive, got {frame_rate}")
    if not 0 < unit_scale < np.inf:
        raise ValueError(f"unit_scale must be positive, got {unit_scale}")
    if up_axis not in UP_AXES:
        raise ValueError(f"up_axis must be one of {', '.join(UP_AXES)}, got {up_axis}")
    with opened(source) as text:
        path = text.path
        start = _motion_start(text.head, path)
        hierarchy = parse_hierarchy(decoded(text.head[:start]), path, unit_scale)
        skeleton = hierarchy.skeleton
        count, frame_time, rows_at = _motion_header(text.head, start, path)
        rows = Rows(text, rows_at, hierarchy, MAX_JOINT_FRAMES // len(skeleton))
        _refuse_empty_and_swollen(rows, hierarchy, path)
        positions = np.empty((rows.count, len(skeleton), 3), np.float32)
        rotations = np.empty((rows.count, len(skeleton), 4), np.float32)
        turn = None if up_axis == "y" else _Turn(skeleton)
        frame, total = 0, np.zeros((len(skeleton), 3))
        for values in _few_at_once(rows, len(skeleton)):
            translations, turns = _local_pose(hierarchy, values, unit_scale)
            if turn is not None:
                turn.apply(translations, turns)
            with np.errstate(all="ignore"):
                world, _ = forward_kinematics(skeleton.parents, translations, turns)
            near = np.abs(world) < MAX_DISTANCE_M
            if not near.all():
                raise _too_far(near, frame, skeleton, path)
            positions[frame : frame + len(values)] = world
            rotations[frame : frame + len(values)] = turns
            frame += len(values)
            total += translations.sum(axis=0)
        odd = []
        if frame_rate is None:
            frame_rate, about_header = checked_rate(count, frame_time, rows.count, path)
            odd += [about_header] if about_header else []
        if rows.cut_off is not None:
            numbers = f"{rows.cut_off} of {hierarchy.channel_count} numbers"
            odd.append(f"the last row is cut off ({numbers}) and left out")
    if odd:
        warn(f"{path.name}: {'; '.join(odd)}")
    if turn is not None:
        skeleton = turn.turned_skeleton()
    skeleton = _with_own_bones(skeleton, total / rows.count)
    return Motion(skeleton, frame_rate, positions, rotations)


def read_bvh_timing(
    source: str | Path | TextIO, frame_rate: float | None = None
) -> tuple[int, float]:
    """How many frames a BVH file has, and frames per second: as `read_bvh` has them.

    Args:
        source: Path, or an open text file.
        frame_rate: As for `read_bvh`.

    Raises:
        InputFileError: The file is absent, no BVH, without rows, or its header contradicts them.
    """
    with opened(source) as text:
        start = _motion_start(text.head, text.path)
        hierarchy = parse_hierarchy(decoded(text.head[:start]), text.path, 1.0)
        count, frame_time, rows_at = _motion_header(text.head, start, text.path)
        rows = Rows(text, rows_at, hierarchy, MAX_JOINT_FRAMES // len(hierarchy.skeleton))
        _refuse_empty_and_swollen(rows, hierarchy, text.path)
        if frame_rate is None:
            frame_rate, _ = checked_rate(count, frame_time, rows.count, text.path)
        return rows.count, frame_rate


def read_bvh_skeleton(source: str | Path | TextIO, *, unit_scale: float = 0.01) -> Skeleton:
    """The skeleton of a BVH file, which may have no frames.

    Args:
        source: Path, or an open text file.
        unit_scale: Metres per file unit.

    Raises:
        InputFileError: The file is absent or its hierarchy is broken.
    """
    with opened(source) as text:
        head = text.head[:MAX_HEADER_BYTES]
        match = _MOTION.search(head)
        hierarchy = decoded(head[: match.start()] if match else head)
        return parse_hierarchy(hierarchy, text.path, unit_scale).skeleton


def _motion_start(head: bytes, path: Path) -> int:
    match = _MOTION.search(head[:MAX_HEADER_BYTES])
    if match is None:
        # what comes before says more about a file that isn't BVH than "no MOTION" does
        parse_hierarchy(decoded(head[:MAX_HEADER_BYTES]), path, 1.0)
        raise InputFileError(
            path,
            "no MOTION line: the file has a skeleton but no frames",
            hint="use a file with frames, or read_bvh_skeleton for its skeleton",
        )
    return match.start()


def _motion_header(head: bytes, start: int, path: Path) -> tuple[bytes, bytes, int]:
    """Frame count and frame time as written, and where the rows start."""
    place = head.find(b"\n", start) + 1 or len(head)
    frames = _FRAMES.match(head, place)
    frame_time = _FRAME_TIME.match(head, frames.end()) if frames else None
    if frames is None or frame_time is None:
        line = head.count(b"\n", 0, place) + 1
        problem = (
            "the MOTION part is empty: the file has a skeleton but no frames"
            if not head[place : place + 4096].strip()
            else "after MOTION there must be 'Frames: N' and 'Frame Time: seconds'"
        )
        raise InputFileError(
            path,
            problem,
            place=f"line {line}",
            hint="use a file with frames, or read_bvh_skeleton for its skeleton",
        )
    return frames[1], frame_time[1], frame_time.end()


def _refuse_empty_and_swollen(rows: Rows, hierarchy: Hierarchy, path: Path) -> None:
    if not rows.count:
        raise InputFileError(
            path,
            "no rows of numbers follow 'Frame Time': the file has a skeleton but no frames",
            hint="use a file with frames, or read_bvh_skeleton for its skeleton",
        )
    joints = len(hierarchy.skeleton)
    size = f"{rows.count} frames of {joints} joints"
    if rows.count * joints > MAX_JOINT_FRAMES:
        raise InputFileError(
            path, f"{size} are more than fit into memory", hint="cut it into takes"
        )
    numbers = rows.count * hierarchy.channel_count
    if rows.count * joints > max(FREE_JOINT_FRAMES, MAX_JOINT_FRAMES_PER_NUMBER * numbers):
        raise InputFileError(
            path,
            f"{size} are more than its {numbers} numbers can move",
            hint="take joints without CHANNELS out of the hierarchy",
        )


def _few_at_once(rows: Rows, joints: int) -> Iterator[NDArray[np.float64]]:
    step = max(1, POSED_AT_ONCE // joints)
    for values in rows.values():
        for first in range(0, len(values), step):
            yield values[first : first + step]


def _too_far(near: NDArray[np.bool_], frame: int, skeleton: Skeleton, path: Path) -> InputFileError:
    first, joint = np.argwhere(~near.all(axis=-1))[0]
    return InputFileError(
        path,
        f"the joint's position is too large ({MAX_DISTANCE_M:g} m or more from the origin)",
        place=f"frame {frame + first}, joint {skeleton.joints[joint]}",
        hint="repair the position channels of this row, or check the unit (data.unit_scale)",
    )


def _local_pose(
    hierarchy: Hierarchy, values: NDArray[np.float64], unit_scale: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Translations ``(T, J, 3)`` in metres and rotations ``(T, J, 4)``, both local."""
    offsets = hierarchy.skeleton.offsets
    assert offsets is not None
    frames, joints = len(values), len(hierarchy.skeleton)
    translations = np.tile(offsets, (frames, 1, 1))
    rotations = np.zeros((frames, joints, 4))
    rotations[..., 3] = 1.0
    columns_of_order: dict[str, tuple[list[int], list[list[int]]]] = {}
    column = 0
    for joint, channels in enumerate(hierarchy.channels):
        turns = []
        for channel in channels:
            if channel.endswith("position"):
                with np.errstate(over="ignore"):
                    metres = values[:, column] * unit_scale
                translations[:, joint, "XYZ".index(channel[0])] = metres
            else:
                turns.append(column)
            column += 1
        order = "".join(channel[0] for channel in channels if channel.endswith("rotation"))
        if order:
            members, columns = columns_of_order.setdefault(order, ([], []))
            members.append(joint)
            columns.append(turns)
    for order, (members, columns) in columns_of_order.items():
        rotations[:, members] = euler_to_quaternion(np.radians(values[:, columns]), order)
    return translations, rotations


def _with_own_bones(skeleton: Skeleton, translations: NDArray[np.float64]) -> Skeleton:
    """The skeleton with the offsets that its position channels have on average, but for roots."""
    assert skeleton.offsets is not None
    apart = np.abs(translations - skeleton.offsets).max(axis=1) > SAME_OFFSET_M
    apart &= np.asarray(skeleton.parents) >= 0
    if not apart.any():
        return skeleton
    return replace(skeleton, offsets=np.where(apart[:, None], translations, skeleton.offsets))


class _Turn:
    """From z up to y up, by -90 degrees about x.

    Where the skeleton itself is z up, every joint's own axes are turned, so that a joint's "up" is
    y in its rest pose, as joint maps expect. A skeleton that is y up, and lifted to z up by its
    root's rotation, keeps them.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        still = np.zeros((1, len(skeleton), 4))
        still[..., 3] = 1
        extent = np.ptp(skeleton_positions(skeleton, still)[0], axis=0)
        self._skeleton = skeleton
        self._joints = slice(None) if extent[2] > extent[1] else slice(0, 1)

    def apply(self, translations: NDArray[np.float64], rotations: NDArray[np.float64]) -> None:
        """Turn local translations ``(T, J, 3)`` and rotations ``(T, J, 4)`` in their place."""
        translations[:, self._joints] = _z_to_y(translations[:, self._joints])
        if self._joints == slice(None):
            # the axis of a rotation is turned as any vector is
            rotations[..., :3] = _z_to_y(rotations[..., :3])
        else:
            half = np.sqrt(0.5)
            turn = np.array([-half, 0.0, 0.0, half])
            rotations[:, 0] = multiply_quaternions(turn, rotations[:, 0])

    def turned_skeleton(self) -> Skeleton:
        """The skeleton with the offsets that go with the turned motion."""
        assert self._skeleton.offsets is not None
        offsets = self._skeleton.offsets.copy()
        offsets[self._joints] = _z_to_y(offsets[self._joints])
        return replace(self._skeleton, offsets=offsets)


def _z_to_y(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.stack([vectors[..., 0], vectors[..., 2], -vectors[..., 1]], axis=-1)
