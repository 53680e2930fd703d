"""Arrays of an ``.npz`` file row by row: nothing is loaded whole, nothing is ever unpickled."""

from __future__ import annotations

import io
import math
import struct
import warnings
import weakref
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import InputFileError
from cospeech.foreign import open_file

MAX_MEMBERS = 64
MAX_HEADER_BYTES = 10_000
MAX_READ_BYTES = 2**28
"""Largest piece of an array that one call returns."""
MAX_EXPANSION = 200
"""How many times its size a large compressed array may grow: measured floats don't pack better."""

_LARGE_BYTES = 2**28
_LARGEST_DIRECTORY = 2**20
_LARGEST_RAW_READ = 2**24
_SKIPPED_AT_ONCE = 2**18
_READ_HEADER = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
_LOCAL_HEADER = struct.Struct("<4s22xHH")


@dataclass(frozen=True)
class ArrayInfo:
    """One array of the file.

    Attributes:
        shape: Its shape, as its header says and the member's size confirms.
        dtype: Numbers or fixed-width text.
        start: Bytes from the member's start to the first value.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    start: int

    @property
    def row_bytes(self) -> int:
        """Bytes of one entry along the first axis."""
        return math.prod(self.shape[1:]) * self.dtype.itemsize


class NpzReader:
    """An open ``.npz``; close it or use it in a ``with``.

    An array stored as it is (`numpy.savez`) is read at the rows asked for. A compressed one
    (`numpy.savez_compressed`) is unpacked up to them, and further from there by the next call, so
    reading rows in ascending order unpacks it once.

    Args:
        path: The file.

    Raises:
        InputFileError: It is absent or not an ``.npz``, or its directory can't be trusted.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        try:
            file = _BoundedReader(self.path)
        except OSError as error:
            raise InputFileError(self.path, f"can't be read ({error.strerror})") from error
        self._file = file
        self._close = weakref.finalize(self, file.close)
        with self._understood("its directory"):
            self._zip = zipfile.ZipFile(file)
        file.largest_read = _LARGEST_RAW_READ
        self._members: dict[str, zipfile.ZipInfo] = {}
        members = self._zip.infolist()
        if len(members) > MAX_MEMBERS:
            raise self._wrong(f"holds {len(members)} members; {MAX_MEMBERS} are plausible")
        for member in members:
            name = member.filename.removesuffix(".npy")
            if name in self._members:
                raise self._wrong(f"holds two arrays called {name!r}")
            self._members[name] = member
        self._infos: dict[str, ArrayInfo] = {}
        self._starts: dict[str, int] = {}
        self._unpacking: dict[str, IO[bytes]] = {}

    def close(self) -> None:
        """Close the file."""
        self._close()

    def __enter__(self) -> NpzReader:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    @property
    def names(self) -> list[str]:
        """Names of the arrays, as in the file."""
        return list(self._members)

    def info(self, name: str) -> ArrayInfo:
        """Shape and type of an array.

        Raises:
            InputFileError: There is no such array, its header is none of a plain array, it holds
                Python objects, or it isn't as long as its header says.
        """
        if name not in self._infos:
            self._infos[name] = self._checked_info(name)
        return self._infos[name]

    def rows(self, name: str, start: int, stop: int) -> NDArray[Any]:
        """Entries ``start`` to ``stop`` (exclusive) along an array's first axis.

        Raises:
            InputFileError: As `info`; or the file is cut off or damaged there.
            ValueError: The rows aren't in the array, or are more than `MAX_READ_BYTES`.
        """
        info = self.info(name)
        if not info.shape or not 0 <= start <= stop <= info.shape[0]:
            raise ValueError(f"rows {start} to {stop} of an array of shape {info.shape}")
        count = (stop - start) * info.row_bytes
        if count > MAX_READ_BYTES:
            raise ValueError(f"{count} bytes at once; at most {MAX_READ_BYTES}")
        place = f"array {name!r}, rows {start} to {stop}"
        with self._understood(place):
            stream = self._stream(name, info.start + start * info.row_bytes)
            # A bytearray, not bytes: the array may be changed in place.
            buffer = bytearray(count)
            view, filled = memoryview(buffer), 0
            while filled < count and (read := stream.readinto(view[filled:])):  # type: ignore[attr-defined]
                filled += read
        if filled < count:
            raise self._wrong("the file is cut off", place)
        values = np.frombuffer(buffer, dtype=info.dtype)
        return values.reshape(stop - start, *info.shape[1:])

    def _stream(self, name: str, position: int) -> IO[bytes]:
        """Something to read a member's bytes from, at a position in it."""
        member = self._members[name]
        if member.compress_type == zipfile.ZIP_STORED:
            self._file.seek(self._stored_start(name) + position)
            return self._file
        if name not in self._unpacking:
            self._unpacking[name] = self._zip.open(member)
        stream = self._unpacking[name]
        if position < stream.tell():
            stream.seek(0)
        # Not by one seek: it would unpack, and keep, megabytes at a time.
        while (left := position - stream.tell()) and stream.read(min(left, _SKIPPED_AT_ONCE)):
            pass
        return stream

    def _stored_start(self, name: str) -> int:
        """Where a stored member's bytes start in the file."""
        if name not in self._starts:
            offset = self._members[name].header_offset
            self._file.seek(offset)
            head = self._file.read(_LOCAL_HEADER.size)
            _, name_bytes, extra_bytes = _LOCAL_HEADER.unpack(head)
            self._starts[name] = offset + _LOCAL_HEADER.size + name_bytes + extra_bytes
        return self._starts[name]

    def _checked_info(self, name: str) -> ArrayInfo:
        if name not in self._members:
            raise self._wrong(
                f"has no array {name!r}; it has {', '.join(sorted(self._members)) or 'none'}"
            )
        member, place = self._members[name], f"array {name!r}"
        packed, size = member.compress_size, member.file_size
        if member.flag_bits & 1:
            raise self._wrong("is encrypted", place)
        if size > _LARGE_BYTES and size > MAX_EXPANSION * packed:
            raise self._wrong(f"{packed} bytes would become {size}: not measured data", place)
        with self._understood(place), self._zip.open(member) as stream:
            shape, dtype, start = self._header(stream, place)
        if start + math.prod(shape) * dtype.itemsize != size:
            raise self._wrong(
                f"claims the shape {shape} of {dtype}, which is not the {size} bytes it has", place
            )
        return ArrayInfo(shape, dtype, start)

    def _header(self, stream: IO[bytes], place: str) -> tuple[tuple[int, ...], np.dtype[Any], int]:
        # No more of it than a header has, whatever length it claims.
        head = io.BytesIO(stream.read(MAX_HEADER_BYTES))
        try:
            with warnings.catch_warnings(action="ignore"):  # of headers that Python 2 wrote
                version = np.lib.format.read_magic(head)
                shape, fortran, dtype = _READ_HEADER[version](head)
        except Exception as error:
            problem = "is not a numpy array of format 1.0 or 2.0, or its header can't be read"
            raise self._wrong(problem, place) from error
        if dtype.hasobject:
            raise self._wrong(
                "holds Python objects, which only unpickling could read, and that is never done:"
                " it can run code",
                place,
                "ask for the array as numbers or fixed-width text",
            )
        if dtype.kind not in "fiubUS":
            raise self._wrong(f"holds values of the type {str(dtype)[:80]}", place)
        if not all(type(size) is int and 0 <= size < 2**48 for size in shape) or len(shape) > 8:
            raise self._wrong(f"claims the shape {str(shape)[:80]}", place)
        if fortran and len(shape) > 1:
            raise self._wrong(
                "is stored column by column (Fortran order), which can't be read item by item",
                place,
                "save it again with numpy.ascontiguousarray",
            )
        return shape, dtype, head.tell()

    @contextmanager
    def _understood(self, place: str) -> Iterator[None]:
        try:
            yield
        except (zipfile.BadZipFile, zlib.error, EOFError, struct.error, UnicodeError) as error:
            raise self._wrong(f"is damaged ({error})", place) from error
        except (NotImplementedError, RuntimeError) as error:
            raise self._wrong(f"can't be unpacked ({error})", place) from error
        except OSError as error:
            raise self._wrong(f"can't be read ({error.strerror or error})", place) from error
        except (ValueError, OverflowError) as error:
            raise self._wrong(f"its directory is damaged ({error})", place) from error

    def _wrong(
        self, problem: str, place: str | None = None, hint: str | None = None
    ) -> InputFileError:
        if hint is None and ("damaged" in problem or "cut off" in problem):
            hint = "download it again"
        return InputFileError(self.path, problem, place, hint)


class _BoundedReader(io.BufferedReader):
    """A file from which no claim in it makes anyone read more than a few megabytes at once."""

    def __init__(self, path: Path) -> None:
        super().__init__(open_file(path).detach())
        self._size = path.stat().st_size
        self.largest_read = _LARGEST_DIRECTORY

    def read(self, size: int | None = -1, /) -> bytes:
        left = max(0, self._size - self.tell())
        size = left if size is None or size < 0 else min(size, left)
        if size > self.largest_read:
            raise zipfile.BadZipFile(f"{size} bytes at once is more than any part of it needs")
        return super().read(size)
