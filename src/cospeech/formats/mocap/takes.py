"""A take: the files of one recording before any of them is opened."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cospeech.corpus.recording import Remark
from cospeech.errors import CospeechError
from cospeech.motion.bvh import UpAxis
from cospeech.motion.joint_map import JointMap


@dataclass(frozen=True)
class Voice:
    """The other side of a dialogue.

    Attributes:
        audio: The sound file, on the clock of the take's own audio.
        transcripts: Its words, the preferred first.
    """

    audio: Path
    transcripts: tuple[Path, ...] = ()


@dataclass(frozen=True)
class Excerpt:
    """The part of a take's files that is used, and how their clocks lie to each other.

    Attributes:
        motion_start: Second of the motion file at which the excerpt starts.
        audio_start: Second of the audio file (and of its transcript) at the same moment.
        duration: Length, s; None for all there is.
    """

    motion_start: float = 0.0
    audio_start: float = 0.0
    duration: float | None = None


@dataclass(frozen=True)
class Take:
    """The files of one take, not yet opened.

    Attributes:
        id: Unique in the corpus; letters, digits, ``-``, ``_``, ``.``.
        speaker: Speaker name.
        motion: The BVH file.
        sounds: The sound files, the preferred first; the next is tried where one can't be read, and
            none is where the motion is to be read with silence.
        transcripts: The transcripts, likewise.
        problem: Why the take can't be used; None when it can.
        left_out: In a word or two, where the corpus itself gives reason not to use the take (the
            sentence is in ``problem``): it is dropped, and that is no mistake.
        phase_files: Gesture-phase annotations on the motion's clock (ANVIL, ELAN or csv), likewise.
        split: ``"train"``, ``"val"`` or ``"test"`` by the corpus's published split.
        interlocutor: The other side of the dialogue.
        excerpt: The part of the files that is used.
        published_rate: Frames per second that the corpus was published at; a file at another rate
            is read all the same, with a warning.
        annotations: What is known about the take, as JSON values.
        warnings: What its user should know.
        licence: Licence of the corpus.
        tables: Files that say something about the take (splits, offsets, speakers), so that a
            change of theirs makes another corpus.
        no_audio: That there is no sound file, and what was looked for; empty where there is one.
    """

    id: str
    speaker: str
    motion: Path | None
    sounds: tuple[Path, ...] = ()
    transcripts: tuple[Path, ...] = ()
    problem: str | None = None
    left_out: str | None = None
    phase_files: tuple[Path, ...] = ()
    split: str | None = None
    interlocutor: Voice | None = None
    excerpt: Excerpt = Excerpt()
    published_rate: float | None = None
    annotations: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[Remark, ...] = ()
    licence: str = ""
    tables: tuple[Path, ...] = ()
    no_audio: str = ""

    @property
    def path(self) -> Path:
        """The motion file, else the audio file."""
        path = self.motion or self.audio
        if path is None:
            raise ValueError(f"take {self.id} has no file")
        return path

    @property
    def audio(self) -> Path | None:
        """The preferred sound file."""
        return self.sounds[0] if self.sounds else None

    @property
    def files(self) -> tuple[Path, ...]:
        """Every file that reading the take may open, and the tables it was found by."""
        other = self.interlocutor
        paths = [] if self.motion is None else [self.motion]
        paths += [*self.sounds, *self.transcripts, *self.phase_files]
        paths += [] if other is None else [other.audio, *other.transcripts]
        return (*paths, *self.tables)


@dataclass(frozen=True)
class ReadingSettings:
    """How the files of takes are read.

    Attributes:
        joint_map: Where the evaluation joints are; None: found by the joints' names.
        frame_rate: Frames per second of BVH rows, where the headers are wrong.
        unit_scale: Metres per unit of BVH files; None: by the joint map.
        up_axis: Vertical axis of BVH files (`cospeech.motion.bvh.read_bvh`).
        phase_tier: Tier or track of the gesture phases in annotation files (`read_phases`).
        phase_labels: What the annotations' own labels mean: text -> phase.
        licence: Licence of takes that have none of their own.
    """

    joint_map: JointMap | None = None
    frame_rate: float | None = None
    unit_scale: float | None = None
    up_axis: UpAxis = "y"
    phase_tier: str | None = None
    phase_labels: Mapping[str, str] | None = None
    licence: str = ""


AS_FILES_SAY = ReadingSettings()


def checked_ids(takes: Iterable[Take]) -> list[Take]:
    """Takes sorted by id.

    Raises:
        CospeechError: Two takes have one id, as when a copy of a corpus lies inside it.
    """
    by_id: dict[str, list[Take]] = defaultdict(list)
    for take in takes:
        by_id[take.id].append(take)
    for name, same in by_id.items():
        if len(same) > 1:
            raise CospeechError(
                f"two files are recording {name}: {same[0].path} and {same[1].path}",
                hint="point data.root at one copy of the corpus",
            )
    return [by_id[name][0] for name in sorted(by_id)]
