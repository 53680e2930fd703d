"""Sphinx cepstra and log energy at a method's own rate, with their slopes (motion matching)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.field import Context, SpeechField
from cospeech.speech.feature_sets.sphinx import (
    FRAME_SAMPLES,
    STATIC_CHANNELS,
    sphinx_features,
    with_slopes,
)
from cospeech.speech.speech import Speech


def _static(speech: Speech, fps: float, frames: int) -> NDArray[np.float32]:
    return sphinx_features(speech.waveform, fps, frames)


def _cepstra(speech: Speech, fps: float, frames: int) -> NDArray[np.float32]:
    return with_slopes(_static(speech, fps, frames))


STATIC_CEPSTRA = SpeechField(
    name="static_cepstra",
    reads="sound",
    width=STATIC_CHANNELS,
    unit="13 cepstra and the energy's logarithm (no unit)",
    # Pre-emphasis looks back to the end of the row before.
    context=Context(rows_before=1, rows_after=0, samples=FRAME_SAMPLES),
    compute=_static,
)
CEPSTRA = SpeechField(
    name="cepstra",
    reads="sound",
    width=2 * STATIC_CHANNELS,
    unit="13 cepstra and the energy's logarithm (no unit), then the change of each per frame",
    context=Context(rows_before=3, rows_after=2, samples=FRAME_SAMPLES),
    compute=_cepstra,
)
