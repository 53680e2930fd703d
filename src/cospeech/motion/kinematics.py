"""Rotations and forward kinematics in NumPy, vectorised over frames.

Quaternions are scalar-last ``(x, y, z, w)``; angles are radians. A joint's local rotation takes
vectors of its own frame to its parent's, so world rotations multiply from the root down. The inner
loops keep the components apart (arrays of one number per frame), which is several times faster
than ``(T, 4)`` rows.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cospeech.motion.skeleton import Skeleton

_Components: TypeAlias = Sequence[NDArray[np.floating]] | NDArray[np.floating]
_AXES = {"X": 0, "Y": 1, "Z": 2}


def euler_to_quaternion(angles: NDArray[np.floating], order: str) -> NDArray[np.float64]:
    """Quaternions of intrinsic rotations, as BVH channels mean them.

    ``order="ZXY"`` is the matrix product ``Rz Rx Ry``: SciPy's upper-case convention.

    Args:
        angles: ``(..., len(order))`` radians, in the order of ``order``.
        order: Up to three different letters of ``XYZ``; none at all gives identities.

    Returns:
        ``(..., 4)`` unit quaternions.

    Raises:
        ValueError: A letter is unknown or repeated, or the shapes disagree.
    """
    if len(set(order)) != len(order) or not set(order) <= set(_AXES):
        raise ValueError(
            f"a rotation order has up to three different letters of XYZ, got {order!r}"
        )
    if angles.shape[-1] != len(order):
        raise ValueError(f"order {order!r} with angles of shape {angles.shape}")
    quaternions = np.zeros((*angles.shape[:-1], 4))
    quaternions[..., 3] = 1.0
    result = np.moveaxis(quaternions, -1, 0).copy()
    halves = np.moveaxis(np.asarray(angles, np.float64), -1, 0) / 2
    for letter, half in zip(order, halves, strict=True):
        # a product with a single-axis rotation needs a third of the general formula
        sine, cosine = np.sin(half), np.cos(half)
        i = _AXES[letter]
        j, k = (i + 1) % 3, (i + 2) % 3
        qi, qj, qk, w = result[i], result[j], result[k], result[3]
        result = np.empty_like(result)
        result[i] = qi * cosine + w * sine
        result[j] = qj * cosine + qk * sine
        result[k] = qk * cosine - qj * sine
        result[3] = w * cosine - qi * sine
    return np.moveaxis(result, 0, -1)


def quaternion_to_euler(quaternions: NDArray[np.floating], order: str) -> NDArray[np.float64]:
    """Intrinsic Euler angles of unit quaternions.

    Args:
        quaternions: ``(..., 4)``.
        order: Three different letters of ``XYZ``.

    Returns:
        ``(..., 3)`` radians in the order of ``order``. At gimbal lock, where the first and last
        angle are not determined, the last is 0.
    """
    shape = quaternions.shape[:-1]
    rotations = Rotation.from_quat(np.asarray(quaternions, np.float64).reshape(-1, 4))
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*[Gg]imbal lock")
        return rotations.as_euler(order).reshape(*shape, 3)


def multiply_quaternions(
    left: NDArray[np.floating], right: NDArray[np.floating]
) -> NDArray[np.float64]:
    """The rotation ``left`` after ``right``; shapes ``(..., 4)`` broadcast."""
    left, right = np.broadcast_arrays(left, right)
    return np.stack(_multiply(np.moveaxis(left, -1, 0), np.moveaxis(right, -1, 0)), axis=-1)


def rotate_vectors(
    quaternions: NDArray[np.floating], vectors: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Vectors ``(..., 3)`` turned by unit quaternions ``(..., 4)``; shapes broadcast."""
    shape = np.broadcast_shapes(quaternions.shape[:-1], vectors.shape[:-1])
    quaternions = np.broadcast_to(quaternions, (*shape, 4))
    vectors = np.broadcast_to(vectors, (*shape, 3))
    return np.stack(_rotate(np.moveaxis(quaternions, -1, 0), np.moveaxis(vectors, -1, 0)), axis=-1)


def invert_quaternions(quaternions: NDArray[np.floating]) -> NDArray[np.float64]:
    """The inverse rotations of unit quaternions ``(..., 4)``."""
    return quaternions * np.array([-1.0, -1.0, -1.0, 1.0])


def forward_kinematics(
    parents: Sequence[int],
    translations_local: NDArray[np.floating],
    rotations_local: NDArray[np.floating],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """World positions and rotations from local ones.

    ``R[j] = R[parent] r[j]`` and ``p[j] = p[parent] + R[parent] t[j]``; a root's translation is its
    world position.

    Args:
        parents: Parent index per joint, -1 for a root, parents before children.
        translations_local: ``(T, J, 3)``: offset from the parent in the parent's frame.
        rotations_local: ``(T, J, 4)`` unit quaternions.

    Returns:
        ``positions_world (T, J, 3)`` and ``rotations_world (T, J, 4)``.

    Raises:
        ValueError: The shapes disagree.
    """
    frames, joints = rotations_local.shape[:2]
    if translations_local.shape != (frames, joints, 3) or len(parents) != joints:
        raise ValueError(
            f"{len(parents)} parents, translations {translations_local.shape} and rotations"
            f" {rotations_local.shape} do not belong together"
        )
    translations = np.ascontiguousarray(translations_local.transpose(1, 2, 0), dtype=np.float64)
    local = np.ascontiguousarray(rotations_local.transpose(1, 2, 0), dtype=np.float64)
    positions = np.empty_like(translations)
    world = np.empty_like(local)
    for joint, parent in enumerate(parents):
        if parent < 0:
            world[joint] = local[joint]
            positions[joint] = translations[joint]
            continue
        for i, value in enumerate(_multiply(world[parent], local[joint])):
            world[joint, i] = value
        for i, value in enumerate(_rotate(world[parent], translations[joint])):
            positions[joint, i] = positions[parent, i] + value
    return positions.transpose(2, 0, 1), world.transpose(2, 0, 1)


def skeleton_positions(
    skeleton: Skeleton,
    rotations_local: NDArray[np.floating],
    root_positions: NDArray[np.floating] | None = None,
) -> NDArray[np.float32]:
    """World positions of a posed skeleton whose bones keep their rest offsets.

    Args:
        skeleton: Joints with offsets.
        rotations_local: ``(T, J, 4)``.
        root_positions: ``(T, 3)`` metres; the root's own offset where None.

    Returns:
        ``(T, J, 3)`` float32.

    Raises:
        ValueError: The skeleton has no offsets, or the shapes disagree.
    """
    if skeleton.offsets is None:
        raise ValueError(f"skeleton {skeleton.name} has no offsets, so rotations can't pose it")
    translations = np.broadcast_to(skeleton.offsets, (len(rotations_local), len(skeleton), 3))
    if root_positions is not None:
        translations = translations.copy()
        roots = [joint for joint, parent in enumerate(skeleton.parents) if parent < 0]
        translations[:, roots] = root_positions[:, None]
    positions, _ = forward_kinematics(skeleton.parents, translations, rotations_local)
    return positions.astype(np.float32)


def world_rotations(
    parents: Sequence[int], rotations_local: NDArray[np.floating]
) -> NDArray[np.float64]:
    """World rotations ``(T, J, 4)`` from local ones of the same shape."""
    local = np.ascontiguousarray(rotations_local.transpose(1, 2, 0), dtype=np.float64)
    world = local.copy()
    _, *deeper = joint_levels(tuple(parents))
    for joints in deeper:
        above = world[[parents[joint] for joint in joints]]
        turned = _multiply(above.swapaxes(0, 1), local[list(joints)].swapaxes(0, 1))
        world[list(joints)] = np.stack(turned, axis=1)
    return world.transpose(2, 0, 1)


@lru_cache(maxsize=64)
def joint_levels(parents: tuple[int, ...]) -> tuple[tuple[int, ...], ...]:
    """The joints by their distance from a root: roots, their children, and so on.

    Args:
        parents: Parent index per joint, -1 for a root; parents before children.
    """
    depths = list[int]()
    for parent in parents:
        depths.append(0 if parent < 0 else depths[parent] + 1)
    joints = range(len(parents))
    return tuple(
        tuple(joint for joint in joints if depths[joint] == depth)
        for depth in range(max(depths, default=-1) + 1)
    )


def local_translations(
    parents: Sequence[int],
    positions_world: NDArray[np.floating],
    rotations_world: NDArray[np.floating],
) -> NDArray[np.float64]:
    """Each joint's offset in its parent's frame: the inverse of `forward_kinematics`.

    Args:
        parents: Parent index per joint, -1 for a root.
        positions_world: ``(T, J, 3)``.
        rotations_world: ``(T, J, 4)``.

    Returns:
        ``(T, J, 3)``; a root's row is its world position.
    """
    result = np.asarray(positions_world, np.float64).copy()
    children = [joint for joint, parent in enumerate(parents) if parent >= 0]
    above = [parents[joint] for joint in children]
    bones = result[:, children] - result[:, above]
    result[:, children] = rotate_vectors(invert_quaternions(rotations_world[:, above]), bones)
    return result


def heading_angles(
    right: NDArray[np.floating], left: NDArray[np.floating]
) -> NDArray[np.float64] | None:
    """Turn about the vertical that brings the right-to-left direction to +x.

    Args:
        right: ``(T, 3)`` positions of a point on the body's right (a hip).
        left: ``(T, 3)`` positions of its left counterpart.

    Returns:
        ``(T,)`` radians about +y. Frames in which the line stands upright take the angle of the
        last frame before that had one; None when no frame has one.
    """
    across = np.asarray(left, np.float64) - np.asarray(right, np.float64)
    known = np.hypot(across[:, 0], across[:, 2]) > 1e-6
    if not known.any():
        return None
    angles = np.arctan2(across[:, 2], across[:, 0])
    source = np.maximum.accumulate(np.where(known, np.arange(len(angles)), int(known.argmax())))
    return angles[source]


def turn_about_vertical(
    vectors: NDArray[np.floating], angles: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Vectors ``(T, ..., 3)`` turned about +y by ``(T,)`` radians, one angle per frame."""
    shape = (-1, *([1] * (vectors.ndim - 2)))
    cosine, sine = np.cos(angles).reshape(shape), np.sin(angles).reshape(shape)
    x, y, z = np.moveaxis(np.asarray(vectors, np.float64), -1, 0)
    return np.stack([x * cosine + z * sine, y, z * cosine - x * sine], axis=-1)


def _multiply(left: _Components, right: _Components) -> tuple[NDArray[np.float64], ...]:
    ax, ay, az, aw = left
    bx, by, bz, bw = right
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _rotate(quaternion: _Components, vector: _Components) -> tuple[NDArray[np.float64], ...]:
    x, y, z, w = quaternion
    vx, vy, vz = vector
    # v + w t + q × t with t = 2 q × v
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return (
        vx + w * tx + y * tz - z * ty,
        vy + w * ty + z * tx - x * tz,
        vz + w * tz + x * ty - y * tx,
    )
