"""Splits given as a file."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from cospeech.errors import ContentError, CospeechError, InputFileError
from cospeech.foreign import understood
from cospeech.formats.mocap.takes import Take
from cospeech.formats.tables import columns_of, read_table

_SPLITS = {
    "train": "train",
    "trn": "train",
    "training": "train",
    "val": "val",
    "valid": "val",
    "validation": "val",
    "dev": "val",
    "test": "test",
    "tst": "test",
}
_UNUSED = {"additional", "none", ""}  # BEAT2: more data that its published split leaves out

_WHAT = "a list of splits"

_log = logging.getLogger(__name__)


def read_split_list(path: str | Path) -> dict[str, str | None]:
    """Split of each recording by a list.

    Args:
        path: A csv with the columns ``id`` and ``type`` or ``split`` (BEAT2's
            ``train_test_split.csv``), or a folder of ``train.txt``, ``val.txt`` and ``test.txt``
            with a recording per line.

    Returns:
        Recording id -> ``"train"``, ``"val"``, ``"test"``, or None where the list names a recording
        that no split uses.

    Raises:
        InputFileError: Not there, not such a list, or a recording is in two splits.
    """
    path = Path(path)
    found: dict[str, str | None] = {}

    def put(name: str, split: str | None, place: str) -> None:
        if found.setdefault(name, split) != split:
            problem = f"{name} is in {found[name]} and in {split}"
            raise ContentError(problem, place, "keep one of the two")

    if path.is_dir():
        files = [p for p in sorted(path.glob("*.txt")) if _SPLITS.get(p.stem.lower())]
        if not files:
            raise InputFileError(path, "has no train.txt, val.txt or test.txt", None, "check it")
        for file in files:
            for row in read_table(file):
                with understood(file, _WHAT):
                    put(row.fields[0], _SPLITS[file.stem.lower()], row.place)
        return found
    header, *rows = read_table(path)
    with understood(path, _WHAT):
        columns = columns_of(header, {"id": ("id", "name", "file"), "split": ("type", "split")})
        for row in rows:
            name, split = row.cell(columns["id"]), row.cell(columns["split"]).lower()
            if split not in _SPLITS and split not in _UNUSED:
                problem = f"{name} is of type {split!r}"
                raise ContentError(problem, row.place, "write train, val or test")
            put(name, _SPLITS.get(split), row.place)
    return found


def with_split_list(takes: Iterable[Take], path: str | Path) -> list[Take]:
    """Takes with the splits of a list in the place of their own.

    A take that is not in the list is in no split.

    Raises:
        InputFileError: The list can't be read.
        CospeechError: It names none of the takes.
    """
    path = Path(path)
    splits, takes = read_split_list(path), list(takes)
    known = {take.id for take in takes} & splits.keys()
    if not known:
        raise CospeechError(
            f"the split list {path} names none of the {len(takes)} recordings",
            hint=f"recordings are called {', '.join(take.id for take in takes[:3])} ...;"
            f" the list has {', '.join(list(splits)[:3])} ...",
        )
    tables = (path,) if path.is_file() else tuple(sorted(path.glob("*.txt")))
    listed = []
    for take in takes:
        known_by = tuple(dict.fromkeys((*take.tables, *tables)))
        listed.append(replace(take, split=splits.get(take.id), tables=known_by))
    counts = Counter(take.split for take in listed)
    _log.info(
        "%s: %d train, %d val, %d test; %d recordings are in no split, %d names have no recording",
        *(path.name, counts["train"], counts["val"], counts["test"], counts[None]),
        len(splits) - len(known),
    )
    return listed


def leave_out_unsplit(takes: Iterable[Take]) -> list[Take]:
    """Takes of which those that are in no split are left out.

    Raises:
        CospeechError: None is in a split.
    """
    takes = list(takes)
    if not any(take.split for take in takes):
        raise CospeechError(
            f"none of the {len(takes)} recordings is in a published split",
            hint="split them here (data.split=recordings, speakers or time_blocks), or give a list"
            " (data.split_list=FILE)",
        )
    return [
        take
        if take.split or take.problem
        else replace(
            take, problem=f"{take.id} is in no published split", left_out="in no published split"
        )
        for take in takes
    ]
