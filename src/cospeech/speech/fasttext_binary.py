"""Reader of fastText's binary models: vectors of words, and of anything else by its sub-words.

Layout (little-endian): magic, version; 12 int32 settings and a double; the dictionary (sizes, then
NUL-terminated words with count and kind); one byte "quantised"; the input matrix as two int64
sizes and float32 rows: one per word, then one per n-gram bucket. The rest of the file (the output
matrix) is not needed.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import InputFileError
from cospeech.foreign import open_file

MAGIC = 793_712_314

_SETTINGS = struct.Struct("<2i12id")
_DICTIONARY = struct.Struct("<3i2q")
_MATRIX = struct.Struct("<2q")
_VERSIONS = (11, 12)
_SUPERVISED = 3
_END_OF_SENTENCE = "</s>"  # the one word that fastText gives no sub-words

_MAX_DIMENSIONS = 4_096
_MAX_WORDS = 50_000_000
_MAX_BUCKETS = 200_000_000
_MAX_NGRAM = 64
_MAX_WORD_BYTES = 4_096


@dataclass(frozen=True, eq=False)
class FastTextModel:
    """The part of a model that makes vectors.

    Attributes:
        rows: ``(words + buckets, dimensions)`` float32, on disk.
        word_rows: Row of each word of interest that is in the dictionary.
        words: Words in the dictionary; the buckets' rows begin after them.
        buckets: Number of n-gram buckets.
        shortest: Letters in the shortest n-gram.
        longest: Letters in the longest n-gram; 0 without sub-words.
    """

    rows: NDArray[np.float32]
    word_rows: dict[str, int]
    words: int
    buckets: int
    shortest: int
    longest: int

    @property
    def dimensions(self) -> int:
        """Values per vector."""
        return self.rows.shape[1]

    @classmethod
    def open(cls, path: Path, wanted: Iterable[str]) -> FastTextModel:
        """Read the dictionary and map the matrix.

        Args:
            path: A ``.bin`` file.
            wanted: The words whose rows are remembered.

        Raises:
            InputFileError: Not such a file, quantised, or damaged.
        """
        with open_file(path) as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            return _Reader(path, data).model(wanted)

    def vector(self, word: str) -> NDArray[np.float32] | None:
        """Mean of the rows of the word (if known) and of its n-grams; None if there are none."""
        rows = [self.word_rows[word]] if word in self.word_rows else []
        if word != _END_OF_SENTENCE:
            rows += [
                self.words + bucket
                for bucket in ngram_buckets(word, self.buckets, self.shortest, self.longest)
            ]
        if not rows:
            return None
        return self.rows[rows].mean(axis=0, dtype=np.float64).astype(np.float32)


def ngram_buckets(word: str, buckets: int, shortest: int, longest: int) -> list[int]:
    """Buckets of a word's n-grams of letters, with ``<`` and ``>`` marking its ends.

    The end marks alone are no n-grams.
    """
    if buckets == 0:
        return []
    letters = [letter.encode() for letter in f"<{word}>"]
    return [
        fnv1a(b"".join(letters[start : start + length])) % buckets
        for start in range(len(letters))
        for length in range(shortest, min(longest, len(letters) - start) + 1)
        if length > 1 or 0 < start < len(letters) - 1
    ]


def fnv1a(text: bytes) -> int:
    """The 32-bit FNV-1a of fastText, which extends the sign of bytes from 128 on."""
    value = 2_166_136_261
    for byte in text:
        value ^= byte if byte < 128 else byte | 0xFFFFFF00
        value = value * 16_777_619 & 0xFFFFFFFF
    return value


class _Reader:
    def __init__(self, path: Path, data: mmap.mmap) -> None:
        self._path = path
        self._data = data
        self._position = 0

    def model(self, wanted: Iterable[str]) -> FastTextModel:
        magic, version, dimensions, *settings, _ = self._unpack(_SETTINGS, "the settings")
        kind, buckets, shortest, longest = settings[6:10]
        if magic != MAGIC or version not in _VERSIONS:
            raise self._error(f"is fastText version {version}, known are 11 and 12")
        if kind == _SUPERVISED and version == 11:
            longest = 0  # such models were trained without sub-words, whatever they say
        self._require(0 < dimensions <= _MAX_DIMENSIONS, f"{dimensions} dimensions")
        self._require(0 <= buckets <= _MAX_BUCKETS, f"{buckets} buckets")
        self._require(0 <= longest <= _MAX_NGRAM, f"n-grams of {longest} letters")
        word_rows, words, is_pruned = self._dictionary(wanted)
        if self._byte("the input matrix") or is_pruned:
            raise InputFileError(
                self._path,
                "is a quantised model, whose vectors are only approximate",
                hint="use the unquantised .bin model or the .vec file",
            )
        height, width = self._unpack(_MATRIX, "the size of the input matrix")
        self._require(
            width == dimensions and height in (words, words + buckets),
            f"an input matrix of {height} x {width}",
        )
        missing = self._position + 4 * height * width - len(self._data)
        if missing > 0:
            raise self._error(f"{missing} bytes of the input matrix are missing")
        rows = np.memmap(self._path, "<f4", "r", self._position, (height, width))
        if height == words:
            buckets = 0
        return FastTextModel(rows, word_rows, words, buckets, max(shortest, 1), longest)

    def _dictionary(self, wanted: Iterable[str]) -> tuple[dict[str, int], int, bool]:
        """Rows of the wanted words, number of words, and whether buckets were pruned away."""
        size, words, labels, _, pruned = self._unpack(_DICTIONARY, "the dictionary")
        self._require(
            0 < words <= _MAX_WORDS and labels >= 0 and size == words + labels,
            f"a dictionary of {size} entries, {words} words, {labels} labels",
        )
        data, position = self._data, self._position
        keys = {word.encode(): word for word in wanted}
        rows: dict[str, int] = {}
        for row in range(size):
            end = data.find(b"\0", position, position + _MAX_WORD_BYTES)
            if end < 0 or end + 10 > len(data):
                raise self._error(f"entry {row} of the dictionary is broken")
            word = keys.get(data[position:end])
            if word is not None and row < words:
                rows[word] = row
            position = end + 10  # the NUL, an int64 count, one byte for word or label
        self._position = position
        if pruned > 0:
            self._position += 8 * pruned
        return rows, words, pruned >= 0

    def _unpack(self, layout: struct.Struct, what: str) -> tuple[int, ...]:
        if self._position + layout.size > len(self._data):
            raise self._error(f"the file ends inside {what}")
        values = layout.unpack_from(self._data, self._position)
        self._position += layout.size
        return values

    def _byte(self, what: str) -> int:
        if self._position >= len(self._data):
            raise self._error(f"the file ends before {what}")
        self._position += 1
        return self._data[self._position - 1]

    def _require(self, is_plausible: bool, claim: str) -> None:
        if not is_plausible:
            raise self._error(f"claims {claim}")

    def _error(self, problem: str) -> InputFileError:
        return InputFileError(
            self._path,
            problem,
            place=f"byte {self._position}",
            hint="the file is damaged or incomplete: get it again, or use the .vec file",
        )
