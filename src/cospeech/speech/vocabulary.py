"""Words as ids, and ids on motion frames (docs/facts/trimodal.md, sections 3.7 and 3.8)."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

SPECIAL_TOKENS = ("<PAD>", "<SOS>", "<EOS>", "<UNK>")
PAD, SOS, EOS, UNK = range(len(SPECIAL_TOKENS))

_APOSTROPHES = re.compile("['\u2019\u02bc`\u00b4]")
_NOT_LETTERS = re.compile(r"[\W_]+")


def normalise_word(text: str) -> str:
    """A word as the published vocabulary holds it: "Don't" -> "dont", "Café," -> "cafe".

    See docs/facts/trimodal.md, section 3.4.

    Accents are stripped from Latin letters, case is folded, apostrophes are removed, other symbols
    become single spaces; digits stay. Letters of other scripts are kept as written (the published
    script, made for English, loses them). What holds no letter or digit becomes "".
    """
    letters: list[str] = []
    for character in unicodedata.normalize("NFKD", _APOSTROPHES.sub("", text)):
        is_accent = unicodedata.category(character) == "Mn"
        if not (is_accent and letters and _is_latin(letters[-1])):
            letters.append(character)
    composed = unicodedata.normalize("NFC", "".join(letters)).lower()
    return _NOT_LETTERS.sub(" ", composed).strip()


def _is_latin(character: str) -> bool:
    return unicodedata.name(character, "").startswith("LATIN ")


class Vocabulary:
    """Word ids: PAD 0, SOS 1, EOS 2, UNK 3, then words in order of first occurrence.

    See docs/facts/trimodal.md, section 3.8.

    Args:
        words: The word of every id, beginning with the four special tokens.

    Raises:
        ValueError: The special tokens are missing, or a word is there twice.
    """

    def __init__(self, words: Sequence[str]) -> None:
        self._words = list(words)
        if tuple(self._words[: len(SPECIAL_TOKENS)]) != SPECIAL_TOKENS:
            raise ValueError(f"a vocabulary begins with {', '.join(SPECIAL_TOKENS)}")
        self._ids = {word: index for index, word in enumerate(self._words)}
        if len(self._ids) != len(self._words):
            repeated = next(w for i, w in enumerate(self._words) if self._ids[w] != i)
            raise ValueError(f"{repeated!r} is twice in the vocabulary")

    @classmethod
    def build(cls, texts: Iterable[str]) -> Vocabulary:
        """The distinct words of `texts`, normalised, in order; without a frequency threshold.

        For the published order pass the words of train, then validation, then test.
        """
        distinct = dict.fromkeys(normalise_word(text) for text in texts)
        distinct.pop("", None)
        return cls([*SPECIAL_TOKENS, *distinct])

    @property
    def words(self) -> list[str]:
        """The word of every id, special tokens included: a plain list, fit for JSON."""
        return list(self._words)

    def __len__(self) -> int:
        return len(self._words)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Vocabulary) and self._words == other._words

    __hash__ = None  # type: ignore[assignment]  # equal by content, which is a list

    def encode(self, word: str, fold_case: bool = True) -> int:
        """The id of a word, UNK if it's not in the table.

        Args:
            word: As transcribed.
            fold_case: Normalise it first; False looks up the bare text, which misses "Hello", as
                the published synthesis does.
        """
        key = normalise_word(word) if fold_case else word
        index = self._ids.get(key, UNK)
        return index if index >= len(SPECIAL_TOKENS) else UNK


def word_frames(
    word_starts: NDArray[np.float64],
    window_starts_s: NDArray[np.float64] | float,
    frames: int,
    fps: float,
) -> NDArray[np.int64]:
    """Frame of each word's onset in its window: ``max(0, floor((start - window_start) / frame))``.

    Args:
        word_starts: ``(W,)`` onsets in s.
        window_starts_s: Time of frame 0, s, of each word's window.
        frames: Frames in the window.
        fps: Frames per second.

    Returns:
        ``(W,)``; words that begin past the window have ``frames`` or more.
    """
    frame_s = frames / fps / frames  # as published, to the last bit
    return np.maximum(0, np.floor((word_starts - window_starts_s) / frame_s)).astype(np.int64)


def frame_aligned_words(
    word_starts: ArrayLike, word_ids: ArrayLike, window_start_s: float, frames: int, fps: float
) -> NDArray[np.int64]:
    """Word ids on the frames of their onsets, PAD elsewhere (docs/facts/trimodal.md, section 3.7).

    Word w lands on frame ``max(0, floor((start_w - window_start) / (window_length / frames)))``;
    it's left out when that is past the window. A word that began before the window lands on
    frame 0, so pass only words that have not ended by then. Later words overwrite earlier ones.

    Args:
        word_starts: ``(W,)`` onsets in s, in order.
        word_ids: ``(W,)``.
        window_start_s: Time of frame 0, s, on the clock of the onsets.
        frames: Frames in the window.
        fps: Frames per second.

    Returns:
        ``(frames,)`` int64.
    """
    starts = np.asarray(word_starts, dtype=np.float64)
    ids = np.asarray(word_ids, dtype=np.int64)
    if starts.shape != ids.shape:
        raise ValueError(f"{starts.shape} onsets for {ids.shape} word ids")
    onsets = word_frames(starts, window_start_s, frames, fps)
    inside = onsets < frames
    aligned = np.full(frames, PAD, dtype=np.int64)
    # NumPy assigns in order, so of several words on a frame the last one stays.
    aligned[onsets[inside]] = ids[inside]
    return aligned


def evenly_placed_words(word_ids: ArrayLike, frames: int) -> NDArray[np.int64]:
    """Word i of n on frame ``(i + 1) * floor(frames / (n + 1))``: timing discarded.

    See docs/facts/trimodal.md, section 3.7.

    More words than frames all fall on frame 0, where the last one stays.

    Args:
        word_ids: ``(n,)`` ids of the words in the window.
        frames: Frames in the window.

    Returns:
        ``(frames,)`` int64, PAD elsewhere.
    """
    ids = np.asarray(word_ids, dtype=np.int64)
    placed = np.full(frames, PAD, dtype=np.int64)
    placed[np.arange(1, len(ids) + 1) * (frames // (len(ids) + 1))] = ids
    return placed
