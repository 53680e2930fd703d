"""Which word is said when, and how far it has got: Gesticulator's text features but the vectors.

See docs/facts/trinity_and_gesticulator.md, section 3.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cospeech.speech.speech import Word
from cospeech.speech.text.syllables import count_syllables

FILLERS = ("eh", "ah", "like", "kind of")
"""What is said without meaning anything; in the order of their pseudo-sentence."""

FILLER = -2
"""In the place of a word's index."""

TIMING_NAMES = ("elapsed", "remaining", "duration", "progress", "syllable rate")
"""The numbers beside a word's vector."""

PUBLISHED_FPS = 10

_SENTENCE_ENDS = (".", "!", "?")


class Sentences:
    """The words that go to a language model, sentence by sentence.

    A sentence ends with a word that ends in ``.``, ``!`` or ``?``, whatever that belongs to
    (``Mr.``). Fillers aren't in it; one that ends a sentence hands its last character on to the
    word before.

    Args:
        is_filler: Whether a text is a filler.
    """

    def __init__(self, is_filler: Callable[[str], bool]) -> None:
        self._is_filler = is_filler
        self._open = list[str]()
        self._before = 0

    def add(self, text: str) -> tuple[int, list[str] | None]:
        """The next word.

        Returns:
            Its index into all sentences' words one after another, or `FILLER`; and the words of
            the sentence that it ends, if it ends one.
        """
        last = text[-1:]
        if self._is_filler(text):
            index = FILLER
            if last in _SENTENCE_ENDS:
                if self._open:
                    self._open[-1] += last
                else:
                    self._open.append(last)
        else:
            index = self._before + len(self._open)
            self._open.append(text)
        return index, self._close() if last in _SENTENCE_ENDS else None

    def end(self) -> list[str] | None:
        """The words of the sentence that nothing ended, if there is one, with a ``.`` behind."""
        if not self._open:
            return None
        self._open[-1] += "."
        return self._close()

    def _close(self) -> list[str]:
        sentence, self._open = self._open, []
        self._before += len(sentence)
        return sentence


def is_published_filler(text: str) -> bool:
    """Whether a text is a filler, or one with any character behind it (``likes``, too)."""
    return text in FILLERS or text[:-1] in FILLERS


def published_frames(word: Word, placed: int) -> range:
    """The frames of a word at 10 fps: those of its time, cut to tenths, that aren't yet taken.

    Args:
        word: The next word.
        placed: How many frames earlier words have.
    """
    return range(max(placed, int(10 * word.start)), int(10 * word.end))


def published_timing(word: Word, frames: NDArray[np.int64]) -> NDArray[np.float64]:
    """``(F, 5)`` the numbers of `TIMING_NAMES` at some frames of a word, in tenths of a second.

    The first frame of a word has an elapsed time of 1 and the last a remaining time of 1.
    """
    start = int(10 * word.start)
    duration = int(10 * word.end) - start
    elapsed = frames + 1 - start
    columns = np.broadcast_arrays(
        elapsed,
        duration - elapsed + 1,
        duration,
        elapsed / duration,
        count_syllables(word.text) / duration,
    )
    return np.stack(columns, axis=-1).astype(np.float64)
