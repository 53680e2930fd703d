"""Acoustic features: log-mel, MFCC and energy (pitch is in `pitch`).

One code path serves data preparation, training and synthesis. Every function takes 16 kHz
waveforms ``(..., N)`` as a NumPy array or a Torch tensor (any device, differentiable) and answers
in kind. Frame i is centred on sample ``i * hop_samples``, and there are ``1 + N // hop_samples``
frames: what a frame needs beyond the ends is taken as silence.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from cospeech.speech.band_power import slaney_bands
from cospeech.speech.speech import SAMPLE_RATE

Waveform = TypeVar("Waveform", Tensor, NDArray[np.float32])

SMALLEST_POWER = 1e-10
"""Powers below this count as this, so that silence has a logarithm: -100 dB."""


@dataclass(frozen=True)
class MelSpec:
    """A mel power spectrogram (Slaney's mel scale, triangles of equal area, periodic Hann window).

    Attributes:
        fft_samples: Samples per frame, and of its window.
        hop_samples: Samples from one frame's centre to the next.
        bands: Number of mel bands.
        lowest_hz: Lower edge of the first band.
        highest_hz: Upper edge of the last band, at most 8000.
        range_db: What lies further below the clip's maximum is raised to this distance.
    """

    fft_samples: int = 1024
    hop_samples: int = 512
    bands: int = 128
    lowest_hz: float = 0.0
    highest_hz: float = SAMPLE_RATE / 2
    range_db: float = 80.0

    def __post_init__(self) -> None:
        if not 0 <= self.lowest_hz < self.highest_hz <= SAMPLE_RATE / 2:
            raise ValueError(
                f"mel bands must lie between 0 and {SAMPLE_RATE // 2} Hz, "
                f"got {self.lowest_hz:g} to {self.highest_hz:g} Hz"
            )


TRIMODAL_MEL = MelSpec()
"""The published spectrogram of the trimodal paper: 31.25 frames per second.

See docs/facts/trimodal.md, section 3.5.
"""

CEPSTRAL_MEL = MelSpec(fft_samples=512, hop_samples=160, bands=40, lowest_hz=20.0)
"""A usual choice for MFCC: 32 ms frames, 100 per second."""


def log_mel(waveform: Waveform, spec: MelSpec = TRIMODAL_MEL) -> Waveform:
    """Mel power spectrogram in dB below the maximum of its clip.

    See docs/facts/trimodal.md, section 3.5.

    A louder copy of a clip has the same features. A clip of digital silence has no maximum to
    compare with and is ``-range_db`` throughout.

    Args:
        waveform: ``(..., N)`` samples at 16 kHz; the maximum is taken per clip.
        spec: Frames and bands.

    Returns:
        ``(..., bands, 1 + N // hop_samples)`` dB in [-range_db, 0].
    """
    power_db = _mel_power_db(_as_tensor(waveform), spec)
    peak_db = power_db.amax(dim=(-2, -1), keepdim=True)
    relative_db = (power_db - peak_db).clamp(min=-spec.range_db)
    is_silent = peak_db <= 10 * np.log10(SMALLEST_POWER)
    return _like(waveform, relative_db.masked_fill(is_silent, -spec.range_db))


def mfcc(waveform: Waveform, coefficients: int = 13, spec: MelSpec = CEPSTRAL_MEL) -> Waveform:
    """Mel-frequency cepstral coefficients: orthonormal DCT-II of the mel powers in absolute dB.

    The level is kept: coefficient 0 is ``sqrt(bands)`` times the mean band level in dB.

    Args:
        waveform: ``(..., N)`` samples at 16 kHz.
        coefficients: How many, counted from coefficient 0; at most ``spec.bands``.
        spec: Frames and bands of the spectrogram underneath.

    Returns:
        ``(..., coefficients, 1 + N // hop_samples)``.

    Raises:
        ValueError: More coefficients than bands.
    """
    if not 1 <= coefficients <= spec.bands:
        raise ValueError(f"{spec.bands} mel bands give 1 to {spec.bands} coefficients")
    power_db = _mel_power_db(_as_tensor(waveform), spec)
    floor_db = power_db.amax(dim=(-2, -1), keepdim=True) - spec.range_db
    cosines = torch.from_numpy(_cosines(coefficients, spec.bands)).to(power_db)
    return _like(waveform, cosines @ torch.maximum(power_db, floor_db))


def energy(waveform: Waveform, frame_samples: int = 640, hop_samples: int = 160) -> Waveform:
    """Level of each frame: RMS in dB relative to full scale (a full-scale sine is -3.01 dB).

    The mean runs over the samples inside the recording only, so the level doesn't sag at its ends.

    Args:
        waveform: ``(..., N)`` samples at 16 kHz.
        frame_samples: Samples per frame, even; 640 are 40 ms.
        hop_samples: Samples from one frame's centre to the next; 160 are 10 ms.

    Returns:
        ``(..., 1 + N // hop_samples)`` dB, at least -100 (digital silence).

    Raises:
        ValueError: An odd frame, which would have no centre between samples.
    """
    if frame_samples % 2:
        raise ValueError(f"frame_samples must be even, got {frame_samples}")
    squares = _as_tensor(waveform).square()
    mean_square = torch.nn.functional.avg_pool1d(
        squares.reshape(-1, 1, squares.shape[-1]),
        frame_samples,
        hop_samples,
        padding=frame_samples // 2,
        count_include_pad=False,
    ).reshape(*squares.shape[:-1], -1)
    return _like(waveform, 10 * mean_square.clamp(min=SMALLEST_POWER).log10())


def _as_tensor(waveform: Tensor | NDArray[np.float32]) -> Tensor:
    samples = torch.as_tensor(waveform)
    if not samples.is_floating_point():
        raise ValueError(f"a waveform is float in [-1, 1], got {samples.dtype}")
    if samples.ndim == 0 or samples.shape[-1] == 0:
        raise ValueError("a waveform needs at least one sample")
    return samples.to(torch.float32)


def _like(waveform: Waveform, features: Tensor) -> Waveform:
    return features.numpy() if isinstance(waveform, np.ndarray) else features


def _mel_power_db(samples: Tensor, spec: MelSpec) -> Tensor:
    spectrum = torch.stft(
        samples.reshape(-1, samples.shape[-1]),
        spec.fft_samples,
        spec.hop_samples,
        window=torch.hann_window(spec.fft_samples, device=samples.device),
        center=True,
        pad_mode="constant",
        return_complex=True,
    )
    power = spectrum.real.square() + spectrum.imag.square()
    bands = slaney_bands(spec.fft_samples, SAMPLE_RATE, spec.bands, spec.lowest_hz, spec.highest_hz)
    mel = torch.from_numpy(bands).to(power) @ power
    power_db = 10 * mel.clamp(min=SMALLEST_POWER).log10()
    return power_db.reshape(*samples.shape[:-1], *power_db.shape[-2:])


@lru_cache(maxsize=16)
def _cosines(coefficients: int, bands: int) -> NDArray[np.float32]:
    """``(coefficients, bands)`` rows of the orthonormal DCT-II."""
    order, band = np.ogrid[:coefficients, :bands]
    rows = np.sqrt(2 / bands) * np.cos(np.pi * order * (2 * band + 1) / (2 * bands))
    rows[0] /= np.sqrt(2)
    return rows.astype(np.float32)
