"""ZeroEGGS: one actress, 67 monologues in 19 styles.

The ``clean`` folder holds ``NNN_Style_k_x_1_0.bvh`` and ``.wav``, synchronised, 60 fps; copies that
are mirrored (``_mirror_``) or played at another speed (``_x_0_9``) are augmentations. The
``original`` folder holds the takes as recorded, without these suffixes, not synchronised. The split
is the column ``validation`` of ``info.csv``; there is no test part. No transcripts. Axes are the
house's; centimetres become metres.
"""

from __future__ import annotations

import logging
import re
from dataclasses import replace
from pathlib import Path

from cospeech.errors import ContentError, CospeechError
from cospeech.foreign import understood
from cospeech.formats.mocap import MissingAudio, Take, find_takes
from cospeech.formats.mocap.finding import files_named
from cospeech.formats.mocap.takes import checked_ids
from cospeech.formats.tables import columns_of, read_table
from cospeech.quoting import setting

LICENCE = "ZeroEGGS: CC BY-NC-ND 4.0"
FPS = 60.0
SPEAKER = "zeggs"

NAME = re.compile(
    r"(?P<id>\d{3}_(?P<style>[A-Za-z]+)_\d+)(?P<mirror>_mirror)?(?:_[xyz]_(?P<speed>\d+_\d+))?"
)
"""Of a recording's files."""

_VALIDATION = {"true": "val", "false": "train"}

_log = logging.getLogger(__name__)


def find_zeggs_takes(root: str | Path, *, missing_audio: MissingAudio = "skip") -> list[Take]:
    """The recordings of ZeroEGGS below a folder.

    Augmented copies and the raw takes are left out.

    Raises:
        InputFileError: ``info.csv`` is broken.
        CospeechError: There is no such recording, or one lies there twice.
    """
    root = Path(root)
    infos = files_named(root, r"info\.csv")
    splits = _splits(infos[0]) if infos else {}
    if not infos:
        above = root.resolve().parent
        where = ""
        if (above / "info.csv").is_file():
            where = f"; it lies in the folder above: {setting('data.root', str(above))}"
        _log.warning("%s: no info.csv, so the published split is not known%s", root, where)
    takes = []
    for take in find_takes(root, missing_audio=missing_audio):
        match = NAME.fullmatch(take.path.stem)
        if match is None:
            continue
        take = replace(
            take,
            speaker=SPEAKER,
            split=splits.get(match["id"]),
            published_rate=FPS,
            annotations={"style": match["style"]},
            licence=LICENCE,
            tables=tuple(infos[:1]),
        )
        if match["mirror"] or match["speed"] not in ("1_0", None):
            what = "mirrored" if match["mirror"] else f"played at another speed ({match['speed']})"
            problem = f"{take.path.name} is a copy of {match['id']}, {what}"
            take = replace(take, problem=problem, left_out="augmented copy")
        elif match["speed"] is None:
            problem = f"{take.path.name} is a take as recorded, not synchronised"
            take = replace(take, problem=problem, left_out="not synchronised")
        takes.append(take)
    if all(take.left_out is not None for take in takes):
        raise CospeechError(
            f"no synchronised ZeroEGGS recording below {root}: looked for names such as"
            " 001_Neutral_0_x_1_0.bvh",
            hint="point data.root at the folder with clean and info.csv, unpacked from"
            " Zeggs_data.zip",
        )
    return checked_ids(takes)


def _splits(path: Path) -> dict[str, str]:
    """Recording -> split, by the sequence list; a mirrored copy is in its original's split."""
    header, *rows = read_table(path)
    splits: dict[str, str] = {}
    with understood(path, "a list of sequences"):
        columns = columns_of(header, {"bvh": ("anim_bvh",), "validation": ("validation",)})
        for row in rows:
            match = NAME.fullmatch(row.cell(columns["bvh"]).removesuffix(".bvh"))
            split = _VALIDATION.get(row.cell(columns["validation"]).lower())
            if match is None or split is None:
                problem = f"{', '.join(row.fields)[-60:]!r} is not a sequence and TRUE or FALSE"
                raise ContentError(problem, row.place)
            if splits.setdefault(match["id"], split) != split:
                raise ContentError(f"{match['id']} is in both splits", row.place)
    return splits
