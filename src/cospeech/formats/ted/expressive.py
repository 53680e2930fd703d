"""TED-Expressive: 43 joints with hands and face points, as HA2G's set stores them.

Its axes are a camera's: x to the right of the picture, which is the speaker's left, y down, z away
from the camera. The body is not turned to the front.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from cospeech.formats.ted.clip import UnusableClipError
from cospeech.motion.skeleton import Skeleton

AXES = np.array([1.0, -1.0, -1.0])
"""Signs that take the set's axes to house axes. They are not those of the ten-joint set, which was
turned by half a circle: here faces look along -z."""

LONGEST_GAP_S = 0.2
"""Frames without a detection are filled in by interpolation up to this long; longer gaps cut."""


def _hand(side: str, wrist: int, first: int) -> list[tuple[str, int]]:
    joints: list[tuple[str, int]] = []
    for finger in ("index", "middle", "pinky", "ring", "thumb"):
        for knuckle in (1, 2, 3):
            parent = wrist if knuckle == 1 else first + len(joints) - 1
            joints.append((f"{side}_{finger}{knuckle}", parent))
    return joints


_JOINTS = [
    ("spine", -1),
    ("neck", 0),
    ("l_shoulder", 1),
    ("r_shoulder", 1),
    ("l_elbow", 2),
    ("r_elbow", 3),
    ("l_wrist", 4),
    ("r_wrist", 5),
    *_hand("l", 6, 8),
    *_hand("r", 7, 23),
    ("nose", 1),
    ("r_eye", 38),
    ("l_eye", 38),
    ("r_ear", 39),
    ("l_ear", 40),
]

SKELETON = Skeleton(
    "ted_expressive",
    tuple(name for name, _ in _JOINTS),
    tuple(parent for _, parent in _JOINTS),
)

_BODY_LENGTHS = {1: 0.26, 2: 0.22, 3: 0.22, 4: 0.36, 5: 0.36, 6: 0.33, 7: 0.33}
"""Bone lengths, in metres, with which the set's own code turns directions back into positions."""


def house_positions(poses: NDArray[np.floating]) -> NDArray[np.float32]:
    """Positions in house axes and metres.

    The unit of the stored positions is not documented, so the clip is scaled such that its spine,
    shoulders and arms have, on average, the lengths of the published bone table.

    Args:
        poses: ``(T, 43, 3)``, as stored.

    Raises:
        UnusableClipError: Spine, shoulders and arms have no length.
    """
    children = list(_BODY_LENGTHS)
    parents = [SKELETON.parents[child] for child in children]
    positions = poses.astype(np.float64)
    seen = positions[positions.any(axis=(1, 2))]
    lengths = np.linalg.norm(seen[:, children] - seen[:, parents], axis=-1)
    mean = lengths.mean() if len(seen) else 0.0
    if not 0 < mean < np.inf:
        raise UnusableClipError("no motion", "spine, shoulders and arms have no length")
    scale = sum(_BODY_LENGTHS.values()) / len(_BODY_LENGTHS) / mean
    return (positions * AXES * scale).astype(np.float32)


def whole_pieces(
    poses: NDArray[np.floating], fps: float, shortest: int
) -> Iterator[tuple[int, NDArray[np.floating]]]:
    """Stretches of a clip in which every frame has a pose.

    A frame without a detection is all zero. Gaps up to `LONGEST_GAP_S` are filled in linearly.

    Args:
        poses: ``(n, J, 3)``.
        fps: Their frame rate.
        shortest: Frames that a stretch must have to be given.

    Yields:
        First frame and ``(m, J, 3)`` poses.
    """
    seen = np.flatnonzero(poses.any(axis=(1, 2)))
    longest_gap = int(LONGEST_GAP_S * fps)
    # a step of more than one frame from one detection to the next is a gap of one frame less
    cuts = np.flatnonzero(np.diff(seen) - 1 > longest_gap) + 1
    for piece in np.split(seen, cuts):
        if not len(piece) or piece[-1] - piece[0] + 1 < shortest:
            continue
        at = np.arange(piece[0], piece[-1] + 1)
        high = np.searchsorted(piece, at)
        low = np.maximum(high - (piece[high] != at), 0)
        steps = np.maximum(piece[high] - piece[low], 1)
        share = ((at - piece[low]) / steps)[:, None, None]
        before, after = poses[piece[low]], poses[piece[high]]
        yield int(piece[0]), before + (after - before) * share
