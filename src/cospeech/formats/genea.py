"""GENEA Challenges 2022 and 2023: Talking With Hands, one speaker and dialogues.

Files are called ``<split>_<year>_<version>_<number>[_<role>]``, split ``trn``, ``val`` or ``tst``.
**2022** has ``<split>/{bvh,wav,tsv}`` and ``<split>_metadata.csv`` without a header (name,
fingers, speaker). **2023** has ``<split>/{main-agent,interloctr}/{bvh,wav,tsv}`` and
``<split>/metadata.csv`` with a header; the main agent is the recording, the other side its
interlocutor. Its training data hold each dialogue twice, once from each side, so only the published
split keeps dialogues apart.

30 fps; axes are the house's; centimetres become metres. Position channels replace the offset of
their joint (the challenge's own converter added the two and doubled every bone).
"""

from __future__ import annotations

import logging
import re
from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path

from cospeech.errors import ContentError, CospeechError, InputFileError
from cospeech.foreign import understood
from cospeech.formats.mocap import MissingAudio, Take, Voice, find_takes
from cospeech.formats.mocap.finding import files_named
from cospeech.formats.mocap.takes import checked_ids
from cospeech.formats.tables import Row, columns_of, read_table

LICENCE = "Talking With Hands 16.2M (GENEA edition): CC BY-NC 4.0"
FPS = 30.0
MAIN, OTHER = "main-agent", "interloctr"
UNKNOWN_SPEAKER = "unknown"

NAME = re.compile(r"((trn|val|tst)_(20\d\d)_v\d+_\d+)(?:_(main-agent|interloctr))?", re.IGNORECASE)
"""Of a recording's files."""

_SPLITS = {"trn": "train", "val": "val", "tst": "test"}

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Speakers:
    """What the metadata say of a recording.

    Attributes:
        main: Speaker number.
        fingers: Whether the motion has finger capture.
        other: Number of the interlocutor; None in 2022.
        table: Where it is said.
    """

    main: int
    fingers: bool
    other: int | None
    table: Path


def find_genea_takes(root: str | Path, *, missing_audio: MissingAudio = "skip") -> list[Take]:
    """The recordings of GENEA 2022 or 2023 below a folder.

    Speakers are called ``twh_NN`` by their number in the metadata, which is the same in all splits;
    one without metadata is called ``unknown``, with a warning. The test recordings of a challenge
    whose motion was kept back are left out.

    Raises:
        InputFileError: A metadata table is broken or contradicts another.
        CospeechError: There is no such recording, or one lies there twice.
    """
    root = Path(root)
    sides: dict[tuple[str, str], list[Take]] = defaultdict(list)
    for take in find_takes(root, missing_audio=missing_audio, transcripts=(".tsv",)):
        match = NAME.fullmatch(take.path.stem)
        if match is not None:
            side = OTHER if (match[4] or "").lower() == OTHER else MAIN
            sides[match[1].lower(), side].append(take)
    if not any(side == MAIN for _, side in sides):
        raise CospeechError(
            f"no GENEA recording below {root}: looked for trn_2022_v1_000.bvh (2022) and"
            " main-agent/bvh/trn_2023_v0_000_main-agent.bvh (2023)",
            hint="unpack the challenge's zip files and point data.root at their folder",
        )
    years = sorted({name.split("_")[1] for name, _ in sides})
    if len(years) > 1:
        raise CospeechError(
            f"{root} holds the editions {' and '.join(years)}, which overlap: what 2022 validates"
            " with, 2023 trains with",
            hint="point data.root at the folder of one of them",
        )
    speakers = _all_speakers(root)
    takes = []
    for (name, side), same in sides.items():
        if side == MAIN:
            others = sides.get((name, OTHER), [])
            takes += [_recording(take, name, speakers.get(name), others) for take in same]
    unknown = sum(take.speaker == UNKNOWN_SPEAKER for take in takes)
    if unknown:
        _log.warning(
            "%s: %d of %d recordings have no line in a metadata.csv; their speaker is unknown",
            *(root, unknown, len(takes)),
        )
    return checked_ids(takes)


def _recording(take: Take, name: str, said: Speakers | None, others: list[Take]) -> Take:
    take = replace(
        take,
        id=name,
        speaker=UNKNOWN_SPEAKER,
        split=_SPLITS[name[:3]],
        published_rate=FPS,
        licence=LICENCE,
    )
    if said is not None:
        annotations: dict[str, object] = {"fingers": said.fingers}
        if said.other is not None:
            annotations["interlocutor_speaker"] = f"twh_{said.other:02d}"
        take = replace(
            take, speaker=f"twh_{said.main:02d}", annotations=annotations, tables=(said.table,)
        )
    if take.motion is None and name.startswith("tst"):
        problem = f"{name}: the challenge kept the motion of its test recordings back"
        return replace(take, problem=problem, left_out="no motion in the release")
    audio = others[0].audio if others else None
    if audio is not None:
        take = replace(take, interlocutor=Voice(audio, others[0].transcripts))
    return take


def _all_speakers(root: Path) -> dict[str, Speakers]:
    speakers: dict[str, Speakers] = {}
    for path in files_named(root, r"(\w+_)?metadata\.csv"):
        for name, said, place in _read_metadata(path):
            old = speakers.setdefault(name, said)
            if replace(old, table=path) != said:
                raise InputFileError(
                    path, f"{name} has another speaker in {old.table}", place, "remove one of them"
                )
    return speakers


def _read_metadata(path: Path) -> list[tuple[str, Speakers, str]]:
    """Lines of either year's table that describe a recording."""
    rows = read_table(path)
    with understood(path, "a table of metadata"):
        columns = {"name": 0, "fingers": 1, "main": 2}
        if not NAME.fullmatch(rows[0].fields[0]):
            columns = columns_of(rows[0], _spellings(rows[0]))
            rows = rows[1:]
        said = []
        for row in rows:
            name = row.cell(columns["name"]).lower()
            if not NAME.fullmatch(name):
                problem = f"{name[:40]!r} is no recording"
                raise ContentError(problem, row.place, "expected trn_2023_v0_000")
            fingers = row.cell(columns["fingers"]).lower()
            other = _speaker(row, columns["other"]) if "other" in columns else None
            main = _speaker(row, columns["main"])
            said.append((name, Speakers(main, fingers.endswith("_incl"), other, path), row.place))
    return said


def _spellings(header: Row) -> dict[str, tuple[str, ...]]:
    wanted: dict[str, tuple[str, ...]] = {
        "name": ("prefix", "fname", "filename", "name"),
        "main": ("main-agent_id", "speaker_id", "userid", "speaker"),
        "fingers": ("main-agent_has_fingers", "has_fingers", "fingers", "has_finger", "finger"),
    }
    if any("interloctr" in field.lower() for field in header.fields):
        wanted["other"] = ("interloctr_id",)
    return wanted


def _speaker(row: Row, column: int) -> int:
    text = row.cell(column)
    if not (text.isascii() and text.isdigit() and len(text) <= 4):
        problem = f"{text[:40]!r} is not a speaker's number"
        raise ContentError(problem, row.place, "expected 1, 2, ...")
    return int(text)
