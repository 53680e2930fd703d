"""Flatbuffer tables, as much as Arrow's messages need, with every offset checked.

Section 3 of the format's description: a table starts with the signed distance back to its vtable,
which holds for each field its distance from the table's start, 0 meaning "absent, use the default".
"""

from __future__ import annotations

from collections.abc import Iterator
from struct import Struct

from cospeech.formats.legacy_arrow.errors import LegacyArrowError

_MAX_TEXT_BYTES = 20
_UINT16, _UINT32, _INT32 = Struct("<H"), Struct("<I"), Struct("<i")
BOOL, UINT8, INT16, INT32, INT64 = (Struct("<" + code) for code in "?Bhiq")


def unpack(data: bytes, layout: Struct, at: int) -> tuple:
    """The numbers at a place that must lie inside `data`.

    Raises:
        LegacyArrowError: It doesn't.
    """
    # struct counts a negative place from the end, so it would not notice
    if at < 0 or at + layout.size > len(data):
        raise LegacyArrowError("an offset points outside the metadata", min(max(at, 0), len(data)))
    return layout.unpack_from(data, at)


class Table:
    """A table inside one message's metadata.

    Args:
        data: The metadata; offsets in errors count from its start.
        at: Where the table starts.

    Raises:
        LegacyArrowError: Here and in every method, when something points outside the metadata.
    """

    __slots__ = ("at", "data", "fields")

    def __init__(self, data: bytes, at: int) -> None:
        self.data = data
        self.at = at
        vtable = at - unpack(data, _INT32, at)[0]
        size = unpack(data, _UINT16, vtable)[0]
        if size < 4 or size % 2 or vtable + size > len(data):
            raise LegacyArrowError("a table's field list has an impossible size", vtable)
        self.fields = memoryview(data)[vtable + 4 : vtable + size]

    @classmethod
    def root(cls, data: bytes) -> Table:
        """The table that the first word of the metadata points to."""
        return cls(data, unpack(data, _UINT32, 0)[0])

    def place(self, index: int) -> int | None:
        """Where a field's value lies; None when it is absent."""
        if 2 * index + 2 > len(self.fields):
            return None
        distance = self.fields[2 * index] | self.fields[2 * index + 1] << 8
        return self.at + distance if distance else None

    def number(self, index: int, layout: Struct) -> int:
        """A scalar field; 0 when it is absent."""
        at = self.place(index)
        return 0 if at is None else unpack(self.data, layout, at)[0]

    def table(self, index: int) -> Table:
        """A sub-table, which must be there."""
        at = self.place(index)
        if at is None:
            raise LegacyArrowError(f"a table lacks its field {index}", self.at)
        return Table(self.data, at + unpack(self.data, _UINT32, at)[0])

    def vector(self, index: int, item_size: int) -> tuple[int, int]:
        """Start and count of a vector that lies inside the metadata; count 0 when it is absent."""
        at = self.place(index)
        if at is None:
            return 0, 0
        at += unpack(self.data, _UINT32, at)[0]
        count = unpack(self.data, _UINT32, at)[0]
        if at + 4 + count * item_size > len(self.data):
            raise LegacyArrowError(f"a vector of {count} items runs past the metadata", at)
        return at + 4, count

    def tables(self, index: int) -> Iterator[Table]:
        """A vector of tables, each opened when its turn comes."""
        start, count = self.vector(index, 4)
        for at in range(start, start + 4 * count, 4):
            yield Table(self.data, at + unpack(self.data, _UINT32, at)[0])

    def string(self, index: int) -> str:
        """A string field, or the first bytes of a long one; empty when it is absent."""
        start, count = self.vector(index, 1)
        return self.data[start : start + min(count, _MAX_TEXT_BYTES)].decode(errors="replace")

    def numbers(self, index: int, code: str, width: int = 1) -> tuple[int, ...]:
        """A vector of numbers of one `struct` code, or of structs of `width` such numbers."""
        start, count = self.vector(index, width * Struct("<" + code).size)
        return Struct(f"<{count * width}{code}").unpack_from(self.data, start)
