"""Power in mel bands, in NumPy alone: worker processes that read corpora never import torch."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy import fft

_FRAMES_PER_BLOCK = 512  # bounds memory, however long the recording


def check_waveform(waveform: NDArray[np.float32]) -> NDArray[np.float32]:
    """A mono waveform as float32.

    Raises:
        ValueError: It's not a non-empty ``(N,)`` array of floats.
    """
    if waveform.ndim != 1 or waveform.size == 0 or waveform.dtype.kind != "f":
        raise ValueError(
            f"a waveform is (samples,) of floats, got {waveform.dtype} {waveform.shape}"
        )
    return waveform.astype(np.float32, copy=False)


def band_power(
    signal: NDArray[np.float32],
    starts: NDArray[np.int64],
    window: NDArray[np.float32],
    bands: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Squared magnitudes of windowed frames, summed into bands.

    A frame's values are the same, to the bit, whichever others there are.

    Args:
        signal: ``(N,)`` samples.
        starts: ``(frames,)`` first sample of each frame; all frames lie inside the signal.
        window: ``(samples,)`` weights of a frame's samples; zeros fill up a longer FFT.
        bands: ``(bands, fft_samples // 2 + 1)`` weights of the FFT's bins.

    Returns:
        ``(frames, bands)``.
    """
    fft_samples = 2 * (bands.shape[1] - 1)
    power = np.empty((len(starts), len(bands)), dtype=np.float32)
    if len(starts) == 0:
        return power
    views = sliding_window_view(signal, len(window))
    for first in range(0, len(starts), _FRAMES_PER_BLOCK):
        rows = slice(first, first + _FRAMES_PER_BLOCK)
        spectrum = fft.rfft(views[starts[rows]] * window, fft_samples)
        energies = spectrum.real**2 + spectrum.imag**2
        # A product for each frame: one of all differs in the last bit with their number.
        power[rows] = np.matmul(energies[:, None], bands.T)[:, 0]
    return power


@lru_cache(maxsize=16)
def slaney_bands(
    fft_samples: int, sample_rate: int, bands: int, lowest_hz: float, highest_hz: float
) -> NDArray[np.float32]:
    """Triangles over Hz with edges even on Slaney's mel scale, each of area 1 over its width in Hz.

    The scale has 15 mel per 1000 Hz up to there, then 27 mel for each factor of 6.4.

    Args:
        fft_samples: Samples of the FFT whose bins are weighted.
        sample_rate: Samples per second.
        bands: Number of bands.
        lowest_hz: Lower edge of the first band.
        highest_hz: Upper edge of the last band.

    Returns:
        ``(bands, fft_samples // 2 + 1)``.
    """
    low_mel, high_mel = _slaney_mel(np.array([lowest_hz, highest_hz]))
    edges_hz = _slaney_hz(np.linspace(low_mel, high_mel, bands + 2))
    triangles = _triangles(_bins_hz(fft_samples, sample_rate), edges_hz)
    areas = (edges_hz[2:, None] - edges_hz[:-2, None]) / 2
    return (triangles / areas).astype(np.float32)


@lru_cache(maxsize=16)
def htk_bands(
    fft_samples: int, sample_rate: int, bands: int, lowest_hz: float, highest_hz: float
) -> NDArray[np.float32]:
    """Triangles of height 1 over HTK's mel scale, ``1127 ln(1 + f / 700)``, straight in mel.

    Args and result as in `slaney_bands`.
    """
    low_mel, high_mel = _htk_mel(np.array([lowest_hz, highest_hz]))
    bins_mel = _htk_mel(_bins_hz(fft_samples, sample_rate))
    return _triangles(bins_mel, np.linspace(low_mel, high_mel, bands + 2)).astype(np.float32)


def _bins_hz(fft_samples: int, sample_rate: int) -> NDArray[np.float64]:
    return np.arange(fft_samples // 2 + 1) * sample_rate / fft_samples


def _triangles(bins: NDArray[np.float64], edges: NDArray[np.float64]) -> NDArray[np.float64]:
    left, centre, right = edges[:-2, None], edges[1:-1, None], edges[2:, None]
    rising = (bins - left) / (centre - left)
    falling = (right - bins) / (right - centre)
    return np.maximum(0.0, np.minimum(rising, falling))


def _htk_mel(hz: NDArray[np.float64]) -> NDArray[np.float64]:
    return 1127 * np.log(1 + hz / 700)


def _slaney_mel(hz: NDArray[np.float64]) -> NDArray[np.float64]:
    above = 15 + 27 * np.log(np.maximum(hz, 1000) / 1000) / np.log(6.4)
    return np.where(hz < 1000, hz * 15 / 1000, above)


def _slaney_hz(mel: NDArray[np.float64]) -> NDArray[np.float64]:
    above = 1000 * np.exp((np.maximum(mel, 15) - 15) * np.log(6.4) / 27)
    return np.where(mel < 15, mel * 1000 / 15, above)
