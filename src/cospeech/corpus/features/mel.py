"""Mel spectrograms as single papers define them."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.field import Context, Placed, SpeechField
from cospeech.speech.feature_sets import gesticulator
from cospeech.speech.features import TRIMODAL_MEL, log_mel
from cospeech.speech.resampling import BLOCK
from cospeech.speech.speech import SAMPLE_RATE, Speech


def _trimodal(speech: Speech, fps: float, frames: int) -> NDArray[np.float32]:
    return np.ascontiguousarray(log_mel(speech.waveform).T)


def _gesticulator(speech: Speech, fps: float, frames: int) -> NDArray[np.float32]:
    return gesticulator.gesticulator_log_mel(speech.waveform)


def _gesticulator_part(waveform: NDArray[np.float32], first_sample: int) -> NDArray[np.float32]:
    return gesticulator.gesticulator_log_mel(waveform, first_sample=first_sample)


def _by_index(speech: Speech, fps: float, frames: int) -> NDArray[np.float32]:
    values = _by_index_part(speech.waveform, 0)
    return values[np.arange(frames).clip(max=len(values) - 1)]


def _by_index_part(waveform: NDArray[np.float32], first_sample: int) -> NDArray[np.float32]:
    return gesticulator.gesticulator_log_mel(
        waveform, published_hop=True, first_sample=first_sample
    )


def gesticulator_mel(published_hop: bool) -> SpeechField:
    """The field ``mel_gesticulator``.

    Args:
        published_hop: Frames 1102 samples apart, paired by index with those of a method at 20 fps.
    """
    return GESTICULATOR_BY_INDEX if published_hop else GESTICULATOR


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
    version=2,
    fps=float(gesticulator.FPS),
    context=Context(rows_before=2, rows_after=0, samples=gesticulator.SAMPLES_AHEAD),
    placed=Placed(Fraction(SAMPLE_RATE, gesticulator.FPS), BLOCK, _gesticulator_part),
    compute=_gesticulator,
)
# Row i lies earlier than the frame that it is paired with, the more the later it is.
GESTICULATOR_BY_INDEX = replace(
    GESTICULATOR,
    version="2-hop1102",
    fps=None,
    placed=Placed(gesticulator.PUBLISHED_HOP, BLOCK, _by_index_part),
    compute=_by_index,
)
