"""Joint maps: where the ten evaluation joints are on a given skeleton.

A map is a small yaml file. Those of the field's corpora are packaged beside this module; a user
chooses a file of their own (`load_joint_map`), and a skeleton that was read with a map carries it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path

from cospeech.errors import CospeechError
from cospeech.foreign import parse_yaml, read_yaml, understood
from cospeech.motion.joint_map_values import (
    EVALUATION_JOINTS,
    TEMPLATE,
    JointBlend,
    JointMap,
    JointSource,
    checked_joint_map,
)
from cospeech.motion.skeleton import Skeleton

__all__ = [
    "EVALUATION_JOINTS",
    "JointBlend",
    "JointMap",
    "JointSource",
    "bare_names",
    "find_joint_map",
    "load_joint_map",
    "refuse_missing_joints",
]

MAX_MAP_BYTES = 2**16
_SEPARATORS = ":_-.| /"
_SHOWN_JOINTS = 100


def bare_names(skeleton: Skeleton) -> dict[str, int]:
    """Joint index by name, also without what all names begin with.

    ``mixamorig:Hips``, ``Character1_Hips``, ``Bip01 Hips`` and ``mixamorigHips`` are found as
    ``Hips``. A beginning ends where a word ends: of ``LHip`` and ``LKnee`` nothing is left out.
    """
    joints = [*enumerate(skeleton.joints)]
    names = {joint.rpartition(":")[2]: i for i, joint in reversed(joints)}
    prefix = _common_prefix(skeleton)
    if prefix:
        names |= {
            joint[len(prefix) :]: i
            for i, joint in reversed(joints)
            if joint.startswith(prefix) and len(joint) > len(prefix)
        }
    return names | skeleton.index


def _common_prefix(skeleton: Skeleton) -> str:
    """The longest whole words that every joint's name begins with, but perhaps the root's."""
    names = [joint for joint in skeleton.joints[1:] if joint not in skeleton.end_sites]
    if len(names) < 2:
        return ""
    # what the first and the last in order share, all between them share, too
    first, last = min(names), max(names)
    shared = [a == b for a, b in zip(first, last, strict=False)]
    for end in range(shared.index(False) if False in shared else len(shared), 0, -1):
        if all(len(name) > end and _begins_word(name, end) for name in names):
            return first[:end]
    return ""


def _begins_word(name: str, place: int) -> bool:
    before, after = name[place - 1], name[place]
    return before in _SEPARATORS or (after.isupper() and (before.islower() or before.isdigit()))


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
    return _read(path)


def find_joint_map(skeleton: Skeleton) -> JointMap:
    """The map that a skeleton carries, or else the one that fits its joint names.

    A map fits when the skeleton has every joint it names; of several, the one with most joints is
    taken.

    Args:
        skeleton: The skeleton; one that was read for a corpus carries the map that was chosen.

    Raises:
        CospeechError: The map it carries names joints that it lacks, or no map fits. The message
            lists the skeleton's joints and shows a map to fill in.
    """
    names = set(bare_names(skeleton))
    if skeleton.joint_map is not None:
        refuse_missing_joints(skeleton.joint_map, skeleton)
        return skeleton.joint_map
    candidates = _packaged().values()
    fitting = [joint_map for joint_map in candidates if joint_map.required <= names]
    if not fitting:
        raise CospeechError(
            f"no joint map fits the skeleton {skeleton.name!r}."
            f"\n{_what_fits(candidates, names)}"
            f"\nIts joints: {_listed(skeleton.joints)}",
            hint="write the joints of your skeleton into a file my_corpus.yaml like this one, and"
            f" pass its path (data.joint_map=my_corpus.yaml):\n{TEMPLATE}",
        )
    return max(fitting, key=lambda joint_map: (len(joint_map.required), joint_map.name))


def refuse_missing_joints(joint_map: JointMap, skeleton: Skeleton) -> None:
    """Say which joints of a map a skeleton lacks.

    Raises:
        CospeechError: It lacks one.
    """
    if missing := sorted(joint_map.required - set(bare_names(skeleton))):
        raise CospeechError(
            f"joint map {joint_map.name} needs {_listed(missing)}; skeleton {skeleton.name!r} has"
            f" {_listed(skeleton.joints)}",
            hint="choose another joint map (data.joint_map), or write one for this skeleton",
        )


def _listed(joints: Sequence[str]) -> str:
    more = len(joints) - _SHOWN_JOINTS
    shown = ", ".join(joint[:60] for joint in joints[:_SHOWN_JOINTS])
    return f"{shown} and {more} more" if more > 0 else shown


def _what_fits(candidates: Iterable[JointMap], names: set[str]) -> str:
    """Which map finds most of the evaluation joints here, and what it lacks."""

    def found(joint_map: JointMap) -> list[str]:
        roles = zip(EVALUATION_JOINTS, joint_map.joints, strict=True)
        return [role for role, source in roles if names.issuperset(source.needed)]

    nearest = max(
        candidates,
        key=lambda joint_map: (
            len(found(joint_map)),
            len(joint_map.required & names) / len(joint_map.required),
        ),
    )
    if not found(nearest):
        return "None of the packaged maps finds an evaluation joint in it."
    return (
        f"The nearest, {nearest.name}, finds {', '.join(found(nearest))}; it also needs:"
        f" {', '.join(sorted(nearest.required - names))}."
    )


@cache
def _packaged() -> dict[str, JointMap]:
    folder = files("cospeech.motion") / "joint_maps"
    maps = [
        checked_joint_map(path.stem, path, parse_yaml(path, file.read_text("utf-8"), "a joint map"))
        for file in folder.iterdir()
        if (path := Path(file.name)).suffix == ".yaml"
    ]
    return {joint_map.name: joint_map for joint_map in maps}


def _read(path: Path) -> JointMap:
    with understood(path, "a joint map", "check the path (data.joint_map)"):
        return checked_joint_map(path.stem, path, read_yaml(path, "a joint map", MAX_MAP_BYTES))
