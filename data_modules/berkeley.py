"""`data=berkeley`: the Berkeley speech2gesture set, as 2-D keypoints or in its 3-D extension."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cospeech.corpus.features.field import FieldSource
from cospeech.corpus.source import Source
from cospeech.errors import ConfigError
from cospeech.formats.berkeley.extension3d import CHUNK_SETS, find_3d_sources, list_3d_files
from cospeech.formats.berkeley.keypoints2d import find_2d_sources
from data_modules.base import StoreDataModule

KINDS = ("auto", "2d", "3d")


@dataclass(kw_only=True, eq=False)
class BerkeleyData(StoreDataModule):
    """Up to ten speakers with the published split.

    Args:
        root: Folder of the tables and the speakers' folders (2-D), or of the ``*_data.npz`` files
            or their folders (3-D).
        kind: ``"2d"``, ``"3d"``, or ``"auto"``: what the folder holds.
        speakers: Only these, a list or one name; None for all there are.
        chunks: Which files of the 3-D extension: ``"matching"``, the disjoint chunks, or
            ``"pairs"``, the overlapping windows.

    Raises:
        ConfigError: ``kind`` or ``chunks`` is none of these.
    """

    root: str
    kind: str
    speakers: Sequence[str] | None
    chunks: str

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.kind not in KINDS:
            raise ConfigError(f"data.kind={self.kind}: choose one of {', '.join(KINDS)}")
        if self.chunks not in CHUNK_SETS:
            raise ConfigError(f"data.chunks={self.chunks}: choose {' or '.join(CHUNK_SETS)}")
        if isinstance(self.speakers, str):
            self.speakers = [self.speakers]
        # Hydra hands over a list of its own kind.
        self.speakers = None if self.speakers is None else [str(name) for name in self.speakers]
        if self.kind == "auto":
            self.kind = "3d" if list_3d_files(self.root) else "2d"
            tables = [*Path(self.root).glob("frames*.csv"), *Path(self.root).glob("train.csv")]
            if self.kind == "3d" and tables:
                raise ConfigError(
                    f"{self.root} holds the 2-D set ({tables[0].name}) and the 3-D extension",
                    "say which with data.kind=2d or data.kind=3d",
                )

    @property
    def corpus_name(self) -> str:
        """The 2-D and the 3-D set are two corpora."""
        return f"berkeley{self.kind}"

    @property
    def lacks(self) -> frozenset[FieldSource]:
        """Keypoints have no rotations, those of a picture are not 3-D; no phases are annotated."""
        in_space: set[FieldSource] = set() if self.kind == "3d" else {"motion", "upper body"}
        return frozenset({"phases", "rotations", *in_space})

    def find_sources(self) -> Sequence[Source]:
        """Blocks of intervals or chunks.

        Raises:
            CospeechError: The folder holds nothing of the kind, or not of a speaker asked for.
        """
        if self.kind == "2d":
            return find_2d_sources(self.root, speakers=self.speakers)
        return find_3d_sources(self.root, chunks=self.chunks, speakers=self.speakers)

    def settings(self) -> dict[str, Any]:
        """Which speakers are read, and which files of the 3-D extension."""
        return {"speakers": self.speakers, "chunks": self.chunks if self.kind == "3d" else None}
