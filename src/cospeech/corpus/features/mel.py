"""Mel spectrograms as single papers define them."""

from __future__ import annotations

from dataclasses import replace

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


def _by_published_hop(speech: Speech, fps: float, frames: int) -> NDArray[np.float32]:
    values = gesticulator.gesticulator_log_mel(speech.waveform, published_hop=True)
    return values[np.arange(frames).clip(max=len(values) - 1)]


def gesticulator_mel(published_hop: bool) -> SpeechField:
    """The field ``mel_gesticulator``: frames at their times, or 1102 samples apart and by index."""
    if not published_hop:
        return GESTICULATOR
    return replace(GESTICULATOR, version="hop1102", fps=None, compute=_by_published_hop)


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
