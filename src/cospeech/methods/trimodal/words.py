"""Transcripts as word ids at synthesis, and vectors for words that training never saw."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import InputFileError
from cospeech.speech.speech import Word
from cospeech.speech.vocabulary import UNK, Vocabulary, normalise_word
from cospeech.speech.word_vectors import find_word_vectors

PUNCTUATION = ".,:;!?"
"""What the published text input strips from a word; nothing else is changed, case included."""

logger = logging.getLogger(__name__)


class WordVectorFile:
    """The fastText file that training started from, asked again for words it didn't hold.

    Answers are kept, so that a file is read once for each new word.

    Args:
        path: fastText .bin or .vec file; it needn't exist.
        dimensions: Numbers per vector that the method uses.
    """

    def __init__(self, path: str, dimensions: int) -> None:
        self.path = Path(path)
        self._dimensions = dimensions
        self._answers: dict[str, NDArray[np.float32] | None] = {}

    def find(self, words: Sequence[str]) -> dict[str, NDArray[np.float32]]:
        """Vectors of those words that the file knows or can compose; none without the file.

        Raises:
            InputFileError: The file can't be read, or its vectors have another size.
        """
        new = [word for word in words if word not in self._answers]
        if new and self.path.is_file():
            dimensions, found = find_word_vectors(self.path, new)
            check_dimensions(self.path, dimensions, self._dimensions)
            self._answers.update({word: found.get(word) for word in new})
        answers = {word: self._answers.get(word) for word in words}
        return {word: vector for word, vector in answers.items() if vector is not None}


def check_dimensions(path: str | Path, dimensions: int, expected: int) -> None:
    """Refuse vectors that don't fit the embedding.

    Raises:
        InputFileError: Another number of dimensions.
    """
    if dimensions != expected:
        raise InputFileError(
            path,
            f"vectors of {dimensions} numbers, the method uses {expected}",
            hint="use 300-dimensional vectors such as crawl-300d-2M-subword",
        )


class EncodedWords(NamedTuple):
    """A transcript in the text encoder's terms.

    Attributes:
        starts: ``(W,)`` onsets, s.
        ends: ``(W,)`` ends, s.
        ids: ``(W,)`` int64; ids from the size of the vocabulary on are rows of ``extra_vectors``.
        extra_vectors: ``(E, dimensions)`` float32 of words outside the vocabulary.
    """

    starts: NDArray[np.float64]
    ends: NDArray[np.float64]
    ids: NDArray[np.int64]
    extra_vectors: NDArray[np.float32] | None


def encode_words(
    words: Sequence[Word],
    vocabulary: Vocabulary,
    vector_file: WordVectorFile | None,
    *,
    fold_case: bool,
) -> EncodedWords:
    """Look words up; what has neither an id nor a vector becomes UNK, which is logged.

    Args:
        words: The transcript, or a part of it.
        vocabulary: Word ids.
        vector_file: Where words outside the vocabulary may have vectors.
        fold_case: Normalise words as the corpus did, and drop those without a letter or digit; the
            published text input only strips punctuation, so that "Hello" is unknown where "hello"
            is known.
    """
    texts = [
        normalise_word(word.text) if fold_case else word.text.strip(PUNCTUATION) for word in words
    ]
    kept = [(word, text) for word, text in zip(words, texts, strict=True) if text or not fold_case]
    ids = {text: vocabulary.encode(text, fold_case=False) for _, text in kept}
    unknown = sorted(text for text, word_id in ids.items() if word_id == UNK)
    found = vector_file.find(unknown) if vector_file is not None and unknown else {}
    ids.update(zip(found, range(len(vocabulary), len(vocabulary) + len(found)), strict=True))
    _log_unknown(unknown, len(found), vector_file)
    return EncodedWords(
        np.array([word.start for word, _ in kept], dtype=np.float64),
        np.array([word.end for word, _ in kept], dtype=np.float64),
        np.array([ids[text] for _, text in kept], dtype=np.int64),
        np.stack(list(found.values())) if found else None,
    )


def joined_words(parts: Sequence[EncodedWords], known: int) -> EncodedWords:
    """Parts of a transcript as one.

    Args:
        parts: In order of time.
        known: Size of the vocabulary.
    """
    ids, extra = [np.zeros(0, dtype=np.int64)], list[NDArray[np.float32]]()
    for part in parts:
        ids.append(np.where(part.ids < known, part.ids, part.ids + sum(map(len, extra))))
        extra += [] if part.extra_vectors is None else [part.extra_vectors]
    return EncodedWords(
        np.concatenate([np.zeros(0), *(part.starts for part in parts)]),
        np.concatenate([np.zeros(0), *(part.ends for part in parts)]),
        np.concatenate(ids),
        np.concatenate(extra) if extra else None,
    )


def _log_unknown(unknown: list[str], found: int, vector_file: WordVectorFile | None) -> None:
    if not unknown:
        return
    share = "they share the unknown word's vector"
    if vector_file is not None:
        share = f"{found} have vectors in {vector_file.path}"
        if found < len(unknown):
            share += f", {len(unknown) - found} share the unknown word's"
        if not vector_file.path.is_file():
            share += " (no such file now)"
    logger.log(
        logging.WARNING if found < len(unknown) else logging.INFO,
        "%d distinct words are not in the vocabulary: %s%s; %s",
        len(unknown),
        ", ".join(unknown[:5]),
        " ..." if len(unknown) > 5 else "",
        share,
    )
