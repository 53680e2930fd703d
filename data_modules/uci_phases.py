"""`data=uci_phases`: real gestures with annotated phases, no speech."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from cospeech.corpus.features.field import FieldSource
from cospeech.corpus.source import Source
from cospeech.formats.uci_phases import find_uci_sources
from data_modules.base import StoreDataModule


@dataclass(kw_only=True, eq=False)
class UciPhasesData(StoreDataModule):
    """The UCI Gesture Phase Segmentation set: seven videos of three users.

    Args:
        root: The folder of the csv files.
        protocol: ``"leave_user_out"`` or ``"leave_video_out"``; see
            `cospeech.formats.uci_phases.uci_splits`.
        held_out: The user (``"c"``) or video (``"a3"``) that tests.
    """

    root: str
    protocol: str
    held_out: str

    @property
    def corpus_name(self) -> str:
        """The set has one name, whatever is held out."""
        return "uci_phases"

    @property
    def lacks(self) -> frozenset[FieldSource]:
        """There are no shoulders or elbows, no rotations and no sound."""
        return frozenset({"upper body", "rotations", "sound"})

    def find_sources(self) -> Sequence[Source]:
        """One source per video."""
        return find_uci_sources(self.root, self.protocol, self.held_out)

    def settings(self) -> dict[str, Any]:
        """The split is part of the recordings."""
        return {"protocol": self.protocol, "held_out": self.held_out}
