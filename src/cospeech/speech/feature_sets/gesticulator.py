"""Gesticulator's 64-band log-mel at 20 fps (Kucherenko et al. 2020).

See docs/facts/trinity_and_gesticulator.md, section 2.

Each frame is the power in 64 Slaney mel bands from 100 to 7500 Hz of 2048 samples at 22 050 Hz
(92.9 ms; the paper says 0.1 s) under a symmetric Hann window, as ``ln(power + 1e-10)``. It isn't
normalised. Beyond the ends the waveform is mirrored.

**Frame times.** The published hop is 1102 samples where 1102.5 would be 20 fps. Audio and motion
are paired by index, so after ten minutes a motion frame gets audio from 5.44 frames earlier. Here
frame i is centred on the sample nearest to ``i / 20`` s, at most 23 us away, and doesn't drift; the
published hop is a switch.

**Resampling.** The 16 kHz waveform is resampled to 22 050 Hz (`cospeech.speech.resampling`), so
that window and bands are the published ones. The published code resamples the original file
straight to 22 050 Hz, with another filter; of a 44.1 kHz recording the features then differ by less
than 0.0005 on average, by less than 0.01 in the topmost band.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from cospeech.speech.band_power import band_power, check_waveform, slaney_bands
from cospeech.speech.resampling import BLOCK, RATE, REACH_SAMPLES, RESAMPLED_BLOCK, resampled
from cospeech.speech.speech import SAMPLE_RATE

FPS = 20
BANDS = 64

_FFT_SAMPLES = 2048
_PUBLISHED_HOP_SAMPLES = 1102

PUBLISHED_HOP = Fraction(_PUBLISHED_HOP_SAMPLES * BLOCK, RESAMPLED_BLOCK)
"""Samples of 16 kHz from one frame to the next with the published hop."""

SAMPLES_AHEAD = REACH_SAMPLES + math.ceil(_FFT_SAMPLES / 2 * SAMPLE_RATE / RATE) + 1
"""Of 16 kHz, that a frame looks at from its time on; as many before it."""

_LOWEST_HZ, _HIGHEST_HZ = 100.0, 7500.0
_SMALLEST_POWER = np.float32(1e-10)


def gesticulator_log_mel(
    waveform: NDArray[np.float32], *, published_hop: bool = False, first_sample: int = 0
) -> NDArray[np.float32]:
    """Log-mel of each frame; there are always as many as motion at 20 fps needs, or more.

    Args:
        waveform: ``(N,)`` samples at 16 kHz.
        published_hop: Frames 1102 samples apart, as published, which drift against motion.
        first_sample: Where in a longer recording the waveform begins, a multiple of 320. Frames
            are the recording's, from the first that is centred in the waveform on; those that look
            before its beginning aren't whole.

    Returns:
        ``(frames, 64)`` natural logarithms of power, -23.026 in digital silence; of a whole
        recording, ``frames = 1 + floor(20 seconds)``.

    Raises:
        ValueError: Not a waveform.
    """
    waveform = check_waveform(waveform)
    signal = resampled(waveform)
    begin = first_sample // BLOCK * RESAMPLED_BLOCK
    if published_hop:
        first = -(-begin // _PUBLISHED_HOP_SAMPLES)
        last = (begin + len(signal)) // _PUBLISHED_HOP_SAMPLES
        centres = np.arange(first, last + 1) * _PUBLISHED_HOP_SAMPLES - begin
    else:
        first = -(-first_sample * FPS // SAMPLE_RATE)
        last = (first_sample + len(waveform)) * FPS // SAMPLE_RATE
        centres = (np.arange(first, last + 1) * RATE + FPS // 2) // FPS - begin
    half = _FFT_SAMPLES // 2
    # A padded frame begins where its centre was.
    power = band_power(
        np.pad(signal, (half, half + 1), mode="reflect"),
        centres,
        np.hanning(_FFT_SAMPLES).astype(np.float32),
        slaney_bands(_FFT_SAMPLES, RATE, BANDS, _LOWEST_HZ, _HIGHEST_HZ),
    )
    return np.log(power + _SMALLEST_POWER)
