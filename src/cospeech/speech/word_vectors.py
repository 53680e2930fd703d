"""Pretrained word vectors for a vocabulary, from fastText's text or binary files."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from functools import partial
from io import BufferedReader
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import ContentError
from cospeech.foreign import open_file, understood
from cospeech.progress import progress_bar
from cospeech.speech.fasttext_binary import MAGIC, FastTextModel
from cospeech.speech.vocabulary import SPECIAL_TOKENS

_log = logging.getLogger(__name__)

_MAX_DIMENSIONS = 4_096
_MAX_WORDS = 10**9
_READ_AHEAD_BYTES = 1 << 20
_MAX_LINE_BYTES = 1 << 17  # 4096 values of 30 characters
_ARCHIVES = {b"PK\x03\x04": "unzip", b"\x1f\x8b\x08\x00": "gunzip", b"\x1f\x8b\x08\x08": "gunzip"}


def load_word_vectors(path: str | Path, words: Sequence[str], seed: int) -> NDArray[np.float32]:
    """The vector of every word of a vocabulary (docs/facts/trimodal.md, section 3.8).

    From a ``.bin`` file words outside its dictionary are composed of their sub-words; a ``.vec``
    file knows only whole words. Special tokens, and words for which the file has nothing, are drawn
    from N(0, 1/dimensions), i.e. a standard deviation of 0.0577 at 300; how many is logged. A draw
    depends only on the seed and the word's id.

    Memory follows the words asked for: a ``.vec`` file is streamed, the matrix of a ``.bin`` file
    stays on disk but for the rows that are used.

    Args:
        path: fastText ``.vec`` (text) or ``.bin`` file, told apart by content.
        words: The word of every id, e.g. `Vocabulary.words`.
        seed: For the draws.

    Returns:
        ``(len(words), dimensions)``; 300 dimensions for the published crawl vectors.

    Raises:
        InputFileError: Missing, compressed, quantised, cut off, or in another format.
    """
    wanted = {word: index for index, word in enumerate(words) if word not in SPECIAL_TOKENS}
    dimensions, found = find_word_vectors(path, list(wanted))
    draws = np.random.default_rng(seed).standard_normal((len(words), dimensions))
    vectors = (draws / np.sqrt(dimensions)).astype(np.float32)
    for word, vector in found.items():
        vectors[wanted[word]] = vector
    missing = [word for word in wanted if word not in found]
    _log.log(
        logging.WARNING if missing else logging.INFO,
        "%s: vectors for %d of %d words%s",
        path,
        len(found),
        len(wanted),
        f"; random ones for the rest, e.g. {', '.join(missing[:5])}" if missing else "",
    )
    return vectors


def find_word_vectors(
    path: str | Path, words: Sequence[str]
) -> tuple[int, dict[str, NDArray[np.float32]]]:
    """What a file knows of some words: a ``.bin`` file by their sub-words too.

    Args:
        path: fastText ``.vec`` (text) or ``.bin`` file, told apart by content.
        words: Words looked for, as they are written.

    Returns:
        Dimensions, and ``(dimensions,)`` float32 of each word for which there is a vector.

    Raises:
        InputFileError: Missing, compressed, quantised, cut off, or in another format.
    """
    path = Path(path)
    with understood(path, "fastText vectors", "get the file again"):
        if not path.is_file():
            hint = "download crawl-300d-2M-subword from fasttext.cc and unzip it"
            raise ContentError("no such word vectors", hint=hint)
        with open_file(path) as file:
            head = file.read(4)
        if head in _ARCHIVES:
            raise ContentError("is compressed", hint=f"{_ARCHIVES[head]} {path.name}")
        is_binary = int.from_bytes(head, "little") == MAGIC
        return _from_binary(path, words) if is_binary else _from_text(path, words)


def _from_binary(path: Path, words: Sequence[str]) -> tuple[int, dict[str, NDArray[np.float32]]]:
    model = FastTextModel.open(path, words)
    found = {}
    for word in words:
        vector = model.vector(word)
        if vector is not None:
            found[word] = vector
            if not np.isfinite(vector).all():
                raise ContentError(
                    f"the vector of {word!r} is not finite",
                    hint="the file is damaged: get it again",
                )
    return model.dimensions, found


def _from_text(path: Path, words: Sequence[str]) -> tuple[int, dict[str, NDArray[np.float32]]]:
    keys = {word.encode(): word for word in words}
    found: dict[str, NDArray[np.float32]] = {}
    # Gigabytes are read by the line: a small buffer doubles the time that takes.
    with BufferedReader(open_file(path).detach(), _READ_AHEAD_BYTES) as file:
        total, dimensions = _text_header(file.readline(_MAX_LINE_BYTES))
        number = 1
        lines = iter(partial(file.readline, _MAX_LINE_BYTES if keys else 0), b"")
        for number, line in enumerate(progress_bar(lines, total, f"reading {path.name}"), start=2):
            key, _, values = line.partition(b" ")
            word = keys.get(key)
            if word is not None and word not in found:
                found[word] = _text_values(values, dimensions, number)
                if len(found) == len(keys):
                    break
    if len(found) < len(keys) and number - 1 < total:
        raise ContentError(
            f"ends after {number - 1} of {total} words",
            hint="the download is incomplete: get the file again",
        )
    return dimensions, found


def _text_header(line: bytes) -> tuple[int, int]:
    try:
        total, dimensions = (int(field) for field in line.split())
    except ValueError:
        total = dimensions = 0
    if not (0 < total <= _MAX_WORDS and 0 < dimensions <= _MAX_DIMENSIONS):
        raise ContentError(
            f"does not begin with a word count and a dimension, but with {line[:40]!r}",
            place="line 1",
            hint="expected fastText vectors, .vec or .bin",
        )
    return total, dimensions


def _text_values(values: bytes, dimensions: int, number: int) -> NDArray[np.float32]:
    try:
        vector = np.array(values.split(), dtype=np.float32)
    except ValueError:
        vector = np.empty(0, dtype=np.float32)
    if vector.shape != (dimensions,) or not np.isfinite(vector).all():
        raise ContentError(
            f"expected a word and {dimensions} finite numbers",
            place=f"line {number}",
            hint="the file is damaged: get it again",
        )
    return vector
