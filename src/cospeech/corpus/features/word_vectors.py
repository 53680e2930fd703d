"""The vector of the word that is being said, from a table of words or a language model."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.field import SpeechField
from cospeech.speech.speech import Speech, Word
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
        values[on_frames(word, fps)] = vector
    return values


def on_frames(word: Word, fps: float) -> slice:
    """The frames of a word: those that it is said in, and at least that of its onset."""
    onset = max(0, int(np.floor(word.start * fps + 1e-6)))
    return slice(onset, max(onset + 1, int(np.ceil(word.end * fps - 1e-6))))


class Packaged:
    """The packaged MiniLM, read when the first vector is asked for.

    Args:
        special_tokens: See `ContextualVectors`.
    """

    dimensions = PACKAGED_DIMENSIONS

    def __init__(self, special_tokens: bool = True) -> None:
        self.version = "minilm" if special_tokens else "minilm-bare"
        self._special_tokens = special_tokens

    def vectors(self, words: Sequence[Word]) -> NDArray[np.float32]:
        """See `WordVectors`."""
        return _packaged(self._special_tokens).vectors(words)


@lru_cache(maxsize=2)
def _packaged(special_tokens: bool) -> WordVectors:
    return ContextualVectors(special_tokens=special_tokens)


WORD_VECTORS = word_vectors(Packaged())
