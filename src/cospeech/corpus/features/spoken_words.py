"""The vector of the word that is being said, and how far it has got (Kucherenko et al. 2020).

See docs/facts/trinity_and_gesticulator.md, section 3.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.field import SpeechField
from cospeech.corpus.features.word_vectors import Packaged, on_frames
from cospeech.speech.speech import SAMPLE_RATE, Speech, Word, covering_frames
from cospeech.speech.text.spoken_words import (
    FILLER,
    FILLERS,
    PUBLISHED_FPS,
    TIMING_NAMES,
    Sentences,
    is_published_filler,
    published_frames,
    published_timing,
)
from cospeech.speech.text.syllables import count_syllables
from cospeech.speech.text.vectors import SingleWordVectors, WordVectors

logger = logging.getLogger(__name__)

PATIENCE_S = 30.0
"""So long a stream waits for the end of a sentence before it says what it waits for."""

SILENCE_VALUE = -15.0
"""Every number of the vector where nobody speaks."""


def spoken_words(provider: WordVectors, published: bool = False) -> SpeechField:
    """The field ``spoken_words`` of a provider: its vectors, then five numbers of timing.

    Of the word that is said: time since it began and until it ends, its duration, s; how much of it
    is over, 0 to 1; its syllables per second, where a word has one at least. In silence the vector
    is `SILENCE_VALUE` everywhere and the timing 0, as it is where a word's text is blank; a filler
    (`FILLERS`) has the vectors' mean of all fillers. A provider reads sentence by sentence
    (`Sentences`).

    Args:
        provider: Gives a vector for each word.
        published: As the published code does it: at 10 frames per second, each twice, in tenths of
            a second; a filler has the vector of the first one, and whatever has one character more
            is one, too.
    """

    def compute(speech: Speech, fps: float, frames: int) -> NDArray[np.float32]:
        rows = _Rows(provider, published, fps)
        rows.add(speech.words or ())
        rows.end()
        return rows.until(frames)

    return SpeechField(
        name="spoken_words",
        reads="words",
        width=provider.dimensions + len(TIMING_NAMES),
        unit="no unit, then s, s, s, 0 to 1, per s; tenths of a second as published",
        version=f"{provider.version}-{'published' if published else 'sentences'}",
        sees_whole_clip=True,  # a language model reads what comes later, too
        opens=lambda fps: SpokenWordsStream(provider, published, fps),
        compute=compute,
    )


def silence(provider: WordVectors) -> NDArray[np.float32]:
    """``(width,)`` the field's values where nobody speaks."""
    values = np.zeros(provider.dimensions + len(TIMING_NAMES), dtype=np.float32)
    values[: provider.dimensions] = SILENCE_VALUE
    return values


class SpokenWordsStream:
    """The rows of `spoken_words`, to the bit, as soon as the words that they depend on are there.

    A row of silence or of a filler waits for the sound of its frame, up to which every word has
    come that begins in it. A row of a word waits for its vector, too: for the end of the sentence,
    where the provider isn't one of `SingleWordVectors`. Once a sentence has been open for more than
    `PATIENCE_S` of sound, the log says so, once.

    Attributes:
        look_ahead_s: Of sound: none is looked at.
        words_look_ahead_s: A row depends on no word that begins later than its frame by more, s;
            ``math.inf`` where it depends on a sentence.
        delay_s: After t seconds of sound the rows before ``t - delay_s`` have been put out;
            ``math.inf`` where they come sentence by sentence.
    """

    look_ahead_s = -math.inf

    def __init__(self, provider: WordVectors, published: bool, fps: float) -> None:
        self._rows, self._fps = _Rows(provider, published, fps), fps
        self._samples = 0
        self._has_warned = False
        is_finite = self._rows.is_of_single_words
        self.words_look_ahead_s = 1 / self._rows.fps if is_finite else math.inf
        self.delay_s = self.words_look_ahead_s

    def hear(
        self, samples: NDArray[np.float32], words: Sequence[Word] | None = None
    ) -> NDArray[np.float32]:
        """The next rows ``(F, width)`` that further sound and the words in it complete."""
        self._warn_of_an_open_sentence()
        self._samples += len(samples)
        self._rows.add(words or ())
        # What begins from now on is on none of these frames.
        frames = math.floor(self._samples / SAMPLE_RATE * self._rows.fps + 1e-6)
        heard = covering_frames(self._samples, self._fps)
        return self._rows.until(min(frames * self._rows.repeat, heard))

    def finish(self) -> NDArray[np.float32]:
        """The rows that are left up to the end of the sound."""
        self._rows.end()
        return self._rows.until(covering_frames(self._samples, self._fps))

    def _warn_of_an_open_sentence(self) -> None:
        since_s = self._rows.waits_since_s
        if self._has_warned or self._samples / SAMPLE_RATE - since_s <= PATIENCE_S:
            return
        self._has_warned = True
        logger.warning(
            "the sentence that began at %.1f s hasn't ended yet, and nothing later comes out of the"
            " stream until it does: push words that end sentences with '.', '!' or '?', or use a"
            " model with vectors of single words (model.text=static)",
            since_s,
        )


@dataclass(eq=False)
class _Spoken:
    """A word on its frames.

    Attributes:
        word: The word.
        frames: Where it is said.
        vector: Its vector; None where its sentence isn't complete yet.
    """

    word: Word
    frames: range
    vector: NDArray[np.float32] | None = None


class _Rows:
    """The rows of the words so far.

    Args:
        provider: See `spoken_words`.
        published: See `spoken_words`.
        fps: Of the rows.

    Attributes:
        fps: Frames per second on which words are placed.
        repeat: Rows that have the values of a frame.
        is_of_single_words: Whether a word has its vector at once.
    """

    def __init__(self, provider: WordVectors, published: bool, fps: float) -> None:
        self.fps = PUBLISHED_FPS if published else fps
        self.repeat = round(fps / PUBLISHED_FPS) if published else 1
        self._provider, self._published = provider, published
        self.is_of_single_words = isinstance(provider, SingleWordVectors)
        self._sentences = Sentences(is_published_filler if published else _is_filler)
        self._words = list[_Spoken]()
        # Of the sentence under way: its words by their index, and the number of those before.
        self._open, self._complete = dict[int, _Spoken](), 0
        self._filler: NDArray[np.float32] | None = None
        self._placed = self._put_out = 0

    @property
    def waits_since_s(self) -> float:
        """When the first word without a vector begins; ``math.inf`` where there is none."""
        return min((spoken.word.start for spoken in self._open.values()), default=math.inf)

    def add(self, words: Sequence[Word]) -> None:
        """Take further words."""
        for word in words:
            if not word.text.strip():
                continue
            spoken = _Spoken(word, self._frames(word))
            self._words.append(spoken)
            index, sentence = self._sentences.add(word.text)
            if index == FILLER:
                spoken.vector = self._filler_vector()
            else:
                self._open[index] = spoken
            if sentence is not None and not self.is_of_single_words:
                self._read(sentence)
        if self.is_of_single_words and self._open:
            vectors = self._provider.vectors([spoken.word for spoken in self._open.values()])
            for spoken, vector in zip(self._open.values(), vectors, strict=True):
                spoken.vector = vector
            self._open = {}

    def end(self) -> None:
        """No word follows."""
        sentence = self._sentences.end()
        if sentence is not None and self._open:
            self._read(sentence)

    def until(self, stop: int) -> NDArray[np.float32]:
        """The next rows ``(F, width)``, before ``stop`` and before words without a vector."""
        pending = [spoken.frames.start for spoken in self._open.values() if spoken.frames]
        first, stop = self._put_out, min([stop, *(self.repeat * frame for frame in pending)])
        quiet = silence(self._provider)
        if stop <= first:
            return np.zeros((0, len(quiet)), dtype=np.float32)
        frames = range(first // self.repeat, -(-stop // self.repeat))
        values = np.tile(quiet, (len(frames), 1))
        for spoken in self._words:
            begin, end = (
                max(spoken.frames.start, frames.start),
                min(spoken.frames.stop, frames.stop),
            )
            if begin < end:
                assert spoken.vector is not None
                rows = values[begin - frames.start : end - frames.start]
                rows[:, : -len(TIMING_NAMES)] = spoken.vector
                rows[:, -len(TIMING_NAMES) :] = self._timing(spoken.word, np.arange(begin, end))
        self._put_out = stop
        self._words = [spoken for spoken in self._words if spoken.frames.stop * self.repeat > stop]
        skipped = first - frames.start * self.repeat
        return values.repeat(self.repeat, axis=0)[skipped : skipped + stop - first]

    def _frames(self, word: Word) -> range:
        if not self._published:
            on = on_frames(word, self.fps)
            return range(on.start, on.stop)
        frames = published_frames(word, self._placed)
        self._placed = max(frames.start, frames.stop)
        return frames

    def _timing(self, word: Word, frames: NDArray[np.int64]) -> NDArray[np.float64]:
        if self._published:
            return published_timing(word, frames)
        duration = max(word.end - word.start, 1 / self.fps)
        elapsed = (frames / self.fps - word.start).clip(0, duration)
        rate = max(1, count_syllables(word.text)) / duration
        columns = (elapsed, duration - elapsed, duration, elapsed / duration, rate)
        return np.stack(np.broadcast_arrays(*columns), axis=1)

    def _read(self, sentence: Sequence[str]) -> None:
        vectors = self._provider.vectors(_untimed(sentence))
        for index, spoken in self._open.items():
            spoken.vector = vectors[index - self._complete]
        self._complete += len(sentence)
        self._open = {}

    def _filler_vector(self) -> NDArray[np.float32]:
        if self._filler is None:
            vectors = self._provider.vectors(_untimed(FILLERS))
            self._filler = vectors[0] if self._published else vectors.mean(axis=0)
        return self._filler


def _is_filler(text: str) -> bool:
    return text.rstrip(".,!?").lower() in FILLERS


def _untimed(texts: Sequence[str]) -> list[Word]:
    return [Word(text, 0.0, 0.0) for text in texts]


SPOKEN_WORDS = spoken_words(Packaged())
