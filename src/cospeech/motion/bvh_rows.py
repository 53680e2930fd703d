"""The rows of numbers of a BVH file, read a block of lines at a time.

What is in memory is a block and what becomes of it, never the file's whole text.
"""

from __future__ import annotations

import io
import math
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, TextIO

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import InputFileError
from cospeech.foreign import open_file, understood
from cospeech.motion.bvh_hierarchy import Hierarchy

MAX_FILE_BYTES = 2**30
MAX_HEADER_BYTES = 2**22
MAX_LINE_BYTES = 2**22
HEAD_BYTES = MAX_HEADER_BYTES + 4096
"""What follows the word MOTION may lie beyond the longest header."""

BLOCK_BYTES = 2**20
_ROW = re.compile(rb"\S[^\n]*")


class BvhText:
    """The bytes of a BVH file: its first part, and lines from any place in it on.

    Lines end with a newline, whatever they end with in the file.

    Args:
        path: For messages.
        stream: The file, at its start.
    """

    def __init__(self, path: Path, stream: BinaryIO) -> None:
        self.path = path
        self._stream = stream
        head = stream.read(HEAD_BYTES)
        self._head_bytes = len(head)
        self._only_returns = b"\n" not in head
        self.head = self._with_newlines(head.removeprefix(b"\xef\xbb\xbf"))

    def _with_newlines(self, data: bytes) -> bytes:
        return data.replace(b"\r", b"\n") if self._only_returns else data

    def blocks(self, start: int) -> Iterator[bytes]:
        """The text from place ``start`` of the head on, in pieces of whole lines.

        Raises:
            InputFileError: A line is longer than `MAX_LINE_BYTES`.
        """
        self._stream.seek(self._head_bytes)
        waiting = self.head[start:]
        while more := self._stream.read(BLOCK_BYTES):
            waiting += self._with_newlines(more)
            end = waiting.rfind(b"\n") + 1
            if end:
                yield waiting[:end]
            waiting = waiting[end:]
            if len(waiting) > MAX_LINE_BYTES:
                raise InputFileError(
                    self.path, f"a line of more than {MAX_LINE_BYTES} bytes: no row of a person"
                )
        if waiting:
            yield waiting


@contextmanager
def opened(source: str | Path | TextIO) -> Iterator[BvhText]:
    """A BVH file from a path or an open text file; whatever goes wrong inside names the file.

    Raises:
        InputFileError: It can't be opened, is too big to be motion, or something inside failed.
    """
    if isinstance(source, str | Path):
        path = Path(source)
        hint = "check the path"
        with understood(path, "a BVH file", hint), open_file(path, hint) as file:
            _refuse_large(path, os.fstat(file.fileno()).st_size)
            yield BvhText(path, file)
        return
    path = Path(str(getattr(source, "name", "<text stream>")))
    with understood(path, "a BVH file"):
        data = source.read(MAX_FILE_BYTES + 1).encode("utf-8", "replace")
        _refuse_large(path, len(data))
        yield BvhText(path, io.BytesIO(data))


def _refuse_large(path: Path, size: int) -> None:
    if size > MAX_FILE_BYTES:
        raise InputFileError(
            path,
            f"{size / 2**30:.1f} GiB is more than a BVH file may have here (1 GiB)",
            hint="cut it into takes",
        )


def decoded(data: bytes) -> str:
    """Text of a BVH file, in the encoding it is most likely in."""
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


class Rows:
    """The rows of a file, counted before any of them is read.

    Attributes:
        count: Rows that are read.
        cut_off: Numbers of a last row that the file ends in the middle of, which is left out; None
            when there is no such row.

    Args:
        text: The file.
        start: Where the rows start in its head.
        hierarchy: What their columns mean.
        most: More rows than this are not counted to the end.
    """

    def __init__(self, text: BvhText, start: int, hierarchy: Hierarchy, most: int) -> None:
        self._text, self._start, self._hierarchy = text, start, hierarchy
        self.count, self.cut_off = 0, None
        last = b""
        for block in text.blocks(start):
            found = _ROW.findall(block)
            self.count += len(found)
            last = found[-1] if found else last
            if self.count > most:
                return
        words = last.split()
        short = len(words) < hierarchy.channel_count and all(map(_is_number, words[:-1]))
        # of a handful of rows, one without its end says that the file is something else
        if short and tolerated_rows(self.count - 1) > 0:
            self.count, self.cut_off = self.count - 1, len(words)

    def values(self) -> Iterator[NDArray[np.float64]]:
        """The rows in order, ``(rows of a block, channels)``.

        Raises:
            InputFileError: A row is not as many finite numbers as there are channels. The message
                names the line, the frame and the joint.
        """
        frame, line = 0, self._text.head.count(b"\n", 0, self._start) + 1
        for block in self._text.blocks(self._start):
            found = [match.start() for match in _ROW.finditer(block)]
            wanted = min(len(found), self.count - frame)
            lines = block.count(b"\n")
            if wanted < len(found):
                block = block[: found[wanted]]
            if wanted:
                yield self._numbers(block, wanted, frame, line)
            frame, line = frame + wanted, line + lines

    def _numbers(self, block: bytes, rows: int, frame: int, line: int) -> NDArray[np.float64]:
        try:
            values = np.loadtxt(io.BytesIO(block), comments=None, ndmin=2, encoding="latin-1")
        except ValueError:
            values = np.empty((0, 0))
        if values.shape != (rows, self._hierarchy.channel_count) or not np.isfinite(values).all():
            raise self._error(block, frame, line)
        return values

    def _error(self, block: bytes, frame: int, line: int) -> InputFileError:
        """The first thing wrong with the rows of a block."""
        path, columns = self._text.path, self._hierarchy.channel_count
        for number, text in enumerate(io.BytesIO(block), start=line):
            words = text.split()
            for column, word in enumerate(words[:columns]):
                if not _is_number(word):
                    joint = self._hierarchy.joint_of_column(column)
                    hint = "repair or cut out these frames: motion with gaps can't be used"
                    if re.fullmatch(rb"[-+]?[0-9]+,[0-9]+", word):
                        hint = "write points in the place of decimal commas, or export it again so"
                    return InputFileError(
                        path,
                        f"{decoded(word[:40])!r} in column {column + 1} is not a finite number",
                        place=f"line {number}, frame {frame}, joint {joint}",
                        hint=hint,
                    )
            if words and len(words) != columns:
                return InputFileError(
                    path,
                    f"{len(words)} numbers where the hierarchy has {columns} channels",
                    place=f"line {number}, frame {frame}",
                    hint="if this is the last line, the file was cut off: remove the line",
                )
            frame += bool(words)
        return InputFileError(path, "the rows after 'Frame Time' are not plain numbers")


def tolerated_rows(rows: int) -> int:
    """Rows more or fewer than the header says that are no reason to doubt it.

    Recorders write one more or lose the last few: two of a short take, a hundredth of a long one.
    """
    return min(rows // 10, max(2, rows // 100))


def _is_number(word: bytes) -> bool:
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False
