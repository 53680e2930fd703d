"""`data=synthetic`: the embedded corpus, made on first use."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from typing import Any

from cospeech.corpus.recording import Recording
from cospeech.corpus.synthetic import GENERATOR_VERSION, plan, synthesise
from data_modules.base import Reader, StoreDataModule

MINUTES_PER_RECORDING = 1.5
"""About how long a recording of the embedded corpus is."""


class SyntheticData(StoreDataModule):
    """A simulated world with known truth: synthesised speech, rule-based gestures.

    Args:
        store_dir: Folder that holds prepared stores.
        batch_size: Windows per training batch.
        seed: Seed of the batch order.
        minutes: Length of the corpus.
        corpus_seed: Seed of everything in the corpus.
        speakers: Number of speakers.
        split: ``"recordings"``, ``"speakers"`` or ``"time_blocks"``.
        val_share: Share for validation.
        test_share: Share for testing.
        split_seed: Seed of the split.
        strict: Fail on a bad recording instead of skipping it.
        max_recordings: A corpus of about so many recordings (debug runs); None for ``minutes``.
    """

    def __init__(
        self,
        store_dir: str,
        batch_size: int,
        seed: int,
        minutes: float,
        corpus_seed: int,
        speakers: int,
        split: str,
        val_share: float,
        test_share: float,
        split_seed: int,
        strict: bool,
        max_recordings: int | None,
    ) -> None:
        super().__init__(
            "synthetic",
            store_dir,
            batch_size,
            seed,
            split,
            val_share,
            test_share,
            split_seed,
            strict,
            max_recordings,
        )
        if max_recordings is not None:
            # A smaller world, rather than the beginning of one in which each speaker appears once.
            minutes = min(minutes, max_recordings * MINUTES_PER_RECORDING)
            speakers = min(speakers, max(1, max_recordings // 2))
        self.minutes, self.corpus_seed, self.speakers = minutes, corpus_seed, speakers

    def sources(self) -> dict[str, Any]:
        """The generator's version and arguments."""
        return {
            "generator": GENERATOR_VERSION,
            "minutes": self.minutes,
            "seed": self.corpus_seed,
            "speakers": self.speakers,
        }

    def recording_count(self) -> int:
        """Number of takes planned."""
        return len(plan(self.minutes, self.corpus_seed, self.speakers))

    def readers(self) -> Iterable[tuple[str, Reader]]:
        """The takes, in the plan's order; made by two processes ahead of their turn."""
        for recording in synthesise(self.minutes, self.corpus_seed, self.speakers):
            yield recording.id, functools.partial(_as_it_is, recording)


def _as_it_is(recording: Recording) -> Recording:
    return recording
