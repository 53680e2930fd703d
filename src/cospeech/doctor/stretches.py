"""Stretches of time in which something holds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cospeech.speech.speech import Word


def stretches(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Runs of true values.

    Args:
        mask: ``(N,)``.

    Returns:
        ``(R, 2)``: first index and the index after the last of each run, in order.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return edges.reshape(-1, 2)


def long_stretches(mask: NDArray[np.bool_], shortest: float) -> NDArray[np.int64]:
    """Runs of true values with at least ``shortest`` of them; see `stretches`."""
    runs = stretches(mask)
    return runs[runs[:, 1] - runs[:, 0] >= shortest]


def word_intervals(words: Sequence[Word] | None) -> NDArray[np.float64]:
    """``(W, 2)`` start and end of each word, s."""
    return np.array([(word.start, word.end) for word in words or ()], np.float64).reshape(-1, 2)


def overlap_s(intervals: NDArray[np.float64], start_s: float, end_s: float) -> float:
    """Seconds of the intervals ``(W, 2)`` that lie between two times."""
    inside = np.minimum(intervals[:, 1], end_s) - np.maximum(intervals[:, 0], start_s)
    return float(np.clip(inside, 0, None).sum())
