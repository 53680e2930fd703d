"""The vector of the word that is being said, from a table of words or a language model."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.field import SpeechField
from cospeech.speech.speech import Speech
from cospeech.speech.text.contextual import PACKAGED_DIMENSIONS, ContextualVectors
from cospeech.speech.text.vectors import WordVectors


def word_vectors(provider: WordVectors) -> SpeechField:
    """The field ``word_vectors`` of a provider, kept under the provider's version.

    A frame has the vector of the word that is said while it is shown, the later one of two; every
    word has the frame of its onset, however short it is. Where nobody speaks, and without a
    transcript, there are zeros.

    Args:
        provider: Gives a vector for each word.
    """

    def compute(speech: Speech, fps: float, frames: int) -> NDArray[np.float32]:
        return _on_frames(provider, speech, fps, frames)

    return SpeechField(
        name="word_vectors",
        reads="words",
        width=provider.dimensions,
        unit="no unit",
        version=provider.version,
        sees_whole_clip=True,  # a language model reads what comes later, too
        compute=compute,
    )


def _on_frames(
    provider: WordVectors, speech: Speech, fps: float, frames: int
) -> NDArray[np.float32]:
    values = np.zeros((frames, provider.dimensions), dtype=np.float32)
    words = speech.words or ()
    for word, vector in zip(words, provider.vectors(words), strict=True):
        onset = max(0, int(np.floor(word.start * fps + 1e-6)))
        values[onset : max(onset + 1, int(np.ceil(word.end * fps - 1e-6)))] = vector
    return values


@lru_cache(maxsize=1)
def _packaged() -> WordVectors:
    return ContextualVectors()


def _by_the_packaged(speech: Speech, fps: float, frames: int) -> NDArray[np.float32]:
    return _on_frames(_packaged(), speech, fps, frames)


WORD_VECTORS = SpeechField(
    name="word_vectors",
    reads="words",
    width=PACKAGED_DIMENSIONS,
    unit="no unit; of the packaged MiniLM, or of the provider that the windows name",
    version="minilm",
    sees_whole_clip=True,
    compute=_by_the_packaged,
)
