"""`data=beat`: BEAT."""

from __future__ import annotations

from dataclasses import dataclass

from cospeech.formats.beat import find_beat_takes
from cospeech.formats.mocap import Take
from data_modules.mocap import MocapCorpus


@dataclass(kw_only=True, eq=False)
class BeatData(MocapCorpus):
    """`data=beat`: BEAT's BVH recordings."""

    @property
    def corpus_name(self) -> str:
        """``beat``."""
        return "beat"

    def find_takes(self) -> list[Take]:
        """The recordings, cut in two where the published rule does and no list is given."""
        return find_beat_takes(
            self.root, split_list=self.split_list, missing_audio=self.missing_audio
        )
