"""`data=trinity`: Trinity Speech-Gesture I and II."""

from __future__ import annotations

from dataclasses import dataclass

from cospeech.formats.mocap import Take
from cospeech.formats.trinity import find_trinity_takes
from data_modules.mocap import MocapCorpus


@dataclass(kw_only=True, eq=False)
class TrinityData(MocapCorpus):
    """`data=trinity`: the GENEA 2020 release, or the raw takes with an offset table.

    Args:
        split_rule: ``"released"`` (Gesticulator's; overlaps the challenge's test set) or
            ``"challenge"``.
        layout: ``"auto"``, ``"synchronised"`` or ``"raw"``.
        offsets: Offset table of raw takes; looked for beside them when None.
    """

    split_rule: str
    layout: str
    offsets: str | None

    @property
    def corpus_name(self) -> str:
        """``trinity``."""
        return "trinity"

    def find_takes(self) -> list[Take]:
        """Recordings under their Trinity names."""
        published = self.split == "published" and self.split_list is None
        return find_trinity_takes(
            self.root,
            split_rule=self.split_rule if published else None,
            layout=self.layout,
            offsets=self.offsets,
            missing_audio=self.missing_audio,
            split_list=self.split_list,
        )
