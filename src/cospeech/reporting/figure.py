"""How a skeleton is drawn: which bones, how thick, in which colour, seen from where."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import CospeechError
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton
from cospeech.reporting.joint_names import (
    ARM,
    CLAVICLE,
    FINGER,
    LEG,
    NOSE,
    WRIST,
    says,
    side_of,
    wrists,
)

PARTS: tuple[str, ...] = ("body", "left_arm", "right_arm", "legs")
"""Colour groups of bones."""

PART_COLOURS: dict[str, str] = {
    "body": "#9aa7b8",
    "left_arm": "#f0883e",
    "right_arm": "#3f8efc",
    "legs": "#7c8898",
}
"""sRGB colour of each group; orange and blue stay apart for colour-blind readers."""

# radius in metres of a bone, by what its child joint is called; the first match counts
_RADII: tuple[tuple[tuple[str, ...], float], ...] = (
    (FINGER, 0.008),
    (WRIST, 0.024),
    (("toe", "heel"), 0.026),
    (("foot", "ankle"), 0.036),
    (LEG, 0.046),
    (("fore", "elbow"), 0.030),
    ((*CLAVICLE, "arm"), 0.026),
    (("eye", "ear", "jaw"), 0.014),
    (NOSE, 0.02),
    (("head",), 0.03),
    (("neck",), 0.034),
    (("hip", "pelvis", "spine", "chest", "torso"), 0.044),
)
_OTHER_RADIUS = 0.02
_HAND_RADIUS = 0.036


@dataclass(frozen=True)
class Limb:
    """A bone as it is drawn.

    Attributes:
        upper: Index of the point it starts from.
        lower: Index of the point it ends at.
        part: One of `PARTS`.
        radius: Metres.
    """

    upper: int
    lower: int
    part: str
    radius: float


@dataclass(frozen=True)
class Ball:
    """A skull or a hand.

    Attributes:
        point: Index of the point at its centre.
        part: One of `PARTS`.
        radius: Metres.
    """

    point: int
    part: str
    radius: float


@dataclass(frozen=True)
class Skull:
    """The centre of the head, a point beside the joints: part of the way from one to another.

    Attributes:
        below: Index of the joint under it.
        above: Index of the joint on top of it.
        place: 0 at ``below``, 1 at ``above``.
        radius: Metres.
    """

    below: int
    above: int
    place: float
    radius: float


@dataclass(frozen=True)
class Figure:
    """What is drawn of a motion. Points are its joints and, where there is a skull, its centre.

    Attributes:
        limbs: Bones.
        balls: Skull and hands.
        skull: How the point after the last joint is made; None without one.
    """

    limbs: tuple[Limb, ...]
    balls: tuple[Ball, ...]
    skull: Skull | None

    def points(self, positions: NDArray[np.floating]) -> NDArray[np.floating]:
        """Joints ``(..., J, 3)`` to what limbs and balls index: ``(..., J, 3)`` or one more."""
        if self.skull is None:
            return positions
        below, above = positions[..., self.skull.below, :], positions[..., self.skull.above, :]
        centre = below + (above - below) * self.skull.place
        return np.concatenate([positions, centre[..., None, :]], axis=-2)


def _part(parent: str, child: str) -> str:
    if says(child, LEG) or says(parent, LEG):
        return "legs"
    side = side_of(child)
    if side is None or side_of(parent) != side or not says(child, ARM):
        return "body"
    # LeftShoulder -> LeftArm is the collar bone of mocap skeletons: the arm starts below it
    collar_bone = says(parent, CLAVICLE) and says(child, ("arm",)) and not says(child, ("fore",))
    return "body" if collar_bone else f"{side}_arm"


def figure_of(motion: Motion) -> Figure:
    """What to draw of a motion.

    Every bone of at least a millimetre (median over the clip), its radius by the joint names
    (fingers thin, torso thick) and at most 0.45 of its length. The head is a ball on the neck, with
    a nose where the skeleton has one; arms that end at the wrist get a ball for the hand.
    """
    joints = motion.skeleton.joints
    skull = _skull(motion)
    centre = len(joints)
    bones = list(motion.skeleton.bones)
    balls: list[Ball] = []
    if skull is not None:
        inside = _descendants(motion.skeleton, skull.below)
        face = [i for i in sorted(inside) if says(joints[i], NOSE)]
        if face:
            # neck to centre and centre to nose, for neck to nose and nose to crown
            nose = face[0]
            replaced = _descendants(motion.skeleton, nose) | {nose}
            bones = [(p, c) for p, c in bones if c not in replaced]
            bones += [(skull.below, centre), (centre, nose)]
        else:
            bones = [(p, c) for p, c in bones if c not in inside]
        balls.append(Ball(centre, "body", skull.radius))
    figure = Figure((), (), skull)
    points = figure.points(motion.positions)
    names = (*joints, "head")
    limbs = []
    for upper, lower in bones:
        lengths = np.linalg.norm(points[:, lower] - points[:, upper], axis=-1)
        length = float(np.median(lengths))
        if length < 1e-3:
            continue
        radius = next((r for words, r in _RADII if says(names[lower], words)), _OTHER_RADIUS)
        part = _part(names[upper], names[lower])
        limbs.append(Limb(upper, lower, part, min(radius, 0.45 * length)))
    parents = set(motion.skeleton.parents)
    balls += [
        Ball(joint, f"{side}_arm", _HAND_RADIUS)
        for side, joint in wrists(motion.skeleton).items()
        if joint not in parents
    ]
    return Figure(tuple(limbs), tuple(balls), skull)


def _descendants(skeleton: Skeleton, joint: int) -> set[int]:
    found = {joint}
    for parent, child in skeleton.bones:
        if parent in found:
            found.add(child)
    return found - {joint}


def _skull(motion: Motion) -> Skull | None:
    """Between neck and crown where there is a nose joint, else between the head joint and its end.

    With a nose joint, ``neck`` is the base of the neck, and the skull the upper part of the way.
    """
    joints = motion.skeleton.joints

    def first(words: tuple[str, ...], among: Iterable[int]) -> int | None:
        return next((i for i in among if says(joints[i], words)), None)

    everywhere = range(len(joints))
    if first(NOSE, everywhere) is not None:
        low, high = first(("neck",), everywhere), first(("head",), everywhere)
        place, share = 0.62, 0.38
    else:
        low = first(("head",), everywhere)
        high = first(("head",), (c for p, c in motion.skeleton.bones if p == low))
        place, share = 0.5, 0.55
    if low is None or high is None:
        return None
    span = motion.positions[:, high] - motion.positions[:, low]
    length = float(np.median(np.linalg.norm(span, axis=-1)))
    return Skull(low, high, place, share * length) if length > 0.02 else None


def check_drawable(name: str, motion: Motion) -> None:
    """Refuse a motion that can't be drawn.

    Raises:
        CospeechError: No frames, or a NaN or infinite coordinate; names the track, frame, joint.
    """
    if not len(motion):
        raise CospeechError(f"track {name!r} has no frames", "give at least one frame of motion")
    frame = motion.first_bad_frame()
    if frame is not None:
        bad = ~np.isfinite(motion.positions[frame]).all(axis=-1)
        joint = motion.skeleton.joints[int(bad.argmax())]
        raise CospeechError(
            f"track {name!r}, frame {frame}, joint {joint}: coordinate is not finite",
            "a NaN here usually comes from the model; look at its loss curves before its motion",
        )
