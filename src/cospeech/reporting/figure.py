"""How a skeleton is drawn: which bones, how thick, in which colour, seen from where."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import CospeechError
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton

PARTS: tuple[str, ...] = ("body", "left_arm", "right_arm", "legs")
"""Colour groups of bones."""

PART_COLOURS: dict[str, str] = {
    "body": "#9aa7b8",
    "left_arm": "#f0883e",
    "right_arm": "#3f8efc",
    "legs": "#7c8898",
}
"""sRGB colour of each group; orange and blue stay apart for colour-blind readers."""

_TOKEN = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")
_CLAVICLE = ("shoulder", "clavicle", "collar", "shldr")
_FINGER = ("thumb", "index", "middle", "ring", "pinky", "pinkie", "little", "finger")
_WRIST = ("wrist", "hand")
_NOSE = ("nose",)
_ARM = (*_CLAVICLE, "arm", "elbow", *_WRIST, *_FINGER)
_LEG = ("leg", "thigh", "knee", "foot", "ankle", "toe", "heel")

# radius in metres of a bone, by what its child joint is called; the first match counts
_RADII: tuple[tuple[tuple[str, ...], float], ...] = (
    (_FINGER, 0.008),
    (_WRIST, 0.024),
    (("toe", "heel"), 0.026),
    (("foot", "ankle"), 0.036),
    (_LEG, 0.046),
    (("fore", "elbow"), 0.030),
    ((*_CLAVICLE, "arm"), 0.026),
    (("eye", "ear", "jaw"), 0.014),
    (_NOSE, 0.02),
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


def _tokens(joint: str) -> list[str]:
    return [token.lower() for token in _TOKEN.findall(joint)]


def _says(joint: str, words: tuple[str, ...]) -> bool:
    return any(word in token for token in _tokens(joint) for word in words)


def side_of(joint: str) -> str | None:
    """``"left"``, ``"right"`` or None, from a joint's name in any of the usual spellings.

    ``LeftHand``, ``left_hand``, ``l_hand``, ``LHand``, ``Hand_L`` and ``lefthand`` are all left.
    """
    for token in _tokens(joint):
        if token == "l" or token.startswith("left"):
            return "left"
        if token == "r" or token.startswith("right"):
            return "right"
    return None


def _part(parent: str, child: str) -> str:
    if _says(child, _LEG) or _says(parent, _LEG):
        return "legs"
    side = side_of(child)
    if side is None or side_of(parent) != side or not _says(child, _ARM):
        return "body"
    # LeftShoulder -> LeftArm is the collar bone of mocap skeletons: the arm starts below it
    collar_bone = (
        _says(parent, _CLAVICLE) and _says(child, ("arm",)) and not _says(child, ("fore",))
    )
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
        face = [i for i in sorted(inside) if _says(joints[i], _NOSE)]
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
        radius = next((r for words, r in _RADII if _says(names[lower], words)), _OTHER_RADIUS)
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
        return next((i for i in among if _says(joints[i], words)), None)

    everywhere = range(len(joints))
    if first(_NOSE, everywhere) is not None:
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


def wrists(skeleton: Skeleton) -> dict[str, int]:
    """Index of each wrist the skeleton has, keyed ``"left"`` and ``"right"``."""
    found: dict[str, int] = {}
    for words in (("wrist",), ("hand",)):
        for i, joint in enumerate(skeleton.joints):
            side = side_of(joint)
            if side and side not in found and _says(joint, words) and not _says(joint, _FINGER):
                found[side] = i
    return found


def facing(motion: Motion) -> float:
    """Mean heading of the body, radians about +y; 0 looks along +z, positive turns to +x.

    From the line between left and right shoulders (or arms and hips, whichever the skeleton
    names): across × up points forward. A skeleton without sides faces 0.
    """
    anchors: tuple[str, ...] = (*_CLAVICLE, "arm", "hip", "thigh")
    sides: dict[str, list[int]] = {"left": [], "right": []}
    for i, joint in enumerate(motion.skeleton.joints):
        side = side_of(joint)
        if side and _says(joint, anchors) and not _says(joint, ("fore",)):
            sides[side].append(i)
    if not (sides["left"] and sides["right"] and len(motion)):
        return 0.0
    across = motion.positions[:, sides["left"]].mean(
        axis=(0, 1), dtype=np.float64
    ) - motion.positions[:, sides["right"]].mean(axis=(0, 1), dtype=np.float64)
    forward_x, forward_z = -across[2], across[0]
    if math.hypot(forward_x, forward_z) < 1e-3:
        return 0.0
    return math.atan2(forward_x, forward_z)


def floor_height(motion: Motion) -> float:
    """Height in metres at which to draw the ground.

    The feet where there are feet (first percentile over frames, so one bad frame does not lift
    the actor off the ground); otherwise a little below the lowest joint.
    """
    if not len(motion):
        return 0.0
    lowest = motion.positions[:, :, 1].min(axis=1)
    has_legs = any(_says(joint, ("foot", "ankle", "toe")) for joint in motion.skeleton.joints)
    return float(np.percentile(lowest, 1)) - (0.02 if has_legs else 0.06)


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
