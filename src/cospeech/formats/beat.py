"""BEAT: BVH at 120 fps, wav and TextGrid per recording.

Files are called ``<speaker number>_<speaker>_<type>_<first>_<last>``, in a folder per speaker
number (``beat_english_v0.2.1/2/2_scott_0_1_1.bvh``). Beside them lie face weights (``.json``),
meanings (``.txt``) and emotions (``.csv``), which are no transcripts and are not read. Axes are the
house's; centimetres become metres.

Two published splits: a list (BEAT2's ``train_test_split.csv``), and the rule by file number of the
first edition's preprocessing notebook (PantoMatrix, ``dataloaders/preprocessing.ipynb``), for the
English recordings. For speakers of one hour that rule cuts recordings in two.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from cospeech.errors import CospeechError
from cospeech.formats.mocap import Excerpt, MissingAudio, Take, find_takes, with_split_list
from cospeech.formats.mocap.finding import files_named
from cospeech.formats.mocap.takes import checked_ids

LICENCE = "BEAT: non-commercial research only"
FPS = 120.0

NAME = re.compile(r"(\d{1,2})_([a-z]+)_([0-7])_(\d+)_(\d+)", re.IGNORECASE)
"""Of a recording's files."""

_LANGUAGES = ("English", "Chinese", "Spanish", "Japanese")
_EMOTIONS = (
    (64, "neutral"),
    (72, "happiness"),
    (80, "anger"),
    (86, "sadness"),
    (94, "contempt"),
    (102, "surprise"),
    (110, "fear"),
    (118, "disgust"),
)
"""Last number of each emotion's recordings of self-talk."""

_LONG_SPEAKERS = {1, 2, 3, 4, 6, 7, 8, 9, 11, 21}
"""Speakers of four hours; the others have one."""
_FIRST_OF_EMOTION = {65, 73, 81, 87, 95, 103, 111}
_LAST_OF_EMOTION = {72, 80, 86, 94, 102, 110, 118}
_HALF_S = {"talk": 30.0, "conversation": 300.0}


def find_beat_takes(
    root: str | Path,
    *,
    split_list: str | Path | None = None,
    missing_audio: MissingAudio = "skip",
) -> list[Take]:
    """The recordings of BEAT below a folder.

    Args:
        root: The folder.
        split_list: A list of splits (`read_split_list`); None: ``train_test_split.csv`` where one
            lies below the folder, else the first edition's rule. By that, the recordings it cuts
            are two takes, ``..._a`` and ``..._b``.
        missing_audio: As for `find_takes`.

    Raises:
        InputFileError: The list can't be read.
        CospeechError: There is no such recording, or one lies there twice.
    """
    root = Path(root)
    lists = [Path(split_list)] if split_list else files_named(root, r"train_test_split\.csv")
    takes: list[Take] = []
    for take in find_takes(root, missing_audio=missing_audio, transcripts=(".textgrid",)):
        match = NAME.fullmatch(take.path.stem)
        if match is None:
            continue
        take = replace(
            take,
            id=take.path.stem,
            speaker=match[2].lower(),
            published_rate=FPS,
            annotations=_about(int(match[3]), int(match[4]), int(match[5])),
            licence=LICENCE,
        )
        number, kind, first, last = (int(match[i]) for i in (1, 3, 4, 5))
        takes += [take] if lists else _by_rule(take, number, kind, first, last)
    if not takes:
        raise CospeechError(
            f"no BEAT recording below {root}: looked for names such as 2_scott_0_1_1.bvh",
            hint="point data.root at the unpacked beat_english_v0.2.1 (BEAT2 has no BVH files)",
        )
    takes = checked_ids(takes)
    return with_split_list(takes, lists[0]) if lists else takes


def published_split(speaker: int, kind: int, number: int) -> str | None:
    """Split of an English recording by the first edition's rule.

    Args:
        speaker: Speaker number, 1 to 30.
        kind: 0 for self-talk, 1 for conversation.
        number: Number of the recording.

    Returns:
        ``"train"``, ``"val"``, ``"test"``, or ``"halves"`` where the first half tests and the
        second validates; None for other languages.
    """
    if kind > 1:
        return None
    is_long = speaker in _LONG_SPEAKERS
    if kind == 1:
        if number == 1:
            return "test" if is_long else "halves"
        return "val" if is_long and number == 12 else "train"
    if number in _FIRST_OF_EMOTION:
        return "test" if is_long else "halves"
    if is_long:
        if number in _LAST_OF_EMOTION or 57 <= number <= 64:
            return "val"
        return "test" if 1 <= number <= 8 else "train"
    if 1 <= number <= 4:
        return "test"
    return "val" if 5 <= number <= 8 else "train"


def _by_rule(take: Take, speaker: int, kind: int, first: int, last: int) -> Iterator[Take]:
    # one file per number: the uncut edition (2_scott_0_1_8) has no published split
    split = published_split(speaker, kind, first) if first == last else None
    if split != "halves":
        yield replace(take, split=split)
        return
    half = _HALF_S["talk" if kind == 0 else "conversation"]
    for suffix, name, excerpt in (
        ("a", "test", Excerpt(duration=half)),
        ("b", "val", Excerpt(motion_start=half, audio_start=half)),
    ):
        yield replace(take, id=f"{take.id}_{suffix}", split=name, excerpt=excerpt)


def _about(kind: int, first: int, last: int) -> dict[str, str]:
    about = {"language": _LANGUAGES[kind // 2]}
    about["recording_type"] = "conversation" if kind % 2 else "talk"
    if kind % 2 == 0:
        emotions = {next((e for end, e in _EMOTIONS if n <= end), None) for n in (first, last)}
        if len(emotions) == 1 and None not in emotions:
            about["emotion"] = str(emotions.pop())
    return about
