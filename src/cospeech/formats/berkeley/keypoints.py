"""The 49 keypoints of the 2-D set, and one frame's file."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cospeech.motion.skeleton import Skeleton

MAX_FILE_BYTES = 2**16
_FURTHEST_PX = 1e5


def _keypoints() -> dict[str, str | None]:
    parents: dict[str, str | None] = {"neck": None}
    for side in ("right", "left"):
        chain = ["neck", *(f"{side}_{joint}" for joint in ("shoulder", "elbow", "wrist"))]
        parents |= dict(zip(chain[1:], chain, strict=False))
    for side in ("left", "right"):
        parents[f"{side}_hand"] = f"{side}_wrist"
        for finger in ("thumb", "index", "middle", "ring", "little"):
            bones = [f"{side}_hand", *(f"{side}_{finger}{i}" for i in range(4))]
            parents |= dict(zip(bones[1:], bones, strict=False))
    return parents


_PARENTS = _keypoints()

BERKELEY_2D = Skeleton(
    name="berkeley2d",
    joints=tuple(_PARENTS),
    parents=tuple(
        -1 if parent is None else list(_PARENTS).index(parent) for parent in _PARENTS.values()
    ),
)
"""Keypoints in the order of the files: neck, right arm, left arm, left hand, right hand."""

COUNT = len(BERKELEY_2D)
COUNT_WITH_FACE = COUNT + 3
_WITHOUT_FACE = [*range(7), *range(10, COUNT_WITH_FACE)]


def parse_keypoints(data: bytes) -> NDArray[np.float64]:
    """A ``keypoints_simple`` file's ``(2, 49)``: a row of x and a row of y, pixels, y down.

    Lines that start with ``#`` are comments. Files with 52 columns have the nose and the eyes in
    columns 7 to 9, which are taken out as the published loader does.

    Raises:
        ValueError: It isn't that; the message says what it is.
    """
    if len(data) > MAX_FILE_BYTES:
        raise ValueError(f"over {MAX_FILE_BYTES} bytes")
    rows = [
        line.split() for line in data.splitlines() if line.strip() and line.lstrip()[:1] != b"#"
    ]
    if len(rows) != 2 or len(rows[0]) != len(rows[1]):
        shape = " and ".join(str(len(row)) for row in rows[:4]) or "no"
        raise ValueError(f"{len(rows)} rows of {shape} numbers; expected 2 rows of 49 or 52")
    return without_face(np.array(rows, dtype=np.float64))


def without_face(keypoints: NDArray[Any]) -> NDArray[np.float64]:
    """``(..., 2, 49)`` from arrays of 49 or of 52 columns.

    Raises:
        ValueError: Another shape, NaN, or numbers that no picture has.
    """
    if keypoints.shape[-2:] == (2, COUNT_WITH_FACE):
        keypoints = keypoints[..., _WITHOUT_FACE]
    if keypoints.shape[-2:] != (2, COUNT):
        raise ValueError(f"an array of shape {keypoints.shape}; expected 2 x 49 or 2 x 52")
    # Written so that NaN fails too.
    if not (np.abs(keypoints) < _FURTHEST_PX).all():
        raise ValueError("NaN, or a coordinate beyond 100,000 pixels")
    return keypoints.astype(np.float64)


def to_house_axes(keypoints: NDArray[Any]) -> NDArray[np.float32]:
    """``(T, 2, 49)`` picture coordinates as ``(T, 49, 2)`` relative to the neck.

    The speaker faces the camera, so their left is the picture's right: x stays. y is turned up.
    """
    relative = keypoints - keypoints[..., :1]
    return (relative * [[1.0], [-1.0]]).swapaxes(-1, -2).astype(np.float32)
