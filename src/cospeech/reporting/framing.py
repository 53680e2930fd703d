"""Where figures stand and which way they face: what a camera needs to know of a motion."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cospeech.motion.motion import Motion
from cospeech.reporting.joint_names import CLAVICLE, says, side_of


def facing(motion: Motion) -> float:
    """Mean heading of the body, radians about +y; 0 looks along +z, positive turns to +x.

    From the line between left and right shoulders (or arms and hips, whichever the skeleton
    names): across × up points forward. A skeleton without sides faces 0.
    """
    anchors: tuple[str, ...] = (*CLAVICLE, "arm", "hip", "thigh")
    sides: dict[str, list[int]] = {"left": [], "right": []}
    for i, joint in enumerate(motion.skeleton.joints):
        side = side_of(joint)
        if side and says(joint, anchors) and not says(joint, ("fore",)):
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


@dataclass(frozen=True)
class Extent:
    """How much room a track takes, upwards.

    Attributes:
        floor: Height at which the ground is drawn, metres.
        height: From there to the highest joint of the clip, metres.
    """

    floor: float
    height: float


def extents(tracks: Mapping[str, Motion]) -> dict[str, Extent]:
    """Floor and height of each track, such that equal poses are drawn at equal places.

    The floor is under the feet where there are feet (first percentile over frames, so one bad frame
    does not lift the actor off the ground). Without feet, all tracks of a skeleton share one
    floor a little below their lowest joint.
    """
    alike = {
        name: [o for o, other in tracks.items() if other.skeleton.joints == motion.skeleton.joints]
        for name, motion in tracks.items()
    }
    lowest = {name: _floor(motion) for name, motion in tracks.items()}
    floors = {
        name: lowest[name] if _has_feet(motion) else min(lowest[other] for other in alike[name])
        for name, motion in tracks.items()
    }
    heights = {
        name: float(motion.positions[:, :, 1].max()) - floors[name]
        for name, motion in tracks.items()
    }
    return {
        name: Extent(floors[name], max(0.2, *(heights[other] for other in alike[name])))
        for name in tracks
    }


def _has_feet(motion: Motion) -> bool:
    return any(says(joint, ("foot", "ankle", "toe")) for joint in motion.skeleton.joints)


def _floor(motion: Motion) -> float:
    lowest = motion.positions[:, :, 1].min(axis=1)
    return float(np.percentile(lowest, 1)) - (0.02 if _has_feet(motion) else 0.06)
