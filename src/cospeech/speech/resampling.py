"""16 kHz to 22 050 Hz by a filter of a stated length: a part of a sound has the samples of all.

The filter is soxr's (high quality), read off once from what soxr makes of single samples, and the
two agree up to rounding but for a sound's first five samples, for which soxr has another filter.
Here a sample depends on `REACH_SAMPLES` to either side and on nothing else, not even by rounding.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import soxr
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from cospeech.speech.speech import SAMPLE_RATE

RATE = 22_050
"""Samples per second afterwards."""

BLOCK, RESAMPLED_BLOCK = 320, 441
"""So many samples are as long as so many afterwards."""

REACH_SAMPLES = 100
"""Of 16 kHz to either side of a sample's time; soxr's filter is below 1e-6 from there on."""


def resampled_length(samples: int) -> int:
    """How many samples there are afterwards: to the nearest, as soxr has it."""
    return (samples * RESAMPLED_BLOCK + BLOCK // 2) // BLOCK


def resampled(waveform: NDArray[np.float32]) -> NDArray[np.float32]:
    """A waveform at 22 050 Hz; beyond its ends there is silence.

    Args:
        waveform: ``(N,)`` at 16 kHz.

    Returns:
        ``(resampled_length(N),)``, the first sample where the waveform's is. What begins with a
        multiple of `BLOCK` samples of a longer waveform has that one's values, to the bit, where
        nothing outside is in reach.
    """
    count = resampled_length(len(waveform))
    blocks = -(-count // RESAMPLED_BLOCK)
    behind = blocks * BLOCK - len(waveform)
    padded = np.pad(waveform, (REACH_SAMPLES, behind + REACH_SAMPLES))
    windows = sliding_window_view(padded, BLOCK + 2 * REACH_SAMPLES)[: blocks * BLOCK : BLOCK]
    # One product for each block, all of one size: the number of blocks must not change a bit.
    values: NDArray[np.float32] = np.matmul(windows[:, None], _weights())
    return values.reshape(-1)[:count]


@lru_cache(maxsize=1)
def _weights() -> NDArray[np.float32]:
    """``(BLOCK + 2 * REACH_SAMPLES, RESAMPLED_BLOCK)``: what each sample adds to a block's."""
    distance = 2 * (BLOCK + REACH_SAMPLES) + 1  # no two answers meet, and none meets the ends
    places = distance * np.arange(1, BLOCK + 1)
    impulses = np.zeros(places[-1] + distance, dtype=np.float32)
    impulses[places] = 1
    answers = soxr.resample(impulses, SAMPLE_RATE, RATE)
    # An answer is known by its distance from the sample in 441ths of one: 320 k - 441 m.
    offsets = np.arange(-REACH_SAMPLES * RESAMPLED_BLOCK, REACH_SAMPLES * RESAMPLED_BLOCK + 1)
    by_offset = np.zeros(len(offsets), dtype=np.float32)
    for place in places:
        first = -(-(RESAMPLED_BLOCK * place + offsets[0]) // BLOCK)
        last = (RESAMPLED_BLOCK * place + offsets[-1]) // BLOCK
        k = np.arange(first, last + 1)
        by_offset[BLOCK * k - RESAMPLED_BLOCK * place - offsets[0]] = answers[k]
    samples = np.arange(BLOCK + 2 * REACH_SAMPLES) - REACH_SAMPLES
    apart = BLOCK * np.arange(RESAMPLED_BLOCK) - RESAMPLED_BLOCK * samples[:, None]
    is_near = np.abs(apart) <= offsets[-1]
    return np.where(is_near, by_offset[np.where(is_near, apart - offsets[0], 0)], 0)
