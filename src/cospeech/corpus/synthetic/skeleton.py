"""The skeleton of the simulated speakers: Trinity's names and proportions, in house axes."""

from __future__ import annotations

import numpy as np

from cospeech.motion.skeleton import Skeleton

UPPER_ARM_M, FOREARM_M = 0.29, 0.26
THIGH_M, SHIN_M = 0.43, 0.445
ANKLE_HEIGHT_M = 0.06

FINGERS: tuple[str, ...] = ("Thumb", "Index", "Middle", "Ring", "Pinky")
SIDES: tuple[str, ...] = ("Left", "Right")

# first joint from the wrist, then the direction and the lengths of the three bones; left hand,
# fingers along +x, palm down, thumb forward
_HAND: dict[str, tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]] = {
    "Thumb": ((0.024, -0.014, 0.026), (0.80, -0.22, 0.56), (0.042, 0.030, 0.024)),
    "Index": ((0.092, 0.0, 0.025), (1.0, 0.0, 0.0), (0.042, 0.025, 0.021)),
    "Middle": ((0.093, 0.002, 0.003), (1.0, 0.0, 0.0), (0.047, 0.029, 0.023)),
    "Ring": ((0.088, 0.0, -0.018), (1.0, 0.0, 0.0), (0.043, 0.027, 0.022)),
    "Pinky": ((0.080, -0.004, -0.037), (1.0, 0.0, 0.0), (0.033, 0.020, 0.019)),
}

_TRUNK: tuple[tuple[str, str, tuple[float, float, float]], ...] = (
    ("Spine", "Hips", (0.0, 0.134, -0.015)),
    ("Spine1", "Spine", (0.0, 0.087, 0.0)),
    ("Spine2", "Spine1", (0.0, 0.087, 0.0)),
    ("Spine3", "Spine2", (0.0, 0.087, 0.0)),
    ("Neck", "Spine3", (0.0, 0.111, 0.010)),
    ("Neck1", "Neck", (0.0, 0.062, 0.006)),
    ("Head", "Neck1", (0.0, 0.062, 0.010)),
    ("Head_end", "Head", (0.0, 0.180, 0.0)),
)

# from the left side; the right side mirrors x
_ARM: tuple[tuple[str, str, tuple[float, float, float]], ...] = (
    ("Shoulder", "Spine3", (0.022, 0.080, 0.030)),
    ("Arm", "Shoulder", (0.158, 0.0, 0.0)),
    ("ForeArm", "Arm", (UPPER_ARM_M, 0.0, 0.0)),
    ("Hand", "ForeArm", (FOREARM_M, 0.0, 0.0)),
)
_LEG: tuple[tuple[str, str, tuple[float, float, float]], ...] = (
    ("UpLeg", "Hips", (0.098, 0.0, 0.0)),
    ("Leg", "UpLeg", (0.0, -THIGH_M, 0.0)),
    ("Foot", "Leg", (0.0, -SHIN_M, 0.0)),
    ("ForeFoot", "Foot", (0.0, -0.037, 0.0)),
    ("ToeBase", "ForeFoot", (0.0, 0.0, 0.147)),
    ("ToeBase_end", "ToeBase", (0.0, 0.0, 0.08)),
)

MID_SHOULDERS_M = np.array([0.0, 0.080, 0.030])
"""The point between the shoulders in the frame of Spine3: the origin of the gesture space."""

STANDING_HEIGHT_M = ANKLE_HEIGHT_M + THIGH_M + SHIN_M - 0.003
"""Height of the hips over the floor; the knees are a little bent."""


def _build() -> Skeleton:
    joints, parents = ["Hips"], [-1]
    offsets: list[tuple[float, ...]] = [(0.0, STANDING_HEIGHT_M, 0.0)]

    def add(name: str, parent: str, offset: tuple[float, ...]) -> None:
        parents.append(joints.index(parent))
        joints.append(name)
        offsets.append(offset)

    for name, parent, offset in _TRUNK:
        add(name, parent, offset)
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        for name, parent, (x, y, z) in _ARM:
            add(side + name, parent if parent == "Spine3" else side + parent, (sign * x, y, z))
        for finger in FINGERS:
            (x, y, z), direction, lengths = _HAND[finger]
            add(f"{side}Hand{finger}1", f"{side}Hand", (sign * x, y, z))
            unit = np.array(direction) / np.linalg.norm(direction) * (sign, 1.0, 1.0)
            for i, length in enumerate(lengths, start=1):
                name = f"{side}Hand{finger}{i + 1}" if i < 3 else f"{side}Hand{finger}3_end"
                add(name, f"{side}Hand{finger}{i}", tuple(float(v) for v in unit * length))
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        for name, parent, (x, y, z) in _LEG:
            add(side + name, parent if parent == "Hips" else side + parent, (sign * x, y, z))
    ends = frozenset(joint for joint in joints if joint.endswith("_end"))
    return Skeleton("synthetic", tuple(joints), tuple(parents), np.array(offsets), ends)


SKELETON = _build()
"""69 joints: trunk, head, arms, every finger to its tip, legs."""
