"""Where an LMDB database keeps its values, found without the lmdb library.

liblmdb maps the file and follows the page numbers and offsets in it unchecked, so that a truncated
or damaged ``data.mdb`` ends the process. Reading needs little of the format: two meta pages, of
which the newer counts, and a B-tree of branch and leaf pages. Here each page is read once and
every number is checked. (Layout: version 1 of the format, ``mdb.c`` of LMDB 0.9, 64-bit writers.)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from io import RawIOBase
from itertools import pairwise
from pathlib import Path
from struct import Struct
from typing import NamedTuple

from cospeech.errors import InputFileError
from cospeech.foreign import open_file

MAX_VALUE_BYTES = 2**31

_MAGIC = 0xBEEFC0DE
_VERSION = 1
_BRANCH, _LEAF, _META = 0x01, 0x02, 0x08
_PAGE_KINDS = 0x6F
_BIG_DATA = 0x01
_NO_PAGE = 2**64 - 1
_MAX_DEPTH = 32
_PAGE_SIZES = tuple(2**power for power in range(8, 17))

_PAGE = Struct("<QHHHH")  # number, padding, flags, end of the pointers, start of the nodes
_META_PAGE = Struct("<QHHI II QQ 48s IHHQQQQQ QQ")
_FREE_TABLE = Struct("<I")  # its first field holds the page size
_NODE = Struct("<HHHH")
_PAGE_NUMBER = Struct("<Q")
_META_BYTES = _META_PAGE.size

_HINT_COPY = "download or copy the file again and compare its size with the original's"


@dataclass(frozen=True, slots=True)
class ValuePlaces:
    """The unnamed database of a ``data.mdb``.

    Attributes:
        path: The file.
        places: Offset and length in bytes of each value in the file, by key, in key order.
    """

    path: Path
    places: dict[bytes, tuple[int, int]]

    def read(self, key: bytes) -> bytes:
        """The bytes of one value.

        Raises:
            InputFileError: There is no such key, or the file has been cut since it was opened.
        """
        if key not in self.places:
            raise InputFileError(self.path, f"has no key {key!r}, only {len(self.places)} others")
        offset, length = self.places[key]
        with open_file(self.path).detach() as file:
            return _read(file, self.path, offset, length)


def data_file(path: str | Path) -> Path:
    """The ``data.mdb`` of a database given as its folder or as the file itself.

    Raises:
        InputFileError: There is none.
    """
    path = Path(path)
    if not path.is_dir():
        if not path.is_file():
            raise InputFileError(path, "there is no such LMDB folder or file")
        return path
    if (path / "data.mdb").is_file():
        return path / "data.mdb"
    problem = "the folder has no data.mdb"
    if (path / "lock.mdb").exists():
        problem = "the folder has a lock.mdb but no data.mdb, which is the file with the values"
    raise InputFileError(path, problem, hint="copy the database's data.mdb there")


def find_values(path: str | Path) -> ValuePlaces:
    """Open a database given as its folder or file; remembered until the file changes.

    Raises:
        InputFileError: There is none, or it is cut short or damaged, or has named databases or
            several values per key.
    """
    file = data_file(path)
    status = file.stat()
    return _find_values(file, status.st_size, status.st_mtime_ns, status.st_ino)


@lru_cache(maxsize=8)
def _find_values(path: Path, size: int, _modified: int, _inode: int) -> ValuePlaces:
    with open_file(path).detach() as file:
        return ValuePlaces(path, _Tree(file, path, size).places())


def _read(file: RawIOBase, path: Path, offset: int, length: int) -> bytes:
    file.seek(offset)
    parts, missing = [], length
    # one system call gives at most 2 GB
    while missing and (part := file.read(missing)):
        parts.append(part)
        missing -= len(part)
    if missing:
        raise InputFileError(path, "it is cut short", f"byte {offset}", _HINT_COPY)
    return parts[0] if len(parts) == 1 else b"".join(parts)


class _Meta(NamedTuple):
    page_size: int
    last_page: int
    transaction: int
    flags: int
    entries: int
    root: int


class _Tree:
    def __init__(self, file: RawIOBase, path: Path, size: int) -> None:
        self.file = file
        self.path = path
        self.size = size
        first = self._meta(0)
        if first is None:
            raise self._damaged("this isn't an LMDB file", 0)
        second = self._meta(first.page_size)
        # a writer that was killed leaves the other page valid
        self.meta = second if second and second.transaction > first.transaction else first

    def places(self) -> dict[bytes, tuple[int, int]]:
        """The places of all values, by key."""
        if self.meta.flags:
            raise self._damaged("it has several values per key or keys of a special order", 0)
        places: dict[bytes, tuple[int, int]] = {}
        last_key = b""
        for key, offset, length in self._leaves():
            if places and key <= last_key:
                raise self._damaged(f"key {key!r} comes after {last_key!r}", offset)
            places[key] = offset, length
            last_key = key
        if len(places) != self.meta.entries:
            raise self._damaged(f"it has {len(places)} values, not {self.meta.entries}", 0)
        in_file_order = sorted(place for place in places.values() if place[1])
        for (offset, length), (following, _) in pairwise(in_file_order):
            if offset + length > following:
                raise self._damaged("two values overlap", following)
        return places

    def _damaged(self, problem: str, offset: int) -> InputFileError:
        return InputFileError(self.path, problem, f"byte {offset}", _HINT_COPY)

    def _meta(self, offset: int) -> _Meta | None:
        """The meta page at an offset; None when there is none or it makes no sense."""
        if offset + _META_BYTES > self.size:
            raise self._damaged(f"{self.size} bytes are too few for an LMDB file", self.size)
        fields = _META_PAGE.unpack(_read(self.file, self.path, offset, _META_BYTES))
        _, _, kind, _, magic, version, _, _, free = fields[:9]
        if not kind & _META or magic != _MAGIC:
            return None
        if version != _VERSION:
            raise self._damaged(f"version {version} of the LMDB format isn't read", offset)
        (page_size,) = _FREE_TABLE.unpack_from(free)
        if page_size not in _PAGE_SIZES:
            raise self._damaged(f"pages of {page_size} bytes aren't possible", offset)
        _, flags, _, _, _, _, entries, root, last_page, transaction = fields[9:]
        return _Meta(page_size, last_page, transaction, flags, entries, root)

    def _leaves(self) -> Iterator[tuple[bytes, int, int]]:
        """Key, offset and length of every value, walking the tree in key order."""
        seen: set[int] = set()
        waiting = [] if self.meta.root == _NO_PAGE else [(self.meta.root, 0)]
        while waiting:
            number, depth = waiting.pop()
            if number in seen or depth > _MAX_DEPTH:
                raise self._damaged("pages refer to one another in a circle", self._place(number))
            seen.add(number)
            kind, page, nodes = self._page(number)
            if kind == _LEAF:
                yield from (self._value(number, page, node) for node in nodes)
            else:
                children = [self._child(number, page, node) for node in nodes]
                waiting += [(child, depth + 1) for child in reversed(children)]

    def _place(self, number: int) -> int:
        return number * self.meta.page_size

    def _page(self, number: int) -> tuple[int, bytes, list[int]]:
        """Kind, bytes and the offsets of the nodes of a page."""
        size, offset = self.meta.page_size, self._place(number)
        if not 2 <= number <= self.meta.last_page:
            raise self._damaged(f"page {number} doesn't exist", 0)
        if offset + size > self.size:
            raise self._damaged(f"it has {self.size} bytes, its tree goes on", offset)
        page = _read(self.file, self.path, offset, size)
        own_number, _, flags, lower, upper = _PAGE.unpack_from(page)
        kind = flags & _PAGE_KINDS
        if own_number != number or kind not in (_BRANCH, _LEAF):
            raise self._damaged("a page of the tree is damaged", offset)
        if lower % 2 or not _PAGE.size <= lower <= upper <= size:
            raise self._damaged("a page's pointers are damaged", offset)
        nodes = [node for (node,) in Struct("<H").iter_unpack(page[_PAGE.size : lower])]
        if nodes and not (upper <= min(nodes) and max(nodes) + _NODE.size <= size):
            raise self._damaged("a page's pointers leave it", offset)
        return kind, page, nodes

    def _child(self, number: int, page: bytes, node: int) -> int:
        low, high, top, _ = _NODE.unpack_from(page, node)
        return low | high << 16 | top << 32

    def _value(self, number: int, page: bytes, node: int) -> tuple[bytes, int, int]:
        low, high, flags, key_length = _NODE.unpack_from(page, node)
        length = low | high << 16
        data = node + _NODE.size + key_length
        offset = self._place(number) + data
        if flags & ~_BIG_DATA:
            raise self._damaged("it holds named databases or several values per key", offset)
        inside = _PAGE_NUMBER.size if flags else length
        if data + inside > len(page):
            raise self._damaged("a value leaves its page", offset)
        if flags:
            first_page = _PAGE_NUMBER.unpack_from(page, data)[0]
            if not 2 <= first_page <= self.meta.last_page:
                raise self._damaged(f"a value lies on page {first_page}, which isn't there", offset)
            offset = self._place(first_page) + _PAGE.size
        if length > MAX_VALUE_BYTES:
            raise self._damaged(f"a value of {length} bytes isn't read", offset)
        if offset + length > self.size:
            missing = offset + length - self.size
            raise self._damaged(f"it is cut short by {missing} bytes or more", self.size)
        return page[node + _NODE.size : data], offset, length
