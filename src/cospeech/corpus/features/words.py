"""The words of each window, on the frames of their onsets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.field import Gather, Places, WindowField
from cospeech.corpus.store import Store
from cospeech.speech.vocabulary import word_frames


def _reader(store: Store, places: Places) -> Gather:
    """As `frame_aligned_words` for each window, all at once."""
    first, stop = _rows_inside(store, places).T
    frames, fps = places.frames, places.fps
    stream = store.stream("words")

    def gather(windows: NDArray[np.int64]) -> NDArray[np.int64]:
        counts = np.maximum(stop[windows] - first[windows], 0)
        window = np.repeat(np.arange(len(windows)), counts)
        skipped = first[windows] - np.cumsum(counts) + counts
        onsets, ends, ids = stream[np.arange(counts.sum()) + np.repeat(skipped, counts)].T
        begins = places.starts_s[windows][window]
        on_frame = word_frames(onsets, begins, frames, fps)
        inside = (ends > begins) & (on_frame < frames)
        aligned = np.zeros((len(windows), frames), dtype=np.int64)
        # NumPy assigns in order, so of several words on a frame the last one stays.
        aligned[window[inside], on_frame[inside]] = ids[inside]
        return aligned

    return gather


def _rows_inside(store: Store, places: Places) -> NDArray[np.int64]:
    """``(n, 2)``: first row of the word stream that may be in each window, and row after."""
    words = np.asarray(store.stream("words"))
    owners = np.repeat(np.arange(len(store.recordings)), store.row_counts["words"])
    recordings, starts = places.recordings, places.starts_s
    # Words are in order of onset, not of end: no word before the first whose end, or an earlier
    # one's, is past the window's start can be inside.
    latest_ends = _running_maximum(owners, words[:, 1])
    first = _rows_before(owners, latest_ends, recordings, starts, equal_too=True)
    stops = starts + places.frames / places.fps
    stop = _rows_before(owners, words[:, 0], recordings, stops, equal_too=False)
    return np.stack([first, stop], axis=1)


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


WORDS = WindowField(
    name="words",
    reads="words",
    axis="method frames",
    unit="word id on the frame of its onset, 0 elsewhere",
    has_padding=True,
    dtype=np.int64,
    reader=_reader,
)
