"""The vector of the word that is being said, and how far it has got (Kucherenko et al. 2020).

See docs/facts/trinity_and_gesticulator.md, section 3.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.field import SpeechField
from cospeech.corpus.features.word_vectors import Packaged, on_frames
from cospeech.speech.speech import Speech, Word
from cospeech.speech.text.spoken_words import (
    FILLER,
    FILLERS,
    PUBLISHED_FPS,
    SILENCE,
    TIMING_NAMES,
    published_words,
)
from cospeech.speech.text.syllables import count_syllables
from cospeech.speech.text.vectors import WordVectors

SILENCE_VALUE = -15.0
"""Every number of the vector where nobody speaks."""


def spoken_words(provider: WordVectors, published: bool = False) -> SpeechField:
    """The field ``spoken_words`` of a provider: its vectors, then five numbers of timing.

    Of the word that is said: time since it began and until it ends, its duration, s; how much of it
    is over, 0 to 1; its syllables per second, where a word has one at least. In silence the vector
    is `SILENCE_VALUE` everywhere and the timing 0; a filler (`FILLERS`) has the vectors' mean of
    all fillers.

    Args:
        provider: Gives a vector for each word.
        published: As the published code does it: at 10 frames per second, each twice, in tenths of
            a second, sentence by sentence; a filler has the vector of the first one.
    """

    def compute(speech: Speech, fps: float, frames: int) -> NDArray[np.float32]:
        make = _published if published else _in_seconds
        return make(provider, speech.words or (), fps, frames)

    return SpeechField(
        name="spoken_words",
        reads="words",
        width=provider.dimensions + len(TIMING_NAMES),
        unit="no unit, then s, s, s, 0 to 1, per s; tenths of a second as published",
        version=f"{provider.version}-{'published' if published else 'seconds'}",
        sees_whole_clip=True,  # a language model reads what comes later, too
        compute=compute,
    )


def silence(provider: WordVectors) -> NDArray[np.float32]:
    """``(width,)`` the field's values where nobody speaks."""
    values = np.zeros(provider.dimensions + len(TIMING_NAMES), dtype=np.float32)
    values[: provider.dimensions] = SILENCE_VALUE
    return values


def _untimed(texts: Sequence[str]) -> list[Word]:
    return [Word(text, 0.0, 0.0) for text in texts]


def _published(
    provider: WordVectors, words: Sequence[Word], fps: float, frames: int
) -> NDArray[np.float32]:
    spoken = published_words(words)
    vectors = [provider.vectors(_untimed(sentence)) for sentence in spoken.sentences]
    filler = provider.vectors(_untimed(FILLERS))[:1]
    quiet = np.full_like(filler, SILENCE_VALUE)
    of_words = np.concatenate([*vectors, filler, quiet])
    # The two that aren't words are counted from the end.
    index = np.where(spoken.word == SILENCE, -1, np.where(spoken.word == FILLER, -2, spoken.word))
    values = np.concatenate([of_words[index], spoken.timing], axis=1)
    values = values.repeat(round(fps / PUBLISHED_FPS), axis=0)[:frames]
    left = np.tile(silence(provider), (frames - len(values), 1))
    return np.concatenate([values, left]).astype(np.float32)


def _in_seconds(
    provider: WordVectors, words: Sequence[Word], fps: float, frames: int
) -> NDArray[np.float32]:
    values = np.tile(silence(provider), (frames, 1))
    if not words:
        return values
    vectors = provider.vectors(words)
    filler = provider.vectors(_untimed(FILLERS)).mean(axis=0)
    for word, vector in zip(words, vectors, strict=True):
        on = on_frames(word, fps)
        times = np.arange(frames)[on] / fps
        duration = max(word.end - word.start, 1 / fps)
        elapsed = (times - word.start).clip(0, duration)
        rate = max(1, count_syllables(word.text)) / duration
        bare = word.text.rstrip(".,!?").lower()
        values[on, : provider.dimensions] = filler if bare in FILLERS else vector
        values[on, provider.dimensions :] = np.stack(
            [
                elapsed,
                duration - elapsed,
                np.full_like(elapsed, duration),
                elapsed / duration,
                np.full_like(elapsed, rate),
            ],
            axis=1,
        )
    return values


SPOKEN_WORDS = spoken_words(Packaged())
