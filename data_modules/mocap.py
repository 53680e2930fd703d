"""`data=mocap`: any folder of BVH and audio, and what the mocap corpora share."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from cospeech.corpus.source import Source
from cospeech.formats.mocap import (
    MissingAudio,
    Take,
    find_takes,
    leave_out_unsplit,
    take_sources,
    with_split_list,
)
from cospeech.motion.joint_map import JointMap, load_joint_map
from data_modules.base import StoreDataModule


@dataclass(kw_only=True, eq=False)
class MocapCorpus(StoreDataModule):
    """Takes of BVH motion and audio.

    Args:
        root: The folder.
        missing_audio: Motion without audio: ``"skip"`` it, read it with ``"silence"``, or
            ``"auto"``: with silence where there is no audio at all.
        frame_rate: Frames per second of all BVH rows, for files whose header is wrong.
        joint_map: Name of a packaged joint map or path of a yaml, for skeletons whose joint names
            aren't known; None: found by the names.
        split_list: Splits to use in the place of the corpus's own
            (`cospeech.formats.mocap.read_split_list`), with ``split="published"``.
    """

    root: str
    missing_audio: MissingAudio = "skip"
    frame_rate: float | None
    joint_map: str | None
    split_list: str | None = None

    def evaluation_joints(self) -> JointMap | None:
        """The user's choice, if any."""
        return None if self.joint_map is None else load_joint_map(self.joint_map)

    @abstractmethod
    def find_takes(self) -> list[Take]:
        """The corpus's takes, with its own split."""

    def find_sources(self) -> Sequence[Source]:
        """A source per take."""
        takes = self.find_takes()
        if self.split_list is not None:
            takes = with_split_list(takes, self.split_list)
        if self.split == "published":
            takes = leave_out_unsplit(takes)
        return take_sources(takes, frame_rate=self.frame_rate, joint_map=self.evaluation_joints())

    def settings(self) -> dict[str, Any]:
        """The corpus's own settings; what tables and joint maps say is known by themselves."""
        elsewhere = {field.name for field in fields(StoreDataModule)}
        elsewhere |= {"root", "split_list", "offsets", "joint_map"}
        names = [field.name for field in fields(self) if field.name not in elsewhere]
        return {name: getattr(self, name) for name in names}


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
