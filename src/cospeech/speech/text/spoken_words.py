"""Which word is said when, and how far it has got: Gesticulator's text features but the vectors.

See docs/facts/trinity_and_gesticulator.md, section 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.speech.speech import Word
from cospeech.speech.text.syllables import count_syllables

FILLERS = ("eh", "ah", "like", "kind of")
"""What is said without meaning anything; in the order of their pseudo-sentence."""

SILENCE, FILLER = -1, -2
"""In the place of a word's index: nobody speaks, and a filler is said."""

TIMING_NAMES = ("elapsed", "remaining", "duration", "progress", "syllable rate")
"""The numbers beside a word's vector."""

PUBLISHED_FPS = 10

_SENTENCE_ENDS = (".", "!", "?")


@dataclass(frozen=True, eq=False)
class SpokenWords:
    """The words of a transcript on frames.

    Attributes:
        word: ``(F,)`` index into all sentences' words one after another, `SILENCE` or `FILLER`.
        timing: ``(F, 5)`` elapsed and remaining time, duration, progress (0 to 1) and syllables per
            time of what is said; zeros in silence.
        sentences: The words that have vectors, as they go to a language model.
    """

    word: NDArray[np.int64]
    timing: NDArray[np.float64]
    sentences: list[list[str]]


def published_words(words: Sequence[Word]) -> SpokenWords:
    """The words at 10 fps with times in tenths of a second, as the published code places them.

    Times are cut to tenths. The first frame of a word has an elapsed time of 1 and the last a
    remaining time of 1. A filler is found with any character behind it (``likes``, too), and a
    sentence ends at ``.``, ``!`` or ``?``, whatever it belongs to (``Mr.``). Nothing follows the
    last word.
    """
    placed, timing = list[int](), list[tuple[float, ...]]()
    sentences, sentence, kept = list[list[str]](), list[str](), 0
    for word in words:
        start, end = int(10 * word.start), int(10 * word.end)
        text, last = word.text, word.text[-1:]
        if text in FILLERS or text[:-1] in FILLERS:
            index = FILLER
            if last in _SENTENCE_ENDS:
                if sentence:
                    sentence[-1] += last
                else:
                    sentence.append(last)
        else:
            index = kept + len(sentence)
            sentence.append(text)
        silent = max(0, start - len(placed))
        placed += [SILENCE] * silent
        timing += [(0.0,) * len(TIMING_NAMES)] * silent
        duration = end - start
        for clock in range(len(placed) + 1, end + 1):
            elapsed = clock - start
            rate = count_syllables(text) / duration
            placed.append(index)
            timing.append((elapsed, duration - elapsed + 1, duration, elapsed / duration, rate))
        if last in _SENTENCE_ENDS:
            sentences.append(sentence)
            kept, sentence = kept + len(sentence), []
    if sentence:
        sentences.append([*sentence[:-1], sentence[-1] + "."])
    return SpokenWords(
        np.array(placed, dtype=np.int64), np.array(timing).reshape(-1, len(TIMING_NAMES)), sentences
    )
