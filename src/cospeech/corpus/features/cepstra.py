"""Cepstra as single papers define them.

Motion matching's are Sphinx' with a log energy, at a method's own rate, and their slopes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.field import Context, SpeechField
from cospeech.speech.feature_sets import gesticulator_cepstra
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


def _gesticulator(speech: Speech, fps: float, frames: int) -> NDArray[np.float32]:
    return gesticulator_cepstra.gesticulator_cepstra(speech.waveform)


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
GESTICULATOR_CEPSTRA = SpeechField(
    name="cepstra_gesticulator",
    reads="sound",
    width=gesticulator_cepstra.COEFFICIENTS,
    unit="natural logarithm of energy, then 25 liftered cepstra (no unit)",
    fps=float(gesticulator_cepstra.FPS),
    # Pre-emphasis looks back to the end of the row before.
    context=Context(rows_before=1, rows_after=0, samples=gesticulator_cepstra.ROW_SAMPLES),
    compute=_gesticulator,
)
