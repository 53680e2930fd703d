"""`data=synthetic`: the embedded corpus, made on first use."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from cospeech.corpus.recording import Recording
from cospeech.corpus.source import Source
from cospeech.corpus.synthetic import GENERATOR_VERSION, plan, synthesise
from cospeech.errors import ConfigError
from data_modules.base import StoreDataModule

MINUTES_PER_RECORDING = 1.5
"""About how long a recording of the embedded corpus is."""


@dataclass(kw_only=True, eq=False)
class SyntheticData(StoreDataModule):
    """A simulated world with known truth: synthesised speech, rule-based gestures.

    Args:
        minutes: Length of the corpus.
        corpus_seed: Seed of everything in the corpus.
        speakers: Number of speakers.

    Raises:
        ConfigError: One of them is out of its range.
    """

    minutes: float
    corpus_seed: int
    speakers: int

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, least in (("speakers", 1), ("corpus_seed", 0)):
            if getattr(self, name) < least:
                raise ConfigError(
                    f"data.{name}={getattr(self, name)}: a number of at least {least}"
                )
        if not 0 < self.minutes < math.inf:
            raise ConfigError(f"data.minutes={self.minutes}: a number above 0")
        if self.minutes == int(self.minutes):
            self.minutes = int(self.minutes)  # 4 and 4.0 are one corpus, with one fingerprint
        # The takes share one voice process and are made in order; nothing to read in parallel.
        self.workers = 1
        if self.max_recordings is not None:
            # A smaller world, rather than the beginning of one in which each speaker appears once.
            self.minutes = min(self.minutes, self.max_recordings * MINUTES_PER_RECORDING)
            self.speakers = min(self.speakers, max(1, self.max_recordings // 2))

    @property
    def corpus_name(self) -> str:
        """The corpus has no other name."""
        return "synthetic"

    def settings(self) -> dict[str, Any]:
        """The generator's version and arguments."""
        return {
            "generator": GENERATOR_VERSION,
            "minutes": self.minutes,
            "seed": self.corpus_seed,
            "speakers": self.speakers,
        }

    def find_sources(self) -> Sequence[Source]:
        """One source per take planned."""
        takes = _Takes(self.minutes, self.corpus_seed, self.speakers)
        return [Source(id, functools.partial(takes.read, id), ()) for id in takes.ids]


class _Takes:
    """The corpus's takes, made in order as they are asked for."""

    def __init__(self, minutes: float, seed: int, speakers: int) -> None:
        self.ids = [take.id for take in plan(minutes, seed, speakers)]
        self._arguments = (minutes, seed, speakers)
        self._made: Iterator[Recording] | None = None

    def read(self, take_id: str) -> list[Recording]:
        if self._made is None:
            self._made = synthesise(*self._arguments)
        return [next(take for take in self._made if take.id == take_id)]
