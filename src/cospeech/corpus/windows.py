"""The fixed windows of a store that methods train and are judged on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
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


@dataclass(frozen=True)
class WindowSpec:
    """The windows a method works on.

    Attributes:
        fps: Frames per second.
        frames: Frames per window.
        seed_frames: Leading frames given to the method.
        stride: Frames from one window's start to the next (of runs: from one run's to the next).
        run: Consecutive windows that stay together in a batch.
    """

    fps: float
    frames: int
    seed_frames: int
    stride: int
    run: int = 1

    @property
    def audio_samples(self) -> int:
        """Samples of 16 kHz audio that go with one window."""
        return round(self.frames / self.fps * SAMPLE_RATE)


def _told(spans: Sequence[Span]) -> str:
    lengths = [(span.stop - span.start) / EVALUATION_FPS for span in spans]
    return f"{len(spans)}, the longest of {max(lengths):.2f} s" if lengths else "none"


class WindowDataset:
    """The fixed list of windows of one split; a window never leaves its span.

    Where a recording has a published list of windows and the asked-for ones fit its grid, they are
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
            spans = store.spans_with_sound(spans, f"{split} windows")
        self.windows: NDArray[np.int64] = _windows(store, spans, spec)
        """``(n, 3)``: recording, first frame, first audio sample."""
        if not len(self.windows):
            raise CospeechError(
                f"{store.name}: no {split} recording holds a window of {spec.frames} frames"
                f" ({spec.frames / spec.fps:.2f} s); there are {_told(spans)}",
                "add longer recordings; raise data.val_share and data.test_share where that is a"
                " small part; or, with a handful of long takes, data.split=time_blocks",
            )
        if "words" in needs:
            self._word_rows = self._find_words()
        if "speakers" in needs:
            ids = store.speaker_ids
            column = store.recordings.columns["speaker"]
            self._speakers = np.array([ids.get(name, 0) for name in column], dtype=np.int64)

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
            first_rows = self.store.first_rows["audio"][recordings] + samples
            self.store.will_read("audio", first_rows, self.spec.audio_samples)
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
        words = np.asarray(self.store.stream("words"))
        owners = np.repeat(np.arange(len(self.store.recordings)), self.store.row_counts["words"])
        recordings = self.windows[:, 0]
        starts = self.windows[:, 1] / self.spec.fps
        stops = starts + self.spec.frames / self.spec.fps
        # Words are in order of onset, not of end: no word before the first whose end, or an
        # earlier one's, is past the window's start can be inside.
        latest_ends = _running_maximum(owners, words[:, 1])
        first = _rows_before(owners, latest_ends, recordings, starts, equal_too=True)
        stop = _rows_before(owners, words[:, 0], recordings, stops, equal_too=False)
        return np.stack([first, stop], axis=1)

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


def _windows(store: Store, spans: Sequence[Span], spec: WindowSpec) -> NDArray[np.int64]:
    """Recording, first frame and first sample of the windows of spans, in the spans' order."""
    table = np.array([(span.recording, span.start, span.stop) for span in spans], dtype=np.int64)
    recordings, starts, stops = table.reshape(-1, 3).T
    listed = np.zeros(len(recordings), dtype=np.int64)
    if _fits_grid(spec, store.window_grid):
        # A recording without a list, in a corpus where others have one, gives every window.
        listed = store.row_counts["windows"][recordings]
    fitting = np.maximum((stops - starts - spec.frames) // spec.stride + 1, 0)
    counts = np.where(listed > 0, listed, fitting)
    span = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    frames = starts[span] + number * spec.stride
    samples = np.rint(frames / spec.fps * SAMPLE_RATE).astype(np.int64)
    of_list = listed[span] > 0
    rows = store.first_rows["windows"][recordings[span]] + number
    frames[of_list], samples[of_list] = store.stream("windows")[rows[of_list]].T
    inside = (frames >= starts[span]) & (frames + spec.frames <= stops[span])
    return np.stack([recordings[span], frames, samples], axis=1)[inside]


def _running_maximum(owners: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest value so far among those of the same owner; owners ascend."""
    order = np.argsort(values, kind="stable")
    ranks = np.empty_like(order)
    ranks[order] = np.arange(len(order))
    largest = np.maximum.accumulate(ranks + owners * len(order)) - owners * len(order)
    return values[order[largest]]


def _rows_before(
    owners: NDArray[np.int64],
    values: NDArray[np.float64],
    of: NDArray[np.int64],
    limits: NDArray[np.float64],
    equal_too: bool,
) -> NDArray[np.int64]:
    """Rows of earlier owners, and of owner ``of`` with a value below (or equal to) each limit.

    As `np.searchsorted` among each owner's values, for all owners at once.
    """
    is_limit = np.repeat([not equal_too, equal_too], [len(values), len(limits)])
    order = np.lexsort((is_limit, np.append(values, limits), np.append(owners, of)))
    is_row = order < len(values)
    found = np.empty(len(limits), dtype=np.int64)
    found[order[~is_row] - len(values)] = np.cumsum(is_row)[~is_row]
    return found


NO_UPPER_BODY = {
    2: "these are 2-D keypoints of a picture, and the method needs 3-D upper-body positions",
    3: "its joints don't give the ten upper-body joints that the method needs",
}
NO_UPPER_BODY_HINT = (
    "choose a 3-D corpus (for Berkeley data.kind=3d), or a method that can do with what there is"
)
