"""Serves a dataset's windows batch by batch, in a reproducible order."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.store import Store
from cospeech.corpus.windows import ServesWindows, WindowDataset, WindowSpec
from cospeech.errors import ConfigError

logger = logging.getLogger(__name__)


class EpochOrder:
    """Batches of window indices, a pure function of (seed, epoch, rank).

    The order needs no saved state: a resumed epoch is the same permutation, entered at a later
    batch.

    Args:
        count: Number of windows.
        batch_size: Windows per batch.
        seed: Seed of the permutations.
        shuffle: Permute, or keep the fixed order.
        drop_last: Leave out a last batch that isn't full, unless it is the only one.
    """

    def __init__(
        self, count: int, batch_size: int, seed: int, shuffle: bool, drop_last: bool
    ) -> None:
        self.count, self.batch_size, self.seed = count, batch_size, seed
        self.shuffle, self.drop_last = shuffle, drop_last
        self.epoch = 0
        self.first_batch = 0

    def set_epoch(self, epoch: int) -> None:
        """Called by Lightning before each epoch."""
        if epoch != self.epoch:
            self.first_batch = 0
        self.epoch = epoch

    def __len__(self) -> int:
        rank, world = _world()
        share = self.count // world if self.shuffle else len(range(rank, self.count, world))
        whole = share // self.batch_size
        return max(whole, min(share, 1)) if self.drop_last else -(-share // self.batch_size)

    def __iter__(self) -> Iterator[NDArray[np.int64]]:
        rank, world = _world()
        order = np.arange(self.count)
        if self.shuffle:
            order = np.random.default_rng([self.seed, self.epoch]).permutation(self.count)
            # An equal share for every process, or the last step would wait for one for ever.
            order = order[: self.count - self.count % world]
        order = order[rank::world]
        for batch in range(self.first_batch, len(self)):
            yield order[batch * self.batch_size : (batch + 1) * self.batch_size]


def _world() -> tuple[int, int]:
    if torch.distributed.is_available() and torch.distributed.is_initialized():
        return torch.distributed.get_rank(), torch.distributed.get_world_size()
    return 0, 1


class WindowLoader:
    """Serves a dataset's windows batch by batch; resumable in the middle of an epoch.

    One gather per batch in the training process: copying a batch between processes costs more than
    reading it from the memory map.

    Args:
        dataset: The windows.
        batch_size: Items (windows, or runs of them) per batch; where there are fewer, all of them
            make one batch.
        seed: Seed of the order.
        shuffle: Whether each epoch is permuted (training).
        drop_last: Leave out a last batch that isn't full (as published, docs/facts/trimodal.md,
            section 2.1).

    Raises:
        ConfigError: There are fewer windows than processes.
    """

    def __init__(
        self,
        dataset: ServesWindows,
        batch_size: int,
        seed: int,
        shuffle: bool,
        drop_last: bool,
    ) -> None:
        processes = _world()[1]
        if len(dataset) < processes:
            raise ConfigError(
                f"{len(dataset)} {dataset.split} windows can't be shared by {processes} processes",
                "use fewer devices, or more data",
            )
        if drop_last and len(dataset) < batch_size:
            logger.warning(
                "%d %s windows don't fill one batch of %d: all of them make the only batch",
                len(dataset),
                dataset.split,
                batch_size,
            )
        self.dataset = dataset
        self.sampler = EpochOrder(len(dataset), batch_size, seed, shuffle, drop_last)
        # Lightning asks every loader that has a sampler for this.
        self.batch_sampler = None
        self._next_batch = 0

    def __len__(self) -> int:
        return len(self.sampler)

    def __iter__(self) -> Iterator[GestureBatch]:
        # The body runs at the first `next`, after Lightning has set the epoch.
        for number, indices in enumerate(self.sampler, start=self.sampler.first_batch):
            self._next_batch = number + 1
            yield self.dataset.batch(indices)
        self.sampler.first_batch = 0

    def state_dict(self) -> dict[str, int]:
        """Where the loader stands; Lightning keeps it in checkpoints."""
        return {"epoch": self.sampler.epoch, "next_batch": self._next_batch}

    def load_state_dict(self, state: dict[str, int]) -> None:
        """Continue from `state_dict`'s place."""
        self.sampler.epoch = state["epoch"]
        self.sampler.first_batch = state["next_batch"]


@runtime_checkable
class WindowReader(Protocol):
    """Anything that works on windows: a method, or a network that judges motion.

    Attributes:
        window: Which windows; with ``interleaved`` for training, and for judging side by side.
        needs: Names of the fields it reads.
    """

    window: WindowSpec
    needs: frozenset[str]


@runtime_checkable
class OpensWindows(Protocol):
    """A reader of more than a corpus holds, which adds it to the windows itself."""

    def windows(self, store: Store, split: str, needs: frozenset[str]) -> ServesWindows:
        """The windows of one split, with these fields."""


def open_windows(
    store: Store, split: str, reader: WindowReader, more: frozenset[str] = frozenset()
) -> ServesWindows:
    """The windows of one split that a method works on.

    Args:
        store: The corpus.
        split: ``"train"``, ``"val"`` or ``"test"``.
        reader: The method.
        more: Fields besides those that the method reads.

    Raises:
        ConfigError: A field that doesn't exist or that the corpus can't fill.
        CospeechError: No span of the split is as long as a window.
    """
    if isinstance(reader, OpensWindows):
        return reader.windows(store, split, reader.needs | more)
    return WindowDataset(store, split, reader.window.of_split(split), reader.needs | more)
