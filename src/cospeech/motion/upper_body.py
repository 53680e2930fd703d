"""The ten evaluation joints and the maps from common skeletons to them."""

from __future__ import annotations

from cospeech.motion.skeleton import Skeleton

UPPER_BODY = Skeleton(
    name="upper_body",
    joints=(
        "spine",
        "neck",
        "nose",
        "head",
        "left_shoulder",
        "left_elbow",
        "left_wrist",
        "right_shoulder",
        "right_elbow",
        "right_wrist",
    ),
    parents=(-1, 0, 1, 2, 1, 4, 5, 1, 7, 8),
)
"""The ten evaluation joints, in the order of the TED set (left arm first)."""

TED_AXES = (-1.0, -1.0, 1.0)
"""Signs that take house axes to those of the TED set (x right, y down, z forward)."""
