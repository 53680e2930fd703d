"""What a joint map says, and the check of values that should be one."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cospeech.errors import InputFileError

EVALUATION_JOINTS = (
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
)
"""The ten evaluation joints, in the order of the TED set (left arm first)."""

MAX_OFFSET_M = 10.0
UNIT_SCALES = (1e-6, 1e3)
"""Metres per unit that a file can be kept in."""

_KEYS = {"about", "joints", "hips", "markers", "unit_scale"}

TEMPLATE = """\
joints:
  spine: Spine2            # about 0.25 to 0.3 m below the neck joint
  neck: Neck               # the root of the neck, between the shoulders
  nose: {joint: Head, offset: [0.0, 0.02, 0.12]}   # metres in the Head joint's own axes
  head: {joint: Head, offset: [0.0, 0.18, 0.0]}    # the top of the head
  left_shoulder: LeftArm
  left_elbow: LeftForeArm
  left_wrist: LeftHand
  right_shoulder: RightArm
  right_elbow: RightForeArm
  right_wrist: RightHand
hips: {right: RightUpLeg, left: LeftUpLeg}
unit_scale: 0.01           # metres per unit of the BVH file"""

_HINT = f"a joint map looks like this:\n{TEMPLATE}"


@dataclass(frozen=True)
class JointSource:
    """Where one evaluation joint comes from.

    Attributes:
        joint: Joint of the source skeleton.
        offset: Metres, in the joint's own frame: the point moves with the joint's rotation. Zero
            means the joint itself.
    """

    joint: str
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def needed(self) -> tuple[str, ...]:
        """The joints that the skeleton must have for it."""
        return (self.joint,)

    def to_plain(self) -> dict[str, Any]:
        """As a joint map's yaml has it."""
        return {"joint": self.joint, "offset": list(self.offset)}


@dataclass(frozen=True)
class JointBlend:
    """An evaluation joint that lies between or beyond joints, for skeletons without rotations.

    Attributes:
        weights: (joint, weight) pairs; the weights sum to 1, so that the point moves with the body.
            Negative ones reach beyond: ears 2, neck -1 is as far above the ears as the neck is
            below them.
    """

    weights: tuple[tuple[str, float], ...]

    @property
    def needed(self) -> tuple[str, ...]:
        """The joints that the skeleton must have for it."""
        return tuple(joint for joint, _ in self.weights)

    def to_plain(self) -> dict[str, Any]:
        """As a joint map's yaml has it."""
        return {"weights": dict(self.weights)}


@dataclass(frozen=True)
class JointMap:
    """How to find the evaluation joints on a skeleton.

    Attributes:
        name: The yaml file's stem.
        joints: One source per name of `EVALUATION_JOINTS`, in that order.
        hips: Right and left hip, whose horizontal direction is the body's heading; None where the
            data is already turned to face +z.
        markers: Further joints that tell this skeleton from others with the same names.
        unit_scale: Metres per unit in this corpus's BVH files.
    """

    name: str
    joints: tuple[JointSource | JointBlend, ...]
    hips: tuple[str, str] | None = None
    markers: tuple[str, ...] = ()
    unit_scale: float = 0.01

    @property
    def required(self) -> frozenset[str]:
        """Every joint that the skeleton must have."""
        return frozenset(
            (
                *(joint for source in self.joints for joint in source.needed),
                *(self.hips or ()),
                *self.markers,
            )
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for a JSON manifest, those of the yaml file and the map's name."""
        return {
            "name": self.name,
            "joints": {
                role: source.to_plain()
                for role, source in zip(EVALUATION_JOINTS, self.joints, strict=True)
            },
            "hips": None if self.hips is None else {"right": self.hips[0], "left": self.hips[1]},
            "markers": list(self.markers),
            "unit_scale": self.unit_scale,
        }

    @classmethod
    def from_dict(cls, values: Any) -> JointMap:
        """The map that `to_dict` wrote.

        Raises:
            InputFileError: It is none; the message says what is wrong with it.
        """
        if not isinstance(values, dict) or not isinstance(values.get("name"), str):
            raise InputFileError("joint map", "a stored joint map needs a name")
        rest = {key: value for key, value in values.items() if key != "name"}
        return checked_joint_map(values["name"], Path(f"joint map {values['name'][:40]}"), rest)


def checked_joint_map(name: str, path: Path, values: Any) -> JointMap:
    """A joint map of plain values.

    Args:
        name: What it is called.
        path: For messages.
        values: As in a yaml file.

    Raises:
        InputFileError: They are no joint map; the message says what is wrong and shows one.
    """

    def wrong(problem: str) -> InputFileError:
        return InputFileError(path, problem, hint=_HINT)

    if not isinstance(values, dict) or not isinstance(values.get("joints"), dict):
        raise wrong("a joint map needs the key 'joints'")
    if unknown := [key for key in values if key not in _KEYS]:
        raise wrong(f"unknown keys: {_shown(unknown)}")
    joints = values["joints"]
    if different := set(joints) ^ set(EVALUATION_JOINTS):
        raise wrong(
            f"'joints' must have exactly the ten evaluation joints; see {_shown(different)}"
        )
    hips = values.get("hips")
    if hips is not None and (
        not isinstance(hips, dict)
        or set(hips) != {"right", "left"}
        or not all(map(_is_name, hips.values()))
    ):
        raise wrong("'hips' must be {right: ..., left: ...}, two joint names")
    markers = values.get("markers") or []
    if not isinstance(markers, list) or not all(map(_is_name, markers)):
        raise wrong("'markers' must be a list of joint names")
    scale = values.get("unit_scale", 0.01)
    if not _is_number(scale, UNIT_SCALES[1]) or scale < UNIT_SCALES[0]:
        raise wrong("'unit_scale' must be a positive number of metres")
    sources = []
    for role in EVALUATION_JOINTS:
        source = _source(joints[role])
        if source is None:
            raise wrong(
                f"{role}: expected a joint name, {{joint: name, offset: [x, y, z]}} or"
                " {weights: {name: number, ...}} whose numbers sum to 1"
            )
        sources.append(source)
    return JointMap(
        name=name,
        joints=tuple(sources),
        hips=None if hips is None else (str(hips["right"]), str(hips["left"])),
        markers=tuple(map(str, markers)),
        unit_scale=float(scale),
    )


def _source(value: Any) -> JointSource | JointBlend | None:
    if _is_name(value):
        return JointSource(str(value))
    if not isinstance(value, dict):
        return None
    if set(value) == {"weights"}:
        return _blend(value["weights"])
    if not {"joint"} <= set(value) <= {"joint", "offset"} or not _is_name(value["joint"]):
        return None
    offset = value.get("offset", [0.0, 0.0, 0.0])
    if not isinstance(offset, list) or len(offset) != 3:
        return None
    if not all(_is_number(x, MAX_OFFSET_M) for x in offset):
        return None
    return JointSource(str(value["joint"]), (float(offset[0]), float(offset[1]), float(offset[2])))


def _blend(weights: Any) -> JointBlend | None:
    if not isinstance(weights, dict) or not all(map(_is_name, weights)):
        return None
    # a sum other than 1 would scale the body's place in the room into the pose
    if not all(_is_number(x, 1e3) for x in weights.values()):
        return None
    if abs(sum(weights.values()) - 1) > 1e-6:
        return None
    return JointBlend(tuple((str(joint), float(x)) for joint, x in weights.items()))


def _is_name(value: Any) -> bool:
    """Whether it names a joint: a text, or the number that some skeletons have in its place."""
    return isinstance(value, str | int) and not isinstance(value, bool)


def _is_number(value: Any, most: float) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return math.isfinite(value) and abs(value) <= most


def _shown(keys: Iterable[Any]) -> str:
    texts = sorted(repr(key)[:40] if not isinstance(key, str) else key[:40] for key in keys)
    return ", ".join(texts[:10]) + (" ..." if len(texts) > 10 else "")
