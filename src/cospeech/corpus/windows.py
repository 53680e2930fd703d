"""Fixed windows over a store, and the loader that serves them in a reproducible order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.corpus.batch import BATCH_FIELDS, GestureBatch
from cospeech.corpus.store import EVALUATION_FPS, Store
from cospeech.errors import ConfigError, CospeechError
from cospeech.speech.speech import SAMPLE_RATE
from cospeech.speech.vocabulary import frame_aligned_words


@dataclass(frozen=True)
class WindowSpec:
    """The windows a method works on.

    Attributes:
        fps: Frames per second.
        frames: Frames per window.
        seed_frames: Leading frames given to the method.
        stride: Frames from one window's start to the next.
    """

    fps: float
    frames: int
    seed_frames: int
    stride: int

    @property
    def audio_samples(self) -> int:
        """Samples of 16 kHz audio that go with one window."""
        return round(self.frames / self.fps * SAMPLE_RATE)


class WindowDataset:
    """The fixed list of windows of one split; a window never leaves its span.

    A recording without a transcript has the padding word everywhere.

    Args:
        store: The corpus.
        split: ``"train"``, ``"val"`` or ``"test"``.
        spec: Window geometry.
        needs: `GestureBatch` fields to fill.

    Raises:
        ConfigError: A field that doesn't exist, or a frame rate the store doesn't hold.
        CospeechError: No span of the split is as long as a window.
    """

    def __init__(self, store: Store, split: str, spec: WindowSpec, needs: frozenset[str]) -> None:
        unknown = needs - BATCH_FIELDS
        if unknown:
            raise ConfigError(f"no batch field {sorted(unknown)}; there are {sorted(BATCH_FIELDS)}")
        if spec.fps != EVALUATION_FPS:
            raise ConfigError(f"the store holds {EVALUATION_FPS} fps, not {spec.fps}")
        self.store, self.split, self.spec, self.needs = store, split, spec, needs
        windows = [
            (span.recording, start)
            for span in store.splits[split]
            for start in range(span.start, span.stop - spec.frames + 1, spec.stride)
        ]
        if not windows:
            raise CospeechError(
                f"{store.name}: no {split} recording holds a window of {spec.frames} frames"
                f" ({spec.frames / spec.fps:.2f} s)",
                "use longer recordings, or raise the split's share",
            )
        self.windows: NDArray[np.int64] = np.array(windows, dtype=np.int64)

    def __len__(self) -> int:
        return len(self.windows)

    def describe(self, window: int) -> dict[str, Any]:
        """Recording and start time of a window, for reports."""
        recording, start = self.windows[window]
        return {
            "window": int(window),
            "recording": self.store.recordings[recording].id,
            "start_s": float(start / self.spec.fps),
        }

    def batch(self, indices: Sequence[int] | NDArray[np.int64]) -> GestureBatch:
        """The windows at ``indices`` as one batch."""
        chosen = self.windows[np.asarray(indices)]
        spec, store = self.spec, self.store
        fields: dict[str, torch.Tensor] = {
            "window_ids": torch.as_tensor(np.asarray(indices), dtype=torch.int64)
        }
        if "positions" in self.needs:
            positions = np.empty((len(chosen), spec.frames, 10, 3), dtype=np.float32)
            for row, (recording, start) in enumerate(chosen):
                positions[row] = store.upper_body(recording, start, start + spec.frames)
            fields["positions"] = torch.from_numpy(positions)
        if "audio" in self.needs:
            audio = np.empty((len(chosen), spec.audio_samples), dtype=np.float32)
            for row, (recording, start) in enumerate(chosen):
                first = round(start / spec.fps * SAMPLE_RATE)
                audio[row] = store.audio(recording, first, spec.audio_samples)
            fields["audio"] = torch.from_numpy(audio)
        if "words" in self.needs:
            words = np.stack([self._words(recording, start) for recording, start in chosen])
            fields["words"] = torch.from_numpy(words)
        if "speakers" in self.needs:
            speakers = [store.speaker_id(recording) for recording in chosen[:, 0]]
            fields["speakers"] = torch.tensor(speakers, dtype=torch.int64)
        return GestureBatch(**fields)

    def _words(self, recording: int, start: int) -> NDArray[np.int64]:
        rows = self.store.words(recording)
        begin = start / self.spec.fps
        end = begin + self.spec.frames / self.spec.fps
        inside = rows[(rows[:, 0] < end) & (rows[:, 1] > begin)]
        return frame_aligned_words(
            inside[:, 0], inside[:, 2].astype(np.int64), begin, self.spec.frames, self.spec.fps
        )


class EpochOrder:
    """Batches of window indices, a pure function of (seed, epoch, rank).

    The order needs no saved state: a resumed epoch is the same permutation, entered at a later
    batch.

    Args:
        count: Number of windows.
        batch_size: Windows per batch.
        seed: Seed of the permutations.
        shuffle: Permute, or keep the fixed order.
        drop_last: Leave out a last batch that isn't full.
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
        return share // self.batch_size if self.drop_last else -(-share // self.batch_size)

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
        batch_size: Windows per batch, no more than there are.
        seed: Seed of the order.
        shuffle: Whether each epoch is permuted (training).
        drop_last: Leave out a last batch that isn't full (as published, spec 2.1).
    """

    def __init__(
        self, dataset: WindowDataset, batch_size: int, seed: int, shuffle: bool, drop_last: bool
    ) -> None:
        if drop_last and len(dataset) < batch_size:
            raise ConfigError(
                f"{len(dataset)} {dataset.split} windows don't fill one batch of {batch_size}",
                f"set training.batch_size={len(dataset)} or lower, or use more data",
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
