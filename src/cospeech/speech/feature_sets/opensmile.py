"""26 MFCC and F0 at 100 fps, framed as openSMILE does (Ferstl et al. 2020).

See docs/facts/multi_adversary.md, section 2 and section 9, decisions 1 to 3.

The paper names openSMILE, 26 MFCC, F0, a window of 20 ms and a hop of 10 ms, and no more.

What is as in openSMILE, by its documentation: frames begin at sample 0, aren't centred and aren't
padded, so frame i covers the 20 ms *from* ``i / 100`` s on, has that time, and pairs with motion
frame i at 100 fps; a last frame that is incomplete is left out; the mel scale is
``1127 ln(1 + f / 700)`` from 20 to 8000 Hz with triangles straight in mel; logarithms are natural
ones, of powers of at least 1e-8 for samples in [-1, 1]; F0 is 0 Hz where unvoiced.

What was decided, as the paper's configuration isn't known: power, not magnitude; 40 bands;
coefficients 0 to 25 by an orthonormal DCT (HTK's c0 is larger by the root of 2); no pre-emphasis
and no lifter. The DCT's scale, a lifter and, nearly, pre-emphasis only scale or shift channels,
which the z-score after it takes back.

What was not checked: openSMILE's licence keeps it out of the tests, so no value was compared with
its own. F0 comes from `cospeech.speech.pitch` (Boersma's autocorrelation over 40 ms), not from
openSMILE's tracker: expect other octave errors and other voicing decisions.

Nothing is resampled: 16 kHz holds the bands up to 8000 Hz.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from cospeech.speech.band_power import band_power, check_waveform, htk_bands
from cospeech.speech.pitch import SPEECH_PITCH, f0
from cospeech.speech.speech import SAMPLE_RATE

FPS = 100
"""Frames per second; frame i has the time ``i / FPS``."""

COEFFICIENTS = 26
"""Cepstral channels, the first ones of every frame."""

Pitch = Literal["hertz", "log"]
Cepstra = Literal["static", "deltas"]

_HOP_SAMPLES = SAMPLE_RATE // FPS
_FRAME_SAMPLES = 2 * _HOP_SAMPLES
_FFT_SAMPLES = 512
_BANDS = 40
_LOWEST_HZ, _HIGHEST_HZ = 20.0, 8000.0
_SMALLEST_POWER = 1e-8
_DELTA_FRAMES = 2
_NO_VOICE_HZ = math.sqrt(SPEECH_PITCH.lowest_hz * SPEECH_PITCH.highest_hz)


def whole_frames(samples: int) -> int:
    """Frames that lie inside a waveform: one fewer than its 10 ms steps."""
    return max(0, samples // _HOP_SAMPLES - 1)


def opensmile_features(
    waveform: NDArray[np.float32],
    frames: int | None = None,
    *,
    pitch: Pitch = "hertz",
    cepstra: Cepstra = "static",
) -> NDArray[np.float32]:
    """26 cepstral channels and F0 of each frame at 100 fps, not normalised.

    F0 of frame i is measured around the middle of the frame, ``i / 100 + 0.01`` s. It depends on
    the loudest sample of the whole waveform, so cut features, not waveforms.

    Args:
        waveform: ``(N,)`` samples at 16 kHz.
        frames: Frames wanted, e.g. as many as the motion has; past the end there is silence. None
            gives the whole ones only, as openSMILE does.
        pitch: ``"hertz"``: one channel, 0 where unvoiced. ``"log"``: two channels, ln Hz
            interpolated over unvoiced frames (the nearest voiced value beyond the ends, 194 Hz
            where nothing is voiced), and voicing, 1 or 0.
        cepstra: ``"static"``: coefficients 0 to 25. ``"deltas"``: 0 to 12 and their regression
            slopes per frame over two frames to either side.

    Returns:
        ``(frames, 27)``, or ``(frames, 28)`` with ``pitch="log"``.

    Raises:
        ValueError: Not a waveform, or a negative number of frames.
    """
    waveform = check_waveform(waveform)
    count = whole_frames(len(waveform)) if frames is None else frames
    if count < 0:
        raise ValueError(f"{frames} frames were asked for")
    channels = [_cepstra(waveform, count, cepstra), _pitch(waveform, count, pitch)]
    return np.concatenate(channels, axis=1)


def _cepstra(waveform: NDArray[np.float32], count: int, cepstra: Cepstra) -> NDArray[np.float32]:
    needed = (count - 1) * _HOP_SAMPLES + _FRAME_SAMPLES
    power = band_power(
        np.pad(waveform, (0, max(0, needed - len(waveform)))),
        np.arange(count) * _HOP_SAMPLES,
        np.hamming(_FRAME_SAMPLES).astype(np.float32),
        htk_bands(_FFT_SAMPLES, SAMPLE_RATE, _BANDS, _LOWEST_HZ, _HIGHEST_HZ),
    )
    logarithms = np.log(np.maximum(power, _SMALLEST_POWER))
    coefficients: NDArray[np.float32] = fft.dct(logarithms, norm="ortho")[:, :COEFFICIENTS]
    if cepstra == "static" or count == 0:
        return coefficients
    static = coefficients[:, : COEFFICIENTS // 2]
    return np.concatenate([static, slopes(static)], axis=1)


def slopes(channels: NDArray[np.float32]) -> NDArray[np.float32]:
    """Regression over ``t - 2 ... t + 2``: sum of ``n (c[t+n] - c[t-n])`` over ``2 sum n^2``."""
    frames = len(channels)
    padded = np.pad(channels, ((_DELTA_FRAMES, _DELTA_FRAMES), (0, 0)), mode="edge")
    steps = range(1, _DELTA_FRAMES + 1)
    total = np.zeros_like(channels)
    for step in steps:
        later = padded[_DELTA_FRAMES + step :][:frames]
        earlier = padded[_DELTA_FRAMES - step :][:frames]
        total += step * (later - earlier)
    return total / np.float32(2 * sum(step**2 for step in steps))


def _pitch(waveform: NDArray[np.float32], count: int, pitch: Pitch) -> NDArray[np.float32]:
    # Pitch frames are centred on multiples of the hop, so number i + 1 has the middle of frame i.
    inside = f0(waveform)[1 : count + 1]
    hertz = np.pad(inside, (0, count - len(inside)), constant_values=np.nan)
    is_voiced = ~np.isnan(hertz)
    if pitch == "hertz":
        return np.where(is_voiced, hertz, np.float32(0))[:, None]
    voiced = np.flatnonzero(is_voiced)
    if len(voiced):
        log_hertz = np.interp(np.arange(count), voiced, np.log(hertz[voiced]))
    else:
        log_hertz = np.full(count, math.log(_NO_VOICE_HZ))
    return np.stack([log_hertz, is_voiced], axis=1).astype(np.float32)
