"""The 26 MFCC and F0 of the multi-adversary paper, and the general measures that go with them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.field import Context, SpeechField
from cospeech.speech.feature_sets import opensmile
from cospeech.speech.features import CEPSTRAL_MEL, energy, mfcc
from cospeech.speech.pitch import SPEECH_PITCH, f0
from cospeech.speech.speech import SAMPLE_RATE, Speech

_COEFFICIENTS = 13


def _acoustics(speech: Speech, fps: float, frames: int) -> NDArray[np.float32]:
    features = opensmile.opensmile_features(speech.waveform)
    if len(features):
        return features
    # Shorter than a frame of 20 ms: what is there, then silence.
    return opensmile.opensmile_features(speech.waveform, frames=1)


def _mfcc(speech: Speech, fps: float, frames: int) -> NDArray[np.float32]:
    return np.ascontiguousarray(mfcc(speech.waveform, _COEFFICIENTS).T)


def _pitch(speech: Speech, fps: float, frames: int) -> NDArray[np.float32]:
    return np.nan_to_num(f0(speech.waveform), nan=0.0)[:, None]


def _energy(speech: Speech, fps: float, frames: int) -> NDArray[np.float32]:
    return energy(speech.waveform)[:, None]


ACOUSTICS = SpeechField(
    name="acoustics",
    reads="sound",
    width=opensmile.COEFFICIENTS + 1,
    unit="26 cepstral coefficients (no unit), then F0 in Hz, 0 where unvoiced",
    version=2,
    fps=opensmile.FPS,
    sees_whole_clip=True,  # what is voiced is judged against the loudest sample
    compute=_acoustics,
)
MFCC = SpeechField(
    name="mfcc",
    reads="sound",
    width=_COEFFICIENTS,
    unit="cepstral coefficients of mel powers in dB",
    fps=SAMPLE_RATE / CEPSTRAL_MEL.hop_samples,
    sees_whole_clip=True,  # powers are raised to 80 dB below the loudest
    compute=_mfcc,
)
PITCH = SpeechField(
    name="pitch",
    reads="sound",
    unit="Hz, 0 where unvoiced",
    fps=SAMPLE_RATE / SPEECH_PITCH.hop_samples,
    sees_whole_clip=True,
    compute=_pitch,
)
ENERGY = SpeechField(
    name="energy",
    reads="sound",
    unit="dB of full scale",
    fps=100.0,
    context=Context(rows_before=2, rows_after=0, samples=320),  # the 40 ms around a row
    compute=_energy,
)
