"""Gesticulator's other acoustics: 26 cepstra at 20 fps (Kucherenko et al. 2020, section 5.3).

See docs/facts/trinity_and_gesticulator.md, section 2.

A row is the mean of five frames of 20 ms, 10 ms apart, that begin at its time: row i looks at the
60 ms from ``i / 20`` s on. Of a frame: pre-emphasis of 0.97, no window, the power spectrum of 1024
samples divided by 1024, 26 triangles between 0 Hz and half the sample rate whose edges lie on bins
of the spectrum, natural logarithms, the orthonormal cosine transform, and a lifter; coefficient 0
is the logarithm of the frame's energy. Samples are on the scale of 16-bit integers, and zeros count
as the smallest step of a float64 before a logarithm.

The published code reads a file at its own rate; in the framework it is 16 kHz, where a row is 50 ms
long exactly. Of a file of 44.1 kHz it has triangles up to 22 050 Hz, which are other features: a
network that was trained on them hears others here. What is left of the last row's five frames is
averaged; the published code drops an incomplete one.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy import fft

from cospeech.speech.band_power import check_waveform
from cospeech.speech.speech import SAMPLE_RATE

FPS = 20
COEFFICIENTS = 26
ROW_SAMPLES = 960
"""What a row looks at, at 16 kHz, and one sample before."""

_FRAMES_PER_ROW = 5
_FRAME_S, _STEP_S = 0.02, 0.01
_FFT_SAMPLES = 1024
_PRE_EMPHASIS = 0.97
_LIFTER = 22
_INTEGER_SCALE = 32_768
_SMALLEST = np.finfo(np.float64).eps
_ROWS_PER_BLOCK = 200  # bounds memory, however long the recording


def gesticulator_cepstra(
    waveform: NDArray[np.float32], sample_rate: int = SAMPLE_RATE
) -> NDArray[np.float32]:
    """Cepstra of each row of 50 ms, not normalised; in digital silence -36.04, then zeros.

    Args:
        waveform: ``(N,)`` samples in [-1, 1].
        sample_rate: Samples per second. Where 10 ms are no whole number of samples, rows drift
            against motion, as published.

    Returns:
        ``(rows, 26)``, one row at least.

    Raises:
        ValueError: Not a waveform.
    """
    waveform = check_waveform(waveform)
    samples, step = (math.floor(s * sample_rate + 0.5) for s in (_FRAME_S, _STEP_S))
    frames = 1 + max(0, -(-(len(waveform) - samples) // step))
    signal = np.zeros((frames - 1) * step + samples)
    signal[: len(waveform)] = waveform.astype(np.float64) * _INTEGER_SCALE
    signal[1 : len(waveform)] -= _PRE_EMPHASIS * signal[: len(waveform) - 1]
    views = sliding_window_view(signal, samples)[::step]
    rows = np.empty((-(-frames // _FRAMES_PER_ROW), COEFFICIENTS), dtype=np.float32)
    for first in range(0, len(rows), _ROWS_PER_BLOCK):
        last = min(first + _ROWS_PER_BLOCK, len(rows))
        values = _of_frames(views[first * _FRAMES_PER_ROW : last * _FRAMES_PER_ROW], sample_rate)
        begins = np.arange(0, len(values), _FRAMES_PER_ROW)
        counts = np.diff([*begins, len(values)])
        rows[first:last] = np.add.reduceat(values, begins) / counts[:, None]
    return rows


def _of_frames(frames: NDArray[np.float64], sample_rate: int) -> NDArray[np.float64]:
    spectrum = fft.rfft(frames, _FFT_SAMPLES)
    power = (spectrum.real**2 + spectrum.imag**2) / _FFT_SAMPLES
    bands = power @ _triangles(sample_rate)
    values = fft.dct(np.log(np.where(bands == 0, _SMALLEST, bands)), norm="ortho")
    values *= 1 + _LIFTER / 2 * np.sin(np.pi * np.arange(COEFFICIENTS) / _LIFTER)
    energy = power.sum(axis=1)
    values[:, 0] = np.log(np.where(energy == 0, _SMALLEST, energy))
    return values


@lru_cache(maxsize=4)
def _triangles(sample_rate: int) -> NDArray[np.float64]:
    """``(513, 26)`` weights of the spectrum's bins."""
    highest = 2595 * np.log10(1 + sample_rate / 2 / 700)
    edges_hz = 700 * (10 ** (np.linspace(0, highest, COEFFICIENTS + 2) / 2595) - 1)
    edges = np.floor((_FFT_SAMPLES + 1) * edges_hz / sample_rate)
    bins = np.arange(_FFT_SAMPLES // 2 + 1)[:, None]
    left, centre, right = edges[:-2], edges[1:-1], edges[2:]
    rising, falling = (bins - left) / (centre - left), (right - bins) / (right - centre)
    return np.maximum(0, np.minimum(rising, falling))
