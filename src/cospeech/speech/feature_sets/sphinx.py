"""Sphinx-III cepstra and log energy at a motion's own rate (Habibie et al. 2022).

See docs/facts/motion_matching.md, section 2.

Frame i begins at sample ``round(i * 16000 / fps)`` and has 409 samples (25.6 ms), however far the
next one is: at 15 fps 62 % of the audio is never looked at, as published. Samples are on the scale
of 16-bit integers; at [-1, 1] the energy would be 0 everywhere and the logarithm's floor would cut
quiet frames.

Of a frame: pre-emphasis of 0.97, whose state is the last sample of the frame *before* (not the
sample before), a Hamming window, the power spectrum of 512 samples, 40 triangles of area 1 between
133.3333 and 6855.4976 Hz whose edges lie on bins of the spectrum, natural logarithms of at least
1e-5, and Sphinx' "legacy" cosine transform, in which the lowest band counts half. The 14th channel
is ``ln(1 + mean square)`` of the samples as they are.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from cospeech.speech.band_power import check_waveform
from cospeech.speech.feature_sets.opensmile import slopes
from cospeech.speech.speech import SAMPLE_RATE

STATIC_CHANNELS = 14
"""13 cepstra and the energy: what the search compares."""

FRAME_SAMPLES = 409
"""25.6 ms."""

_INTEGER_SCALE = np.float32(32767)
_CEPSTRA = 13
_BANDS = 40
_FFT_SAMPLES = 512
_LOWEST_HZ, _HIGHEST_HZ = 133.3333, 6855.4976
_PRE_EMPHASIS = 0.97
_SMALLEST_POWER = 1e-5
_FRAMES_PER_BLOCK = 1024  # bounds memory, however long the recording


def sphinx_frames(samples: int, fps: float) -> int:
    """Frames of a waveform: one for each frame of motion that begins inside it.

    The published routine gives one more, which the published code drops.
    """
    return math.floor(samples * fps / SAMPLE_RATE + 1e-9)


def sphinx_features(
    waveform: NDArray[np.float32], fps: float, frames: int | None = None
) -> NDArray[np.float32]:
    """13 cepstra and the log of the mean energy of each frame, not normalised.

    A frame that runs past the end repeats the samples it has, from its own beginning.

    Args:
        waveform: ``(N,)`` samples at 16 kHz, in [-1, 1].
        fps: Frames per second; frame i pairs with frame i of motion at that rate.
        frames: Frames wanted, as many as the motion has; those that begin past the end are silent.
            None for `sphinx_frames`.

    Returns:
        ``(frames, 14)``.

    Raises:
        ValueError: Not a waveform, a rate that isn't positive, or a negative number of frames.
    """
    waveform = check_waveform(waveform) * _INTEGER_SCALE
    if not fps > 0:
        raise ValueError(f"fps must be positive, got {fps}")
    count = sphinx_frames(len(waveform), fps) if frames is None else frames
    if count < 0:
        raise ValueError(f"{frames} frames were asked for")
    features = np.empty((count, STATIC_CHANNELS), dtype=np.float32)
    previous = 0.0
    for first in range(0, count, _FRAMES_PER_BLOCK):
        rows = np.arange(first, min(first + _FRAMES_PER_BLOCK, count))
        samples = _framed(waveform, np.rint(rows * SAMPLE_RATE / fps).astype(np.int64))
        before = np.empty_like(samples)
        before[:, 1:] = samples[:, :-1]
        before[0, 0] = previous
        before[1:, 0] = samples[:-1, -1]
        previous = float(samples[-1, -1])
        spectrum = fft.rfft((samples - _PRE_EMPHASIS * before) * _window(), _FFT_SAMPLES)
        power = (spectrum.real**2 + spectrum.imag**2) @ _triangles()
        logarithms = np.log(np.maximum(power, _SMALLEST_POWER))
        features[rows, :_CEPSTRA] = logarithms @ _cosines()
        features[rows, _CEPSTRA] = np.log1p((samples**2).mean(axis=1))
    return features


def with_slopes(static: NDArray[np.float32]) -> NDArray[np.float32]:
    """The 14 channels and their change per frame: what the refinement network hears.

    Cepstra by regression over two frames to either side, energy by the step to the next frame (0
    at the last), as the paper names no formula (docs/facts/motion_matching.md, section 10, decision
    4).

    Args:
        static: ``(T, 14)`` from `sphinx_features`.

    Returns:
        ``(T, 28)``.
    """
    changes = np.zeros_like(static)
    changes[:, :_CEPSTRA] = slopes(static[:, :_CEPSTRA])
    changes[:-1, _CEPSTRA] = static[1:, _CEPSTRA] - static[:-1, _CEPSTRA]
    return np.concatenate([static, changes], axis=1)


def _framed(waveform: NDArray[np.float32], starts: NDArray[np.int64]) -> NDArray[np.float64]:
    """``(frames, 409)`` samples; frames that run past the end repeat what they have."""
    there = (len(waveform) - starts).clip(0, FRAME_SAMPLES)
    offsets = np.arange(FRAME_SAMPLES) % np.maximum(there, 1)[:, None]
    places = (starts[:, None] + offsets).clip(max=len(waveform) - 1)
    samples = waveform[places].astype(np.float64)
    samples[there == 0] = 0
    return samples


@lru_cache(maxsize=1)
def _window() -> NDArray[np.float64]:
    return np.hamming(FRAME_SAMPLES)


@lru_cache(maxsize=1)
def _triangles() -> NDArray[np.float64]:
    """``(257, 40)`` weights of the spectrum's bins."""
    low, high = (2595 * np.log10(1 + hz / 700) for hz in (_LOWEST_HZ, _HIGHEST_HZ))
    edges_hz = 700 * (10 ** (np.linspace(low, high, _BANDS + 2) / 2595) - 1)
    bin_hz = SAMPLE_RATE / _FFT_SAMPLES
    edges = np.rint(edges_hz / bin_hz)
    bins = np.arange(_FFT_SAMPLES // 2 + 1)[:, None]
    left, centre, right = edges[:-2], edges[1:-1], edges[2:]
    rising, falling = (bins - left) / (centre - left), (right - bins) / (right - centre)
    heights = 2 / ((right - left) * bin_hz)
    return np.maximum(0, np.minimum(rising, falling)) * heights


@lru_cache(maxsize=1)
def _cosines() -> NDArray[np.float64]:
    """``(40, 13)``: logarithms to cepstra."""
    bands, coefficients = np.arange(_BANDS)[:, None], np.arange(_CEPSTRA)
    cosines = np.cos(np.pi * coefficients * (bands + 0.5) / _BANDS) / _BANDS
    cosines[0] /= 2
    return cosines
