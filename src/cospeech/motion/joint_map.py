"""Joint maps: where the ten evaluation joints are on a given skeleton.

A map is a small yaml file. Those of the field's corpora are packaged beside this module; a user
adds a folder of their own (`load_joint_map`, `find_joint_map`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

import yaml

from cospeech.errors import CospeechError, InputFileError
from cospeech.motion.skeleton import Skeleton

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

MAX_MAP_BYTES = 2**16
_KEYS = {"about", "joints", "hips", "markers", "unit_scale"}


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


def bare_names(skeleton: Skeleton) -> dict[str, int]:
    """Joint index by name, also without a namespace (``mixamorig:Hips`` is found as ``Hips``)."""
    names = {joint.rpartition(":")[2]: i for i, joint in reversed([*enumerate(skeleton.joints)])}
    return names | skeleton.index


def load_joint_map(name_or_path: str | Path) -> JointMap:
    """A packaged map by its name, or any map by the path of its yaml file.

    Raises:
        CospeechError: No packaged map has that name; the message lists those there are.
        InputFileError: The file is absent or not a joint map.
    """
    packaged = _packaged()
    if str(name_or_path) in packaged:
        return packaged[str(name_or_path)]
    path = Path(name_or_path)
    if path.suffix.lower() not in (".yaml", ".yml"):
        raise CospeechError(
            f"no joint map is called {name_or_path!r}; there are {', '.join(sorted(packaged))}",
            hint="give one of these names, or the path of a .yaml file",
        )
    return _read(path, path)


def find_joint_map(skeleton: Skeleton, folders: Sequence[str | Path] = ()) -> JointMap:
    """The map that fits a skeleton's joint names.

    A map fits when the skeleton has every joint it names. Of several, one from ``folders`` goes
    before a packaged one, and then the one that names most joints.

    Args:
        skeleton: The skeleton.
        folders: Folders with more ``*.yaml`` maps.

    Raises:
        CospeechError: No map fits. The message lists the skeleton's joints and shows a map to fill
            in.
    """
    names = set(bare_names(skeleton))
    candidates = [(0, joint_map) for joint_map in _packaged().values()]
    for folder in map(Path, folders):
        candidates += [(1, _read(path, path)) for path in sorted(folder.glob("*.y*ml"))]
    fitting = [pair for pair in candidates if pair[1].required <= names]
    if not fitting:
        raise CospeechError(
            f"no joint map fits the skeleton {skeleton.name!r}."
            f"\n{_what_is_missing(candidates, names)}\nIts joints: {', '.join(skeleton.joints)}",
            hint="write the joints of your skeleton into a file my_corpus.yaml like this one, and"
            f" pass its path (data.joint_map=my_corpus.yaml):\n{_TEMPLATE}",
        )
    return max(fitting, key=lambda pair: (pair[0], len(pair[1].required), pair[1].name))[1]


_TEMPLATE = """\
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


def _what_is_missing(candidates: list[tuple[int, JointMap]], names: set[str]) -> str:
    nearest = min(
        (joint_map for _, joint_map in candidates),
        key=lambda joint_map: len(joint_map.required - names) / len(joint_map.required),
    )
    return (
        f"The nearest, {nearest.name}, also needs: {', '.join(sorted(nearest.required - names))}."
    )


@cache
def _packaged() -> dict[str, JointMap]:
    folder = files("cospeech.motion") / "joint_maps"
    maps = [
        _read(file, Path(file.name)) for file in folder.iterdir() if file.name.endswith(".yaml")
    ]
    return {joint_map.name: joint_map for joint_map in maps}


def _read(file: Traversable, path: Path) -> JointMap:
    try:
        with file.open("rb") as stream:
            data = stream.read(MAX_MAP_BYTES + 1)
        if len(data) > MAX_MAP_BYTES:
            raise InputFileError(path, f"too long for a joint map (over {MAX_MAP_BYTES} bytes)")
        return _checked(path, yaml.safe_load(data))
    except OSError as error:
        raise InputFileError(path, f"can't be read ({error.strerror})") from error
    except (yaml.YAMLError, RecursionError, UnicodeDecodeError) as error:
        raise InputFileError(path, f"not valid yaml: {error}") from error


def _checked(path: Path, values: Any) -> JointMap:
    def wrong(problem: str) -> InputFileError:
        return InputFileError(path, problem, hint=f"a joint map looks like this:\n{_TEMPLATE}")

    if not isinstance(values, dict) or not isinstance(values.get("joints"), dict):
        raise wrong("a joint map needs the key 'joints'")
    if unknown := sorted(map(str, set(values) - _KEYS)):
        raise wrong(f"unknown keys: {', '.join(unknown)}")
    joints = values["joints"]
    if set(joints) != set(EVALUATION_JOINTS):
        different = sorted(map(str, set(joints) ^ set(EVALUATION_JOINTS)))
        raise wrong(f"'joints' must have exactly the ten evaluation joints; see {different}")
    hips = values.get("hips")
    if hips is not None and (not isinstance(hips, dict) or set(hips) != {"right", "left"}):
        raise wrong("'hips' must be {right: ..., left: ...}")
    markers = values.get("markers") or []
    scale = values.get("unit_scale", 0.01)
    if not isinstance(markers, list):
        raise wrong("'markers' must be a list of joint names")
    if isinstance(scale, bool) or not isinstance(scale, int | float) or not 0 < scale < 1e3:
        raise wrong("'unit_scale' must be a positive number of metres")
    sources = []
    for name in EVALUATION_JOINTS:
        source = _source(joints[name])
        if source is None:
            raise wrong(
                f"{name}: expected a joint name, {{joint: name, offset: [x, y, z]}} or"
                " {weights: {name: number, ...}} whose numbers sum to 1"
            )
        sources.append(source)
    return JointMap(
        name=path.stem,
        joints=tuple(sources),
        hips=None if hips is None else (str(hips["right"]), str(hips["left"])),
        markers=tuple(map(str, markers)),
        unit_scale=float(scale),
    )


def _source(value: Any) -> JointSource | JointBlend | None:
    if isinstance(value, str | int):
        return JointSource(str(value))
    if not isinstance(value, dict):
        return None
    if set(value) == {"weights"}:
        return _blend(value["weights"])
    if not {"joint"} <= set(value) <= {"joint", "offset"}:
        return None
    offset = value.get("offset", [0.0, 0.0, 0.0])
    if not isinstance(offset, list) or len(offset) != 3:
        return None
    if not all(_is_number(x) for x in offset):
        return None
    return JointSource(str(value["joint"]), (float(offset[0]), float(offset[1]), float(offset[2])))


def _blend(weights: Any) -> JointBlend | None:
    if not isinstance(weights, dict) or not all(_is_number(x) for x in weights.values()):
        return None
    # a sum other than 1 would scale the body's place in the room into the pose
    if abs(sum(weights.values()) - 1) > 1e-6:
        return None
    return JointBlend(tuple((str(joint), float(x)) for joint, x in weights.items()))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and math.isfinite(value)
