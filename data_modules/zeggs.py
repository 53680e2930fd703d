"""`data=zeggs`: ZeroEGGS."""

from __future__ import annotations

from dataclasses import dataclass

from cospeech.formats.mocap import Take
from cospeech.formats.zeggs import find_zeggs_takes
from data_modules.mocap import MocapCorpus


@dataclass(kw_only=True, eq=False)
class ZeggsData(MocapCorpus):
    """`data=zeggs`: ZeroEGGS, as published."""

    @property
    def corpus_name(self) -> str:
        """``zeggs``."""
        return "zeggs"

    def find_takes(self) -> list[Take]:
        """The published recordings."""
        return find_zeggs_takes(self.root, missing_audio=self.missing_audio)
