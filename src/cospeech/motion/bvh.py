"""BVH files: reading and writing.

A BVH file's convention differs from the house's: centimetres, degrees, and Euler angles in the
order of each joint's channels (intrinsic: ``Zrotation Xrotation Yrotation`` is Rz Rx Ry). Position
channels hold the joint's offset from its parent and so replace the OFFSET of the header.
Both are y up; a rest pose that faces +z with the left arm at +x is in house axes already.
"""

from __future__ import annotations

import io
import os
import re
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import InputFileError
from cospeech.motion.bvh_hierarchy import Hierarchy, parse_hierarchy
from cospeech.motion.bvh_writer import write_bvh
from cospeech.motion.kinematics import euler_to_quaternion, forward_kinematics
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton

__all__ = ["read_bvh", "read_bvh_skeleton", "write_bvh"]

MAX_FILE_BYTES = 2**30
MAX_HEADER_BYTES = 2**22
MAX_JOINT_FRAMES = 50_000_000
_MOTION = re.compile(rb"^[ \t]*MOTION[ \t\r]*$", re.IGNORECASE | re.MULTILINE)
_FRAMES = re.compile(rb"\s*Frames[ \t]*:?[ \t]*([^\s]+)", re.IGNORECASE)
_FRAME_TIME = re.compile(rb"\s*Frame[ \t]*Time[ \t]*:?[ \t]*([^\s]+)", re.IGNORECASE)


def read_bvh(
    source: str | Path | TextIO, *, frame_rate: float | None = None, unit_scale: float = 0.01
) -> Motion:
    """Read a BVH file.

    Any channel order, 0 to 6 channels on any joint, and end sites in any spelling. End sites become
    joints (``skeleton.end_sites``), called ``<parent>_end`` where the file gives no name.

    Args:
        source: Path, or an open text file.
        frame_rate: Frames per second of the rows. With it the header's frame count and frame time
            are not looked at: this is the way to read a file whose header is wrong.
        unit_scale: Metres per file unit: 0.01 for centimetres, 0.0564444 for CMU's files.

    Returns:
        World positions and local rotations of every joint; ``skeleton.name`` is ``"bvh"``.

    Raises:
        InputFileError: The file is absent, not BVH, cut off, its header contradicts its rows, or a
            number is missing or not finite. The message names the line, and the frame and joint.
    """
    path, data = _load(source)
    start = _motion_start(data, path)
    hierarchy = parse_hierarchy(_text(data[:start]), path, unit_scale)
    count, frame_time, rows_at = _motion_header(data, start, path)
    values = _rows(data, rows_at, hierarchy, path)
    if frame_rate is None:
        frame_rate = _checked_rate(count, frame_time, len(values), path)
    elif not 0 < frame_rate < np.inf:
        raise ValueError(f"frame_rate must be positive, got {frame_rate}")
    translations, rotations = _local_pose(hierarchy, values, unit_scale)
    positions, _ = forward_kinematics(hierarchy.skeleton.parents, translations, rotations)
    with np.errstate(over="ignore"):
        motion = Motion(
            hierarchy.skeleton,
            frame_rate,
            positions.astype(np.float32),
            rotations.astype(np.float32),
        )
    bad = motion.first_bad_frame()
    if bad is not None:
        joint = int((~np.isfinite(motion.positions[bad])).any(axis=1).argmax())
        raise InputFileError(
            path,
            "the joint's position is too large to be a number",
            place=f"frame {bad}, joint {hierarchy.skeleton.joints[joint]}",
            hint="check unit_scale and the position channels of this row",
        )
    return motion


def read_bvh_skeleton(source: str | Path | TextIO, *, unit_scale: float = 0.01) -> Skeleton:
    """The skeleton of a BVH file, which may have no frames.

    Args:
        source: Path, or an open text file.
        unit_scale: Metres per file unit.

    Raises:
        InputFileError: The file is absent or its hierarchy is broken.
    """
    path, data = _load(source, MAX_HEADER_BYTES)
    match = _MOTION.search(data)
    return parse_hierarchy(
        _text(data[: match.start()] if match else data), path, unit_scale
    ).skeleton


def _load(source: str | Path | TextIO, head: int | None = None) -> tuple[Path, bytes]:
    """The file's bytes (its first ``head`` ones), refusing what is too big to be motion."""
    if isinstance(source, str | Path):
        path = Path(source)
        try:
            with path.open("rb") as file:
                size = os.fstat(file.fileno()).st_size
                data = file.read(MAX_FILE_BYTES + 1 if head is None else head)
        except OSError as error:
            raise InputFileError(
                path, f"can't be read ({error.strerror})", hint="check the path"
            ) from error
    else:
        path = Path(str(getattr(source, "name", "<text stream>")))
        data = source.read(MAX_FILE_BYTES + 1 if head is None else head).encode("utf-8", "replace")
        size = len(data)
    if size > MAX_FILE_BYTES:
        raise InputFileError(
            path,
            f"{size / 2**30:.1f} GiB is more than a BVH file may have here (1 GiB)",
            hint="cut it into takes",
        )
    data = data.removeprefix(b"\xef\xbb\xbf")
    return path, data if b"\n" in data else data.replace(b"\r", b"\n")


def _text(data: bytes) -> str:
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _motion_start(data: bytes, path: Path) -> int:
    match = _MOTION.search(data[:MAX_HEADER_BYTES])
    if match is None:
        # what comes before says more about a file that isn't BVH than "no MOTION" does
        parse_hierarchy(_text(data[:MAX_HEADER_BYTES]), path, 1.0)
        raise InputFileError(
            path,
            "no MOTION line: the file has a skeleton but no frames",
            hint="use a file with frames, or read_bvh_skeleton for its skeleton",
        )
    return match.start()


def _motion_header(data: bytes, start: int, path: Path) -> tuple[bytes, bytes, int]:
    """Frame count and frame time as written, and where the rows start."""
    place = data.find(b"\n", start) + 1 or len(data)
    frames = _FRAMES.match(data, place)
    frame_time = _FRAME_TIME.match(data, frames.end()) if frames else None
    if frames is None or frame_time is None:
        line = data.count(b"\n", 0, place) + 1
        problem = (
            "the MOTION part is empty: the file has a skeleton but no frames"
            if not data[place : place + 4096].strip()
            else "after MOTION there must be 'Frames: N' and 'Frame Time: seconds'"
        )
        raise InputFileError(
            path,
            problem,
            place=f"line {line}",
            hint="use a file with frames, or read_bvh_skeleton for its skeleton",
        )
    return frames[1], frame_time[1], frame_time.end()


def _rows(data: bytes, start: int, hierarchy: Hierarchy, path: Path) -> NDArray[np.float64]:
    columns = hierarchy.channel_count
    body = data[start:]
    if not body.strip():
        raise InputFileError(
            path,
            "no rows of numbers follow 'Frame Time': the file has a skeleton but no frames",
            hint="use a file with frames, or read_bvh_skeleton for its skeleton",
        )
    if (frames := body.strip().count(b"\n") + 1) * len(hierarchy.skeleton) > MAX_JOINT_FRAMES:
        raise InputFileError(
            path,
            f"{frames} frames of {len(hierarchy.skeleton)} joints are more than fit into memory",
            hint="cut it into takes",
        )
    try:
        values = np.loadtxt(io.BytesIO(body), comments=None, ndmin=2, encoding="latin-1")
    except ValueError:
        values = np.empty((0, 0))
    if values.shape[1] != columns or not np.isfinite(values).all():
        raise _row_error(data, start, hierarchy, path)
    return values


def _row_error(data: bytes, start: int, hierarchy: Hierarchy, path: Path) -> InputFileError:
    """The first thing wrong with the rows."""
    columns = hierarchy.channel_count
    first_line = data.count(b"\n", 0, start) + 1
    frame = 0
    for number, line in enumerate(io.BytesIO(data[start:]), start=first_line):
        words = line.split()
        for column, word in enumerate(words[:columns]):
            try:
                good = bool(np.isfinite(float(word)))
            except ValueError:
                good = False
            if not good:
                joint = hierarchy.joint_of_column(column)
                return InputFileError(
                    path,
                    f"{_text(word[:40])!r} in column {column + 1} is not a finite number",
                    place=f"line {number}, frame {frame}, joint {joint}",
                    hint="repair or cut out these frames: motion with gaps can't be used",
                )
        if words and len(words) != columns:
            return InputFileError(
                path,
                f"{len(words)} numbers where the hierarchy has {columns} channels",
                place=f"line {number}, frame {frame}",
                hint="if this is the last line, the file was cut off: remove the line",
            )
        frame += bool(words)
    return InputFileError(path, "the rows after 'Frame Time' are not plain numbers")


def _checked_rate(count: bytes, frame_time: bytes, rows: int, path: Path) -> float:
    """Frames per second by the header, when it agrees with the rows."""
    try:
        seconds = Decimal(_text(frame_time))
        rate = _frame_rate(seconds)
    except (InvalidOperation, ValueError, OverflowError):
        raise InputFileError(
            path,
            f"frame time {_text(frame_time[:40])!r} is not a duration in seconds",
            hint="give the rate of the rows: read_bvh(..., frame_rate=30), or data.frame_rate=30",
        ) from None
    if count.isdigit() and len(count) < 12 and int(count) == rows:
        return rate
    said = f"{int(count)} frames" if count.isdigit() and len(count) < 12 else _text(count[:40])
    hint = f"if the rows are at {rate:g} fps, pass frame_rate={rate:g} (data.frame_rate={rate:g})"
    if count.isdigit() and len(count) < 12 and not 0.99 < int(count) / rows < 1.01:
        span = int(count) / rate
        implied = _implied_rate(int(count), rate, rows)
        said += f" at {rate:g} fps ({span:.1f} s)"
        hint = (
            f"if the {rows} rows last those {span:.1f} s, they are at {implied:g} fps: pass"
            f" frame_rate={implied:g} to read_bvh, or set data.frame_rate={implied:g}; if they are"
            f" at {rate:g} fps after all, give that number"
        )
    raise InputFileError(path, f"the header says {said}, but {rows} rows follow", hint=hint)


def _implied_rate(count: int, rate: float, rows: int) -> float:
    """Rate at which the rows last as long as the header says."""
    ratio = count / rows
    stride = round(ratio)
    # a file that keeps every n-th frame often drops a few at the end as well
    if stride >= 2 and abs(ratio - stride) < 0.02 * stride:
        return round(rate / stride, 3)
    return round(rate / ratio, 3)


def _frame_rate(seconds: Decimal) -> float:
    """The rate meant by a rounded frame time: 0.033333 is 30 fps, not 30.0003."""
    value = float(seconds)
    if not 1e-5 < value < 60:
        raise ValueError("not the duration of a frame")
    rate = 1.0 / value
    exponent = seconds.as_tuple().exponent
    digits = -exponent if isinstance(exponent, int) else 0
    tolerance = max(10.0**-digits, 1e-9) if digits >= 4 else 1e-9
    whole = round(rate)
    return float(whole) if whole >= 1 and abs(1.0 / whole - value) < tolerance else rate


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
                translations[:, joint, "XYZ".index(channel[0])] = values[:, column] * unit_scale
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
