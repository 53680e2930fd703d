"""Fixed windows over a store, and the loader that serves them in a reproducible order."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.corpus.batch import BATCH_FIELDS, GestureBatch
from cospeech.corpus.splits import Span
from cospeech.corpus.store import EVALUATION_FPS, Store
from cospeech.errors import ConfigError, CospeechError
from cospeech.speech.speech import SAMPLE_RATE
from cospeech.speech.vocabulary import word_frames

logger = logging.getLogger(__name__)


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

    Where the corpus has a published list of windows and the asked-for ones fit its grid, they are
    those of the list. A recording without a transcript has the padding word everywhere.

    Args:
        store: The corpus.
        split: ``"train"``, ``"val"`` or ``"test"``.
        spec: Window geometry.
        needs: `GestureBatch` fields to fill.

    Raises:
        ConfigError: A field that doesn't exist or that the corpus can't fill, or a frame rate the
            store doesn't hold.
        CospeechError: No span of the split is as long as a window.
    """

    def __init__(self, store: Store, split: str, spec: WindowSpec, needs: frozenset[str]) -> None:
        unknown = needs - BATCH_FIELDS
        if unknown:
            raise ConfigError(f"no batch field {sorted(unknown)}; there are {sorted(BATCH_FIELDS)}")
        if spec.fps != EVALUATION_FPS:
            raise ConfigError(f"the store holds {EVALUATION_FPS} fps, not {spec.fps}")
        if "positions" in needs and not store.has_upper_body:
            raise ConfigError(
                f"{store.name}: {NO_UPPER_BODY[store.dimensions]}", NO_UPPER_BODY_HINT
            )
        self.store, self.split, self.spec, self.needs = store, split, spec, needs
        spans = store.splits[split]
        if "audio" in needs:
            spans = self._with_audio(spans)
        listed = _fits_grid(spec, store.window_grid)
        windows = [_listed(store, span, spec) if listed else _every(span, spec) for span in spans]
        self.windows: NDArray[np.int64] = np.concatenate([*windows, np.zeros((0, 3), np.int64)])
        """``(n, 3)``: recording, first frame, first audio sample."""
        if not len(self.windows):
            raise CospeechError(
                f"{store.name}: no {split} recording holds a window of {spec.frames} frames"
                f" ({spec.frames / spec.fps:.2f} s)",
                "use longer recordings, or raise the split's share",
            )
        if "words" in needs:
            self._word_rows = self._find_words()
        if "speakers" in needs:
            ids = store.speaker_ids
            column = store.recordings.columns["speaker"]
            self._speakers = np.array([ids.get(name, 0) for name in column], dtype=np.int64)

    def _with_audio(self, spans: Sequence[Span]) -> list[Span]:
        has_audio = self.store.recordings.columns["has_audio"]
        heard = [span for span in spans if has_audio[span.recording]]
        if spans and not heard:
            raise ConfigError(
                f"{self.store.name}: no {self.split} recording has sound, which the method needs",
                "use a corpus with audio, or a method that reads none",
            )
        if len(heard) < len(spans):
            logger.warning(
                "%s: %d of %d %s recordings have no sound and are left out",
                self.store.name,
                len(spans) - len(heard),
                len(spans),
                self.split,
            )
        return heard

    def __len__(self) -> int:
        return len(self.windows)

    def describe(self, window: int) -> dict[str, Any]:
        """Recording and start time of a window, for reports."""
        recording, start, _ = self.windows[window]
        return {
            "window": int(window),
            "recording": self.store.recordings[int(recording)].id,
            "start_s": float(start / self.spec.fps),
        }

    def batch(self, indices: Sequence[int] | NDArray[np.int64]) -> GestureBatch:
        """The windows at ``indices`` as one batch."""
        indices = np.asarray(indices)
        recordings, starts, samples = self.windows[indices].T
        fields = {"window_ids": torch.as_tensor(indices, dtype=torch.int64)}
        if "positions" in self.needs:
            rows = self.store.first_rows["upper_body"][recordings] + starts
            frames = rows[:, None] + np.arange(self.spec.frames)
            positions = self.store.stream("upper_body")[frames].reshape(*frames.shape, 10, 3)
            fields["positions"] = torch.from_numpy(positions)
        if "audio" in self.needs:
            audio = np.empty((len(indices), self.spec.audio_samples), dtype=np.float32)
            for row, recording, first in zip(audio, recordings, samples, strict=True):
                self.store.copy_audio(int(recording), int(first), row)
            fields["audio"] = torch.from_numpy(audio)
        if "words" in self.needs:
            fields["words"] = torch.from_numpy(self._words(indices, starts))
        if "speakers" in self.needs:
            fields["speakers"] = torch.from_numpy(self._speakers[recordings])
        return GestureBatch(**fields)

    def _find_words(self) -> NDArray[np.int64]:
        """``(n, 2)``: first row of the word stream that may be in each window, and row after."""
        found = np.zeros((len(self.windows), 2), dtype=np.int64)
        recordings = self.windows[:, 0]
        edges = np.flatnonzero(np.diff(recordings, prepend=-1, append=-1))
        for begin, end in pairwise(edges):
            recording = int(recordings[begin])
            words = self.store.words(recording)
            starts = self.windows[begin:end, 1] / self.spec.fps
            # Words are in order of onset, not of end: no word before the first whose end, or an
            # earlier one's, is past the window's start can be inside.
            latest_end = np.maximum.accumulate(words[:, 1])
            first = self.store.first_rows["words"][recording]
            found[begin:end, 0] = first + np.searchsorted(latest_end, starts, side="right")
            stops = starts + self.spec.frames / self.spec.fps
            found[begin:end, 1] = first + np.searchsorted(words[:, 0], stops, side="left")
        return found

    def _words(self, indices: NDArray[np.int64], starts: NDArray[np.int64]) -> NDArray[np.int64]:
        """As `frame_aligned_words` for each window, all at once."""
        first, stop = self._word_rows[indices].T
        counts = np.maximum(stop - first, 0)
        window = np.repeat(np.arange(len(indices)), counts)
        rows = np.arange(counts.sum()) + np.repeat(first - np.cumsum(counts) + counts, counts)
        onsets, ends, ids = self.store.stream("words")[rows].T
        begins = (starts / self.spec.fps)[window]
        inside = ends > begins
        frames, fps = self.spec.frames, self.spec.fps
        on_frame = word_frames(onsets, begins, frames, fps)
        inside &= on_frame < frames
        aligned = np.zeros((len(indices), frames), dtype=np.int64)
        # NumPy assigns in order, so of several words on a frame the last one stays.
        aligned[window[inside], on_frame[inside]] = ids[inside]
        return aligned


def _fits_grid(spec: WindowSpec, grid: dict[str, float] | None) -> bool:
    """Whether a published list of windows says anything about windows like these."""
    return grid is not None and (
        grid["fps"] == spec.fps and grid["stride"] == spec.stride and spec.frames <= grid["frames"]
    )


def _every(span: Span, spec: WindowSpec) -> NDArray[np.int64]:
    starts = np.arange(span.start, span.stop - spec.frames + 1, spec.stride)
    samples = np.rint(starts / spec.fps * SAMPLE_RATE).astype(np.int64)
    return np.stack([np.full_like(starts, span.recording), starts, samples], axis=1)


def _listed(store: Store, span: Span, spec: WindowSpec) -> NDArray[np.int64]:
    rows = store.read(span.recording, "windows")
    inside = (rows[:, 0] >= span.start) & (rows[:, 0] + spec.frames <= span.stop)
    return np.insert(rows[inside], 0, span.recording, axis=1)


NO_UPPER_BODY = {
    2: "these are 2-D keypoints of a picture, and the method needs 3-D upper-body positions",
    3: "its joints don't give the ten upper-body joints that the method needs",
}
NO_UPPER_BODY_HINT = (
    "choose a 3-D corpus (for Berkeley data.kind=3d), or a method that can do with what there is"
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
        batch_size: Windows per batch; where there are fewer, all of them make one batch.
        seed: Seed of the order.
        shuffle: Whether each epoch is permuted (training).
        drop_last: Leave out a last batch that isn't full (as published, spec 2.1).
    """

    def __init__(
        self, dataset: WindowDataset, batch_size: int, seed: int, shuffle: bool, drop_last: bool
    ) -> None:
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
