"""Trinity Speech-Gesture I and II: the GENEA 2020 release, and the takes as recorded.

Two layouts. The **GENEA Challenge 2020 release** has synchronised excerpts: ``Training_data`` and
``Test_data``, each with ``Audio``, ``Motion`` and ``Transcripts``, of ``Recording_NNN`` and
``TestSeqNNN`` at 60 fps; Gesticulator's scripts rename them to ``NaturalTalking_NNN[_2]``, by which
they are called here, too. The **raw** takes are not synchronised and need an offset table
(`trinity_offsets`). Axes are the house's; centimetres become metres; the motion stays in world
space.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

from cospeech.corpus.recording import Remark
from cospeech.errors import ConfigError, CospeechError
from cospeech.formats.mocap import MissingAudio, Take, find_takes, with_split_list
from cospeech.formats.mocap.takes import checked_ids
from cospeech.formats.trinity_offsets import find_offsets

LICENCE = "Trinity Speech-Gesture dataset: research only, by agreement with Trinity College Dublin"
GENEA_FPS = 60.0

TRAINING = {
    1: "027_2", 2: "030", 3: "023", 4: "018", 5: "025", 6: "017", 7: "026", 8: "022", 9: "021_2",
    10: "019", 11: "016", 12: "012", 13: "015", 14: "011", 15: "014", 16: "001", 17: "013",
    18: "002", 19: "005", 20: "004", 21: "007", 22: "008", 23: "010",
}  # fmt: skip
"""``Recording_NNN`` of the GENEA 2020 release -> number of the Trinity take, ``_2`` for a second
part."""
TEST = {
    1: "014_2", 2: "011_2", 3: "021", 4: "022_2", 5: "026_2", 6: "017_2", 7: "025_2", 8: "018_2",
    9: "030_2", 10: "027",
}  # fmt: skip
"""``TestSeqNNN`` of the GENEA 2020 release -> number of the Trinity take."""
CHALLENGE_VALIDATION = ("001", "002")
"""Of the training data, what validates here: the development takes of Gesticulator's split."""

_RELEASED = {"val": range(1, 3), "test": range(3, 6), "train": range(6, 31)}
_GENEA_NAME = re.compile(r"(recording|testseq)_?(\d{3})", re.IGNORECASE)
_TAKE_NAME = re.compile(r"naturaltalking_(\d{2,3})(_2)?", re.IGNORECASE)
NAMES = (_GENEA_NAME, _TAKE_NAME)
"""Of the files of a recording: in the GENEA release, and as everywhere else."""

_PART_II = re.compile(r"(speech[-_ ]?gesture|trinity)[-_ ]*(ii|2)(?![a-z0-9])", re.IGNORECASE)
_RAW_NAME = re.compile(r"(?:naturaltalking_(\d{3})|.*?(\d{1,3})$)", re.IGNORECASE)

_log = logging.getLogger(__name__)


def find_trinity_takes(
    root: str | Path,
    *,
    split_rule: str | None = "released",
    layout: str = "auto",
    offsets: str | Path | None = None,
    missing_audio: MissingAudio = "skip",
    split_list: str | Path | None = None,
) -> list[Take]:
    """The takes of Trinity I and II below a folder.

    Where the folder holds the GENEA release beside the raw takes, the release is read.

    Args:
        root: The folder of the release, of the raw takes, or of a whole download.
        split_rule: ``"released"``: Gesticulator's split by take number, 1-2 to validate, 3-5 to
            test, 6-30 to train; second parts (``_2``) are in no split, as in its code. It trains on
            recordings that the GENEA challenge tests on (021 and 027), which is logged and noted.
            ``"challenge"``: ``Training_data`` trains, of it 001 and 002 validate, ``Test_data``
            tests. None: the takes are in no split, as for a split of one's own.
        layout: ``"synchronised"``, ``"raw"`` or ``"auto"``, by the names: raw takes have neither
            second parts nor transcripts.
        offsets: Offset table of raw takes; looked for beside them when None.
        missing_audio: As for `find_takes`.
        split_list: Splits in the place of the rule's (`mocap.read_split_list`), by Trinity names.
            Training with recordings that the challenge tests on is warned of all the same.

    Raises:
        ConfigError: An argument is none of its choices.
        InputFileError: The split list or the offset table can't be read.
        CospeechError: There is no Trinity take, or raw takes without an offset table, or the
            challenge split is asked of takes that don't have it.
    """
    if split_rule not in ("released", "challenge", None):
        raise ConfigError(f"split_rule={split_rule}: choose released or challenge")
    if layout not in ("auto", "synchronised", "raw"):
        raise ConfigError(f"layout={layout}: choose auto, synchronised or raw")
    root = Path(root)
    found = find_takes(root, missing_audio=missing_audio, transcripts=(".json",))
    released = [take for take in found if _GENEA_NAME.fullmatch(take.path.stem)]
    takes = released or found
    if released and len(found) > len(released):
        _log.info("%s: the GENEA release is read, not the %d other files", root, len(found))
    if layout == "auto":
        synchronised = released or any(_is_release_file(take) for take in takes)
        layout = "synchronised" if synchronised else "raw"
    takes = _raw_takes(root, takes, offsets) if layout == "raw" else _renamed(root, takes)
    if split_rule is None:
        return checked_ids(takes)
    if split_rule == "released":
        takes = [replace(take, split=released_split(take.id)) for take in takes]
    elif layout == "raw":
        raise CospeechError(
            "the challenge split is one of the GENEA 2020 release's excerpts, not of raw takes",
            hint="read the GENEA release, or set data.split_rule=released",
        )
    else:
        takes = [replace(take, split=challenge_split(take.id)) for take in takes]
    if split_list is not None:
        takes = with_split_list(takes, split_list)
        return checked_ids(_with_overlap_warning(takes, f"the split list {Path(split_list).name}"))
    return checked_ids(_with_overlap_warning(takes, "the released split"))


def released_split(name: str) -> str | None:
    """Split of ``NaturalTalking_NNN[_2]`` in Gesticulator's release; None for second parts."""
    match = _TAKE_NAME.fullmatch(name)
    if match is None or match[2]:
        return None
    return next((s for s, numbers in _RELEASED.items() if int(match[1]) in numbers), None)


def challenge_split(name: str) -> str | None:
    """Split of ``NaturalTalking_NNN[_2]`` in the GENEA Challenge 2020."""
    number = name.removeprefix("NaturalTalking_")
    if number in TEST.values():
        return "test"
    if number in TRAINING.values():
        return "val" if number in CHALLENGE_VALIDATION else "train"
    return None


def _is_release_file(take: Take) -> bool:
    match = _TAKE_NAME.fullmatch(take.path.stem)
    return match is not None and (match[2] is not None or bool(take.transcripts))


def _renamed(root: Path, takes: Iterable[Take]) -> list[Take]:
    """Takes of the synchronised release under their Trinity names."""
    renamed = []
    for take in takes:
        genea = _GENEA_NAME.fullmatch(take.path.stem)
        own = _TAKE_NAME.fullmatch(take.path.stem)
        if genea is not None:
            table = TRAINING if genea[1].lower() == "recording" else TEST
            number = table.get(int(genea[2]))
        elif own is not None:
            # Gesticulator's renaming fills up to three characters, of which "_2" are two.
            number = f"{int(own[1]):03d}{own[2] or ''}"
        elif _part(take) == 2 and (raw_number := _raw_number(take)) is not None:
            renamed.append(_of_part(take, 2, raw_number))
            continue
        else:
            continue
        if number is None:
            problem = f"{take.path.name} is not in the release's table of recordings"
            renamed.append(replace(take, problem=problem, licence=LICENCE))
            continue
        annotations = {"genea_2020": take.path.stem} if genea is not None else {}
        renamed.append(
            replace(
                take,
                id=f"NaturalTalking_{number}",
                speaker="trinity_1",
                published_rate=GENEA_FPS,
                annotations=annotations,
                licence=LICENCE,
            )
        )
    return renamed or _nothing(root)


def _raw_takes(root: Path, takes: Iterable[Take], table: str | Path | None) -> list[Take]:
    """Takes as recorded, cut and shifted by the offset table."""
    raw = []
    for take in takes:
        number = _raw_number(take)
        if number is None or take.motion is None:
            continue
        if table is None and "from_clap" in take.motion.parent.name.lower():
            raise CospeechError(
                f"{take.motion.parent} holds motion cut at the clap; no offsets of it are known",
                hint="use the GENEA release, or give your own table of offsets (data.offsets=FILE)",
            )
        offsets = find_offsets(take.motion, root, table)
        if offsets is None:
            raise CospeechError(
                f"{take.motion} is a take as recorded: its audio starts seconds to minutes off the"
                " motion, and no offset table (offsets.csv or AlignmentTimes.csv) lies beside it",
                hint="use GENEA_Challenge_2020_data_release, which is synchronised; or put the"
                " table into the folder (data.offsets=FILE); or, if you synchronised the files"
                " yourself, set data.layout=synchronised",
            )
        take = replace(_of_part(take, _part(take), number), tables=(offsets.path,))
        pieces = offsets.excerpts.get(number, [])
        if not pieces:
            problem = f"take {number} is not in the offset table {offsets.path.name}"
            raw.append(replace(take, problem=take.problem or problem))
        for i, excerpt in enumerate(pieces, start=1):
            raw.append(replace(take, id=take.id + (f"_{i}" if i > 1 else ""), excerpt=excerpt))
    return raw or _nothing(root)


def _of_part(take: Take, part: int, number: int) -> Take:
    """A take as recorded under its name; part I changed its rate after take 21."""
    rate = 60.0 if part == 1 and number > 21 else 120.0
    name = "NaturalTalking" if part == 1 else "Trinity2"
    return replace(
        take,
        id=f"{name}_{number:03d}",
        speaker=f"trinity_{part}",
        published_rate=rate,
        licence=LICENCE,
    )


def _part(take: Take) -> int:
    return 2 if _PART_II.search(take.path.parent.as_posix()) else 1


def _raw_number(take: Take) -> int | None:
    match = _RAW_NAME.match(take.path.stem.removeprefix("q_"))
    return None if match is None else int(match[1] or match[2])


def _with_overlap_warning(takes: list[Take], split: str) -> list[Take]:
    overlap = {f"NaturalTalking_{number}" for number in TEST.values()}
    trained = sorted(take.id for take in takes if take.split == "train" and take.id in overlap)
    if not trained:
        return takes
    warning = (
        f"{split} trains on a test recording of the GENEA Challenge 2020; don't compare a model"
        " trained with it with challenge systems"
    )
    _log.warning(
        "%s: %s. data.split_rule=challenge holds the test recordings out",
        ", ".join(trained),
        warning,
    )
    advice = "data.split_rule=challenge"
    remark = Remark("trains on a test recording of the GENEA Challenge 2020", warning, advice)
    return [
        replace(take, warnings=(*take.warnings, remark)) if take.id in trained else take
        for take in takes
    ]


def _nothing(root: Path) -> NoReturn:
    raise CospeechError(
        f"no Trinity recording below {root}: looked for Recording_NNN, TestSeqNNN and"
        " NaturalTalking_NNN as .bvh and .wav",
        hint="point data.root at GENEA_Challenge_2020_data_release (Training_data, Test_data)",
    )
