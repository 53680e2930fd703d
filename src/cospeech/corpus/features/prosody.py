"""Energy and pitch as single papers define them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.field import SpeechField
from cospeech.speech.feature_sets import gesticulator_prosody
from cospeech.speech.speech import Speech


def _gesticulator(speech: Speech, fps: float, frames: int) -> NDArray[np.float32]:
    return gesticulator_prosody.gesticulator_prosody(speech.waveform)


GESTICULATOR_PROSODY = SpeechField(
    name="prosody_gesticulator",
    reads="sound",
    width=gesticulator_prosody.CHANNELS,
    unit="logarithms of energy and of pitch (0 without), each followed by its change per ms",
    fps=float(gesticulator_prosody.FPS),
    sees_whole_clip=True,  # what is voiced is judged against the loudest sample
    compute=_gesticulator,
)
