"""`data=mocap`: any folder of BVH and audio, and what the mocap corpora share."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from cospeech.corpus.features.field import FieldSource
from cospeech.corpus.source import Source
from cospeech.doctor import examined_source
from cospeech.errors import ConfigError
from cospeech.formats.mocap import (
    MissingAudio,
    ReadingSettings,
    Take,
    find_takes,
    leave_out_unsplit,
    take_sources,
    with_split_list,
)
from cospeech.formats.phase_files.labels import phase_meanings
from cospeech.motion.bvh import UP_AXES, UpAxis
from cospeech.motion.joint_map import JointMap, load_joint_map
from cospeech.motion.joint_map_values import UNIT_SCALES
from data_modules.base import StoreDataModule

FRAME_RATES = (0.1, 1000.0)
"""Frames per second that motion can be kept at."""


@dataclass(kw_only=True, eq=False)
class MocapCorpus(StoreDataModule):
    """Takes of BVH motion and audio.

    Args:
        root: The folder.
        missing_audio: Motion without audio: ``"skip"`` it, read it with ``"silence"``, or
            ``"auto"``: with silence where no file may hold sound.
        frame_rate: Frames per second of all BVH rows, for files whose header is wrong.
        unit_scale: Metres per unit of the BVH files; None: by the joint map.
        up_axis: Vertical axis of the BVH files: ``"y"`` or ``"z"``.
        joint_map: Name of a packaged joint map or path of a yaml, for skeletons whose joint names
            aren't known; None: found by the names.
        phase_tier: Tier or track of the gesture phases in annotation files; None: found by its
            labels (`cospeech.formats.phase_files.read_phases`).
        phase_labels: What labels of the annotations mean, besides those known: text -> phase.
        split_list: Splits to use in the place of the corpus's own
            (`cospeech.formats.mocap.read_split_list`), with ``split="published"``.

    Raises:
        ConfigError: ``frame_rate`` or ``unit_scale`` is no usable number, ``up_axis`` no axis,
            ``phase_labels`` names no phase, or ``split`` is none of the four.
    """

    root: str
    missing_audio: MissingAudio = "skip"
    frame_rate: float | None
    unit_scale: float | None = None
    up_axis: UpAxis = "y"
    joint_map: str | None
    phase_tier: str | None = None
    phase_labels: Mapping[str, str] | None = None
    split_list: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        _refuse_number("frame_rate", self.frame_rate, FRAME_RATES, "frames per second")
        _refuse_number("unit_scale", self.unit_scale, UNIT_SCALES, "metres per unit of the files")
        if self.up_axis not in UP_AXES:
            raise ConfigError(f"data.up_axis={self.up_axis}: choose one of {', '.join(UP_AXES)}")
        given = self.phase_labels or {}
        if not isinstance(given, Mapping):
            raise ConfigError(
                f"data.phase_labels={given}: what each label means, or null",
                "for example 'data.phase_labels={go: stroke}'",
            )
        self.phase_labels = {str(text): label for text, label in given.items()}
        phase_meanings(self.phase_labels)

    def evaluation_joints(self) -> JointMap | None:
        """Where they are by the user's choice; None: found by the joints' names."""
        return None if self.joint_map is None else load_joint_map(self.joint_map)

    @abstractmethod
    def find_takes(self) -> list[Take]:
        """The corpus's takes, with its own split."""

    @property
    def lacks(self) -> frozenset[FieldSource]:
        """Words, where no take has a transcript."""
        has_words = any(take.transcripts for take in self._takes)
        return frozenset() if has_words else frozenset({"words"})

    @cached_property
    def _takes(self) -> list[Take]:
        """The takes with their splits, those in none left out where the published one is used."""
        takes = self.find_takes()
        if self.split_list is not None:
            takes = with_split_list(takes, self.split_list)
        return leave_out_unsplit(takes) if self.split == "published" else takes

    def find_sources(self) -> Sequence[Source]:
        """A source per take."""
        settings = ReadingSettings(
            frame_rate=self.frame_rate,
            unit_scale=self.unit_scale,
            up_axis=self.up_axis,
            joint_map=self.evaluation_joints(),
            phase_tier=self.phase_tier,
            phase_labels=self.phase_labels,
        )
        return [examined_source(source) for source in take_sources(self._takes, settings)]

    def settings(self) -> dict[str, Any]:
        """The corpus's own settings, of which tables are known by themselves."""
        elsewhere = {one.name for one in fields(StoreDataModule)}
        elsewhere |= {"root", "split_list", "offsets"}
        names = [one.name for one in fields(self) if one.name not in elsewhere]
        return {name: getattr(self, name) for name in names} | {
            "joint_map": repr(self.evaluation_joints())
        }


@dataclass(kw_only=True, eq=False)
class MocapData(MocapCorpus):
    """`data=mocap`: recordings as users have them.

    Args:
        speaker: Where a take's speaker is named: ``"folder"``, ``"prefix"`` or a regular
            expression (see `cospeech.formats.mocap.find_takes`).
        licence: Licence of the data, kept with each recording.
    """

    speaker: str
    licence: str

    @property
    def corpus_name(self) -> str:
        """Named after the folder, in characters that any path and shell takes as they are."""
        return "mocap-" + re.sub(r"[^\w.-]", "_", Path(self.root).resolve().name)

    def find_takes(self) -> list[Take]:
        """Files of equal stems below the folder."""
        takes = find_takes(self.root, speaker=self.speaker, missing_audio=self.missing_audio)
        return [replace(take, licence=self.licence) for take in takes]


def _refuse_number(name: str, value: Any, between: tuple[float, float], what: str) -> None:
    """Raise a `ConfigError` for a setting that is neither null nor a number in its range."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if value is not None and not (number and between[0] <= value <= between[1]):
        raise ConfigError(
            f"data.{name}={value}: {what}, a number from {between[0]:g} to {between[1]:g}, or null"
        )
