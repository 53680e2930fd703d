"""Fields of speech, computed once per corpus and kept beside it.

A store's folder ``features/NAME-VERSION`` (``NAME-VERSION-FPS`` of a field that is computed at
the method's rate) holds, for each list of stretches that was wanted, an array with the rows of
one stretch after another and a JSON file that says which they are.
"""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock
from numpy.typing import NDArray

from cospeech.corpus.features.field import SpeechField
from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.errors import InputFileError
from cospeech.files import replacing, write_json
from cospeech.foreign import open_array, read_json, understood
from cospeech.progress import progress_bar

logger = logging.getLogger(__name__)

_WHAT = "a kept field of speech"
_DTYPE = np.dtype("<f4")


@dataclass(frozen=True)
class Stretch:
    """What a field is computed of at once.

    Attributes:
        span: The span whose sound it is, and nothing more.
        first_sample: Where in that sound it begins.
        frames: Rows wanted of a field at the method's rate; 0 at its own, which has as many as
            there are.
    """

    span: Span
    first_sample: int = 0
    frames: int = 0

    def values(self, store: Store, field: SpeechField, fps: float) -> NDArray[np.float32]:
        """``(rows, width)`` of the field."""
        speech = store.speech(self.span)
        if self.first_sample:
            speech = speech.since(self.first_sample)
        return field.compute(speech, field.fps or fps, self.frames)


def kept_rows(
    store: Store, field: SpeechField, fps: float, stretches: Sequence[Stretch], title: str
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """A field of some stretches, computed where it isn't kept already.

    What is kept but damaged is computed again, with a warning. Two processes that need the same
    compute it once: the second waits.

    Args:
        store: The corpus.
        field: The field.
        fps: The method's frames per second.
        stretches: In the order of the rows.
        title: Of the progress bar.

    Returns:
        ``(N, width)`` by memory map, and how many rows each stretch has.
    """
    rate = "" if field.fps else f"-{fps:g}"
    folder = store.path / "features" / f"{field.name}-{field.version}{rate}"
    wanted = [
        [*(s.span.recording, s.span.start, s.span.stop), s.first_sample, s.frames]
        for s in stretches
    ]
    digest = hashlib.sha256(json.dumps(wanted).encode()).hexdigest()[:12]
    array, facts = folder / f"{digest}.npy", folder / f"{digest}.json"
    if not facts.is_file():
        folder.mkdir(parents=True, exist_ok=True)
    with FileLock(str(folder / f".{digest}.lock")):
        if facts.is_file():
            try:
                return open_kept(array, facts, wanted, field)
            except InputFileError as error:
                logger.warning("%s: %s; it is computed again", error.path, error.problem)
        blocks = (stretch.values(store, field, fps) for stretch in stretches)
        rows = _write(array, progress_bar(blocks, len(stretches), title), field.width or 0)
        # Last: what has no description was never finished.
        write_json(facts, {"stretches": wanted, "rows": rows, "unit": field.unit})
        return open_kept(array, facts, wanted, field)


def _write(path: Path, blocks: Iterator[NDArray[np.float32]], width: int) -> list[int]:
    """Write rows as they come; how many there were in each block."""
    rows = []
    with replacing(path) as temporary, temporary.open("wb") as file:
        _write_header(file, 0, width)
        begin = file.tell()
        for block in blocks:
            rows.append(len(block))
            file.write(np.ascontiguousarray(block, dtype=_DTYPE).tobytes())
        file.seek(0)
        _write_header(file, sum(rows), width)
        # NumPy leaves room for the number of rows to grow.
        assert file.tell() == begin
    return rows


def _write_header(file: Any, rows: int, width: int) -> None:
    described = {"descr": _DTYPE.str, "fortran_order": False, "shape": (rows, width)}
    np.lib.format.write_array_header_1_0(file, described)


def open_kept(
    array: Path, facts: Path, wanted: list[list[int]], field: SpeechField
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Open what is kept.

    Args:
        array: The rows.
        facts: What is said of them.
        wanted: Recording, first and last frame, first sample and rows wanted of every stretch.
        field: The field.

    Returns:
        As `kept_rows`.

    Raises:
        InputFileError: It is damaged, or of something else.
    """
    told = read_json(facts, _WHAT)
    with understood(facts, _WHAT):
        rows = np.array(told["rows"], dtype=np.int64)
        if told["stretches"] != wanted or rows.shape != (len(wanted),) or (rows < 0).any():
            raise InputFileError(facts, "says something else than its name")
    values = open_array(array, _WHAT)
    if values.dtype != _DTYPE or values.shape != (rows.sum(), field.width):
        raise InputFileError(array, f"holds {values.dtype} {values.shape}, not what {facts} says")
    return values, rows
