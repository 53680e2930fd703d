"""What gives a vector for every word, and the kind that looks at the word alone."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from cospeech.foreign import open_file
from cospeech.speech.speech import Word
from cospeech.speech.vocabulary import normalise_word
from cospeech.speech.word_vectors import find_word_vectors

_BLOCKS, _BLOCK_BYTES = 64, 2**20


class WordVectors(Protocol):
    """One vector per word of a transcript, which may depend on all of its words.

    Attributes:
        version: Names where the vectors come from: others have another version, so that what was
            computed once can be kept under it.
        dimensions: Values of a vector.
    """

    version: str
    dimensions: int

    def vectors(self, words: Sequence[Word]) -> NDArray[np.float32]:
        """The vector of each word of one transcript, ``(W, dimensions)``, in order.

        What has no vector, such as a text without a letter, is zeros.
        """
        ...


@runtime_checkable
class SingleWordVectors(WordVectors, Protocol):
    """Vectors of which each depends on its word alone, whatever punctuation is on it.

    Attributes:
        reads: Says so.
    """

    reads: Literal["word"]


class StaticVectors:
    """Vectors of a fastText file: the same for a word wherever it stands.

    Words are looked up as the vocabulary spells them (`normalise_word`); several words in one text
    give their mean, unknown words zeros. The file is read once for ``words``, and again when other
    words come. The version is of what the file holds, not of its name: its size and 64 blocks of
    1 MiB, evenly spaced from its first byte to its last; all of a file that isn't larger.

    Args:
        path: fastText ``.vec`` or ``.bin`` file (`find_word_vectors`).
        words: The vocabulary of a corpus.

    Raises:
        InputFileError: Missing, compressed, quantised, cut off, or in another format.
    """

    reads: Literal["word"] = "word"

    def __init__(self, path: str | Path, words: Iterable[str] = ()) -> None:
        self._path = Path(path)
        self._known: dict[str, NDArray[np.float32] | None] = {}
        self._look_up(part for word in words for part in normalise_word(word).split())
        self.version = f"static-{_digest(self._path)}"

    def vectors(self, words: Sequence[Word]) -> NDArray[np.float32]:
        """See `WordVectors`."""
        texts = [normalise_word(word.text).split() for word in words]
        new = {part for parts in texts for part in parts} - self._known.keys()
        if new:
            self._look_up(sorted(new))
        result = np.zeros((len(words), self.dimensions), np.float32)
        for i, parts in enumerate(texts):
            found = [vector for part in parts if (vector := self._known[part]) is not None]
            if found:
                result[i] = np.mean(found, axis=0)
        return result

    def _look_up(self, words: Iterable[str]) -> None:
        wanted = list(dict.fromkeys(words))
        self.dimensions, found = find_word_vectors(self._path, wanted)
        self._known |= {word: found.get(word) for word in wanted}


def _digest(path: Path) -> str:
    size = path.stat().st_size
    digest = hashlib.sha256(str(size).encode())
    with open_file(path) as file:
        for block in range(_BLOCKS):
            if size > _BLOCKS * _BLOCK_BYTES:
                file.seek((size - _BLOCK_BYTES) * block // (_BLOCKS - 1))
            digest.update(file.read(_BLOCK_BYTES))
    return digest.hexdigest()[:16]
