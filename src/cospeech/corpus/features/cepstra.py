"""Sphinx cepstra and log energy at a method's own rate, with their slopes (motion matching)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.field import SpeechField
from cospeech.speech.feature_sets.sphinx import STATIC_CHANNELS, sphinx_features, with_slopes
from cospeech.speech.speech import Speech


def _cepstra(speech: Speech, fps: float, frames: int) -> NDArray[np.float32]:
    return with_slopes(sphinx_features(speech.waveform, fps, frames))


CEPSTRA = SpeechField(
    name="cepstra",
    reads="sound",
    width=2 * STATIC_CHANNELS,
    unit="13 cepstra and the energy's logarithm (no unit), then the change of each per frame",
    compute=_cepstra,
)
