"""Which published layout a folder has, and what lies in it."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from cospeech.corpus.source import Source
from cospeech.errors import ConfigError, CospeechError
from cospeech.formats import beat, genea, trinity, zeggs
from cospeech.formats.berkeley.extension3d import find_3d_sources, list_3d_files
from cospeech.formats.berkeley.keypoints2d import find_2d_sources
from cospeech.formats.berkeley.layout import FRAME_TABLES, SAMPLE_TABLE
from cospeech.formats.mocap import Take, find_takes
from cospeech.formats.mocap.finding import files_named
from cospeech.formats.ted_lmdb import DATABASES, find_ted_sources
from cospeech.formats.uci_phases import find_uci_sources

MOST_NAMES = 0.5
"""Share of the BVH files whose names must be those of a corpus."""


@dataclass(frozen=True)
class Layout:
    """A layout that the doctor knows.

    Attributes:
        name: What it is called, as in ``data=NAME``.
        is_here: Whether a folder looks like it; opens no file.
        find: The folder's takes or sources.
    """

    name: str
    is_here: Callable[[Path], bool]
    find: Callable[[Path], Sequence[Take] | Sequence[Source]]


def find_layout(root: Path, name: str | None = None) -> Layout:
    """The layout of a folder.

    Args:
        root: The folder.
        name: Of a known layout, to read the folder as that; None: found by the names of its files.

    Raises:
        ConfigError: No layout has that name.
        CospeechError: The folder is absent, or looks like none of them.
    """
    if name is not None:
        for layout in LAYOUTS:
            if layout.name == name:
                return layout
        known = ", ".join(layout.name for layout in LAYOUTS)
        raise ConfigError(f"no layout is called {name!r}", hint=f"choose one of {known}")
    if not root.is_dir():
        raise CospeechError(f"{root} is not a folder", hint="check the path")
    for layout in LAYOUTS:
        if layout.is_here(root):
            return layout
    raise CospeechError(
        f"{root} holds nothing that is known: no store (manifest.json), no lmdb_train, no"
        f" {' or '.join(FRAME_TABLES)}, no *_data.npz, no *_raw.csv, no BVH and no audio files",
        hint="point at the folder that data.root names",
    )


def _bvh_named(patterns: Sequence[re.Pattern[str]]) -> Callable[[Path], bool]:
    def is_here(root: Path) -> bool:
        stems = [path.stem for path in files_named(root, r".*\.bvh")]
        fitting = sum(any(one.fullmatch(stem) for one in patterns) for stem in stems)
        return fitting > 0 and fitting >= MOST_NAMES * len(stems)

    return is_here


def _has_ted(root: Path) -> bool:
    folders = [f"{name}{end}" for name in DATABASES.values() for end in ("", "_cache")]
    return any((root / folder / "data.mdb").is_file() for folder in folders)


def _has_berkeley_2d(root: Path) -> bool:
    if any((root / name).is_file() for name in FRAME_TABLES):
        return True
    return (root / SAMPLE_TABLE).is_file() and any(root.glob("*/train/npz"))


def _has_takes(root: Path) -> bool:
    return bool(files_named(root, r".*\.(bvh|wav|flac|ogg|mp3)"))


LAYOUTS: tuple[Layout, ...] = (
    Layout("ted", _has_ted, find_ted_sources),
    Layout("berkeley2d", _has_berkeley_2d, find_2d_sources),
    Layout("berkeley3d", lambda root: bool(list_3d_files(root)), find_3d_sources),
    Layout(
        "uci_phases",
        lambda root: any(root.glob("[a-z][0-9]_raw.csv")),
        # The held-out user makes no difference to what is in the files.
        lambda root: find_uci_sources(root, "leave_user_out", "c"),
    ),
    *(
        Layout(name, _bvh_named(stems), partial(find, missing_audio="silence"))
        for name, find, stems in (
            ("genea", genea.find_genea_takes, (genea.NAME,)),
            ("trinity", trinity.find_trinity_takes, trinity.NAMES),
            ("zeggs", zeggs.find_zeggs_takes, (zeggs.NAME,)),
            ("beat", beat.find_beat_takes, (beat.NAME,)),
        )
    ),
    Layout("mocap", _has_takes, partial(find_takes, missing_audio="silence")),
)
"""The known layouts; the first that fits is taken."""
