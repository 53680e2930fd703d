"""Gesticulator's 64-band log-mel at 20 fps (Kucherenko et al. 2020).

See docs/facts/trinity_and_gesticulator.md, section 2.

Each frame is the power in 64 Slaney mel bands from 100 to 7500 Hz of 2048 samples at 22 050 Hz
(92.9 ms; the paper says 0.1 s) under a symmetric Hann window, as ``ln(power + 1e-10)``. It isn't
normalised. Beyond the ends the waveform is mirrored.

**Frame times.** The published hop is 1102 samples where 1102.5 would be 20 fps. Audio and motion
are paired by index, so after ten minutes a motion frame gets audio from 5.44 frames earlier. Here
frame i is centred on the sample nearest to ``i / 20`` s, at most 23 us away, and doesn't drift; the
published hop is a switch.

**Resampling.** The 16 kHz waveform is resampled to 22 050 Hz (soxr, high quality), so that window
and bands are the published ones. The published code resamples the original file straight to
22 050 Hz, with another filter; of a 44.1 kHz recording the features then differ by less than 0.0005
on average, by less than 0.01 in the topmost band.
"""

from __future__ import annotations

import numpy as np
import soxr
from numpy.typing import NDArray

from cospeech.speech.band_power import band_power, check_waveform, slaney_bands
from cospeech.speech.speech import SAMPLE_RATE

FPS = 20
BANDS = 64

_RATE = 22_050
_FFT_SAMPLES = 2048
_PUBLISHED_HOP_SAMPLES = 1102
_LOWEST_HZ, _HIGHEST_HZ = 100.0, 7500.0
_SMALLEST_POWER = np.float32(1e-10)


def gesticulator_log_mel(
    waveform: NDArray[np.float32], *, published_hop: bool = False
) -> NDArray[np.float32]:
    """Log-mel of each frame; there are always as many as motion at 20 fps needs, or more.

    Args:
        waveform: ``(N,)`` samples at 16 kHz.
        published_hop: Frames 1102 samples apart, as published, which drift against motion.

    Returns:
        ``(frames, 64)`` natural logarithms of power, -23.026 in digital silence, with
        ``frames = 1 + floor(20 seconds)``.

    Raises:
        ValueError: Not a waveform.
    """
    waveform = check_waveform(waveform)
    signal = soxr.resample(waveform, SAMPLE_RATE, _RATE)
    if published_hop:
        centres = np.arange(0, len(signal) + 1, _PUBLISHED_HOP_SAMPLES)
    else:
        index = np.arange(1 + len(waveform) * FPS // SAMPLE_RATE)
        centres = (index * _RATE + FPS // 2) // FPS
    half = _FFT_SAMPLES // 2
    # A padded frame begins where its centre was.
    power = band_power(
        np.pad(signal, (half, half + 1), mode="reflect"),
        centres,
        np.hanning(_FFT_SAMPLES).astype(np.float32),
        slaney_bands(_FFT_SAMPLES, _RATE, BANDS, _LOWEST_HZ, _HIGHEST_HZ),
    )
    return np.log(power + _SMALLEST_POWER)
