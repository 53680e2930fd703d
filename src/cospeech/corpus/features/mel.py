"""Mel spectrograms as single papers define them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.field import SpeechField
from cospeech.speech.feature_sets import gesticulator
from cospeech.speech.features import TRIMODAL_MEL, log_mel
from cospeech.speech.speech import SAMPLE_RATE, Speech


def _trimodal(speech: Speech, fps: float, frames: int) -> NDArray[np.float32]:
    return np.ascontiguousarray(log_mel(speech.waveform).T)


def _gesticulator(speech: Speech, fps: float, frames: int) -> NDArray[np.float32]:
    return gesticulator.gesticulator_log_mel(speech.waveform)


TRIMODAL = SpeechField(
    name="mel_trimodal",
    reads="sound",
    width=TRIMODAL_MEL.bands,
    unit="dB below the clip's loudest",
    fps=SAMPLE_RATE / TRIMODAL_MEL.hop_samples,
    sees_whole_clip=True,
    compute=_trimodal,
)
GESTICULATOR = SpeechField(
    name="mel_gesticulator",
    reads="sound",
    width=gesticulator.BANDS,
    unit="natural logarithm of power",
    fps=float(gesticulator.FPS),
    compute=_gesticulator,
)
