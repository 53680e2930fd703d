"""`data=ted`: the TED Gesture set (or TED-Expressive) as its LMDB files lie on disk."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from cospeech.corpus.features.field import FieldSource
from cospeech.corpus.source import Source
from cospeech.formats.ted.filters import PUBLISHED_RULES
from cospeech.formats.ted_lmdb import find_ted_sources
from data_modules.base import StoreDataModule


@dataclass(kw_only=True, eq=False)
class TedData(StoreDataModule):
    """The published videos, or the samples cached from them.

    Args:
        root: Folder of ``lmdb_train``, ``lmdb_val`` and ``lmdb_test``.
        kind: ``"video"``, ``"cache"`` (the folders with ``_cache``), or ``"auto"``: of each split
            the videos if they are there, else the cached samples.
        published_windows: Serve the windows that pass the published filters; False: every window of
            a video. Cached samples are windows that passed.
    """

    root: str
    kind: str
    published_windows: bool

    @property
    def corpus_name(self) -> str:
        """Name of the corpus and its store."""
        return "ted"

    @property
    def lacks(self) -> frozenset[FieldSource]:
        """Keypoints have no rotations, and nobody has annotated phases."""
        return frozenset({"phases", "rotations"})

    def find_sources(self) -> Sequence[Source]:
        """One source per video, or per block of cached samples.

        Raises:
            ConfigError: ``kind`` is none of the three.
            CospeechError: The folder holds no such database.
        """
        rules = PUBLISHED_RULES if self.published_windows else None
        return find_ted_sources(self.root, kind=self.kind, rules=rules)

    def settings(self) -> dict[str, Any]:
        """Which databases are read, and which windows count."""
        return {"kind": self.kind, "published_windows": self.published_windows}
