"""`data=genea`: Talking With Hands in its GENEA 2022 and 2023 editions."""

from __future__ import annotations

from dataclasses import dataclass

from cospeech.formats.genea import find_genea_takes
from cospeech.formats.mocap import Take
from data_modules.mocap import MocapCorpus


@dataclass(kw_only=True, eq=False)
class GeneaData(MocapCorpus):
    """`data=genea`: Talking With Hands in its GENEA 2022 and 2023 editions, as published."""

    @property
    def corpus_name(self) -> str:
        """``genea``."""
        return "genea"

    def find_takes(self) -> list[Take]:
        """The published recordings."""
        return find_genea_takes(self.root, missing_audio=self.missing_audio)
