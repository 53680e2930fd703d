"""Gesticulator's prosody: energy, pitch and how they change, at 20 fps (Kucherenko et al. 2020).

See docs/facts/trinity_and_gesticulator.md, section 2.

Energy and pitch are taken every 5 ms, and a row is the mean of the ten values from its time on.
Energy is ``max(0, ln(dB) - 3)`` of the intensity in dB above 20 uPa (a sample of 1 counts as 1 Pa)
under a Kaiser window of 64 ms; pitch is ``max(0, ln(Hz + 1) - 4)``; in silence and where nothing is
voiced they are 0. How they change is the step from the value before over 5, that is per millisecond
(0 at the first), averaged in the same way. Within 32 ms of an end of the sound there is no energy,
within 20 ms no pitch, as published.

Intensity is Praat's, by its definition (Boersma's manual, "Sound: To Intensity"), at the times
themselves; the published code interpolates between Praat's own frames, whose times follow from the
length of the file. Pitch is `cospeech.speech.pitch`'s up to 600 Hz, the method that Praat uses.

Compared with the published numbers: of the sound of tests/parity at 16 kHz, 591 of 599 energies are
within 1e-3; the rest are beside digital silence or the end and up to 1.3 off, which leaves rows up
to 0.045 off; pitches are voiced in the same places and within 0.002. Of a recording of 1.5 s at
22 050 Hz (LJ002-0020), energies of rows differ by 0.007 on average and 0.13 at most, pitches by
0.031 and 0.16, where 7 of 307 values are voiced in one of the two alone.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.special import i0

from cospeech.speech.band_power import check_waveform
from cospeech.speech.pitch import PitchSpec, f0
from cospeech.speech.speech import SAMPLE_RATE

FPS = 20
CHANNELS = 4
"""Energy, its change, pitch, its change."""

_HOP_SAMPLES = SAMPLE_RATE // 200
_VALUES_PER_ROW = 10
_STEP_MS = 5
_PITCH = PitchSpec(hop_samples=_HOP_SAMPLES, highest_hz=600.0, candidates=15)
_LOWEST_OF_INTENSITY_HZ = 100
_REFERENCE_POWER = 4e-10
_HALF_WINDOW = round(3.2 / _LOWEST_OF_INTENSITY_HZ * SAMPLE_RATE)
_HALF_PITCH_FRAME = round(1.5 / _PITCH.lowest_hz * SAMPLE_RATE)
_VALUES_PER_BLOCK = 512  # bounds memory, however long the recording


def gesticulator_prosody(waveform: NDArray[np.float32]) -> NDArray[np.float32]:
    """Energy, its change per ms, pitch and its change per ms of each row of 50 ms.

    Args:
        waveform: ``(N,)`` samples at 16 kHz in [-1, 1].

    Returns:
        ``(rows, 4)``, one row at least, not normalised. The mean of the last row is over what there
        is of it; the published code drops an incomplete one.

    Raises:
        ValueError: Not a waveform.
    """
    track = prosody_track(waveform)
    changes = np.diff(track, axis=0, prepend=track[:1]) / _STEP_MS
    values = np.stack([track, changes], axis=-1).reshape(len(track), CHANNELS)
    begins = np.arange(0, len(values), _VALUES_PER_ROW)
    counts = np.diff([*begins, len(values)])
    rows = np.add.reduceat(values, begins) / counts[:, None]
    return rows.astype(np.float32)


def prosody_track(waveform: NDArray[np.float32]) -> NDArray[np.float64]:
    """Energy and pitch every 5 ms from 0 on, as long as there is sound, ``(ceil(N / 80), 2)``.

    Raises:
        ValueError: Not a waveform.
    """
    waveform = check_waveform(waveform)
    centres = np.arange(0, len(waveform), _HOP_SAMPLES)
    hertz = np.nan_to_num(f0(waveform, _PITCH)[: len(centres)].astype(np.float64))
    hertz[~_is_inside(centres, _HALF_PITCH_FRAME, len(waveform))] = 0
    pitch = np.maximum(0, np.log(hertz + 1) - 4)
    return np.stack([_energy(waveform, centres), pitch], axis=1)


def _energy(waveform: NDArray[np.float32], centres: NDArray[np.int64]) -> NDArray[np.float64]:
    inside = np.flatnonzero(_is_inside(centres, _HALF_WINDOW, len(waveform)))
    energy = np.zeros(len(centres))
    if not len(inside):
        return energy
    place = np.arange(-_HALF_WINDOW, _HALF_WINDOW + 1) / _HALF_WINDOW
    window = i0((2 * np.pi**2 + 0.5) * np.sqrt(1 - place**2))
    window /= window.sum()
    views = sliding_window_view(waveform, len(window))
    for first in range(0, len(inside), _VALUES_PER_BLOCK):
        rows = inside[first : first + _VALUES_PER_BLOCK]
        frames = views[centres[rows] - _HALF_WINDOW].astype(np.float64)
        frames -= frames.mean(axis=1, keepdims=True)
        power = frames**2 @ window / _REFERENCE_POWER
        decibels = 10 * np.log10(np.maximum(power, 1))
        energy[rows] = np.maximum(0, np.log(np.maximum(decibels, 1)) - 3)
    return energy


def _is_inside(centres: NDArray[np.int64], half: int, samples: int) -> NDArray[np.bool_]:
    return (centres >= half) & (centres <= samples - half)
