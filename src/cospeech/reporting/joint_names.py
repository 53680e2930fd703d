"""What joint names say: side, limb, in the spellings of the usual skeletons."""

from __future__ import annotations

import re

from cospeech.motion.skeleton import Skeleton

CLAVICLE = ("shoulder", "clavicle", "collar", "shldr")
FINGER = ("thumb", "index", "middle", "ring", "pinky", "pinkie", "little", "finger")
WRIST = ("wrist", "hand")
NOSE = ("nose",)
ARM = (*CLAVICLE, "arm", "elbow", *WRIST, *FINGER)
LEG = ("leg", "thigh", "knee", "foot", "ankle", "toe", "heel")

_TOKEN = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")


def _tokens(joint: str) -> list[str]:
    return [token.lower() for token in _TOKEN.findall(joint)]


def says(joint: str, words: tuple[str, ...]) -> bool:
    """Whether any part of a joint's name contains any of the words."""
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


def wrists(skeleton: Skeleton) -> dict[str, int]:
    """Index of each wrist the skeleton has, keyed ``"left"`` and ``"right"``."""
    found: dict[str, int] = {}
    for words in (("wrist",), ("hand",)):
        for i, joint in enumerate(skeleton.joints):
            side = side_of(joint)
            if side and side not in found and says(joint, words) and not says(joint, FINGER):
                found[side] = i
    return found
