"""The record batch: columns of numbers and text back into one Python object.

Each column becomes a complete Python list, bottom-up, and every container is a slice of its
column's list. A value's size bounds the work: buffers must follow one another without overlap, the
rows of a container must divide its items among them, and a union must use each member's rows once
and in order, all as pyarrow wrote it. So nothing in a damaged value can be multiplied.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
from itertools import pairwise, repeat
from typing import Any

import numpy as np

from cospeech.formats.legacy_arrow.custom import MARK, check_hashes, restore
from cospeech.formats.legacy_arrow.errors import LegacyArrowError
from cospeech.formats.legacy_arrow.schema import V4, Member, Schema, Tag, Union

_EPOCH = datetime(1970, 1, 1)
_TAKEN = object()
_FEW_ROWS = 64
"""So few are counted faster without numpy."""


class Columns:
    """One record batch.

    Args:
        value: All bytes; offsets count from their start.
        schema: Its schema.
        nodes: Length and count of nulls of each column, depth first.
        buffers: Start (in `value`) and length of each buffer, in the same order; already known to
            lie inside the value, one after the other.
        stored: What columns of indices refer to: tensors, arrays and buffers.
    """

    def __init__(
        self,
        value: bytes,
        schema: Schema,
        nodes: Sequence[tuple[int, int]],
        buffers: Sequence[tuple[int, int]],
        stored: dict[Tag, list[Any]],
    ) -> None:
        self._value = value
        self._schema = schema
        self._nodes = iter(nodes)
        self._buffers = iter(buffers)
        self._stored = stored
        self._at = 0

    def read(self) -> object:
        """The Python object.

        Raises:
            LegacyArrowError: Counts, offsets or text are damaged, or a custom type isn't read.
        """
        return self._union(self._schema.root, 1)[0]

    def _damaged(self, problem: str) -> LegacyArrowError:
        return LegacyArrowError(problem, self._at)

    def _node(self, rows: int) -> int:
        """Check a column's length; returns its count of nulls."""
        length, nulls = next(self._nodes)
        if length != rows:
            raise self._damaged(f"a column has {length} rows instead of {rows}")
        return nulls

    def _whole_node(self, rows: int) -> None:
        if self._node(rows):
            raise self._damaged("a column below a union has nulls of its own")

    def _buffer(self, needed: int) -> int:
        """Start of the next buffer, which must hold so many bytes at least."""
        start, length = next(self._buffers)
        if needed > length:
            raise LegacyArrowError(f"a buffer of {length} bytes should have {needed}", start)
        self._at = start
        return start

    def _numbers(self, dtype: str, count: int) -> np.ndarray:
        start = self._buffer(np.dtype(dtype).itemsize * count)
        return np.frombuffer(self._value, dtype, count, start)

    def _offsets(self, rows: int) -> tuple[list[int], int]:
        """Where each row's part begins and ends, and the sum of all."""
        if not rows:
            self._buffer(0)
            return [0], 0
        offsets = self._numbers("<i4", rows + 1)
        if offsets[0] != 0 or (offsets[1:] < offsets[:-1]).any():
            raise self._damaged("offsets don't start at 0 or go back")
        return offsets.tolist(), int(offsets[-1])

    def _union(self, union: Union, rows: int) -> list[Any]:
        nulls = self._node(rows)
        present = self._present(rows, nulls)
        start = self._buffer(rows)
        slots = self._value[start : start + rows]
        offsets = self._numbers("<i4", rows)
        if present is not None:
            # one more slot, for None: its own type id and offset mean nothing
            types = np.where(present, np.frombuffer(slots, "u1"), len(union.members))
            slots = types.astype("u1").tobytes()
        counts = _rows_used(slots, offsets, len(union.members))
        if counts is None or rows - sum(counts) != nulls:
            raise self._damaged("a union doesn't use its columns' rows once and in order")
        items = [self._member(*used) for used in zip(union.members, counts, strict=True)]
        if len(items) == 1 and not nulls:
            return items[0]
        turns = [*map(iter, items), repeat(None)]
        return [next(turns[slot]) for slot in slots]

    def _present(self, rows: int, nulls: int) -> np.ndarray | None:
        """Which values aren't None, in the versions that say so with a bitmap."""
        if self._schema.version != V4:
            if nulls:
                raise self._damaged("a union has nulls of its own")
            return None
        if not 0 <= nulls <= rows:
            raise self._damaged(f"{nulls} of {rows} values should be missing")
        bits = self._numbers("u1", (rows + 7) // 8 if nulls else 0)
        if not nulls:
            return None
        present = np.unpackbits(bits, count=rows, bitorder="little").view(bool)
        if np.count_nonzero(present) != rows - nulls:
            raise self._damaged(f"not {nulls} of {rows} values are missing")
        return present

    def _member(self, member: Member, rows: int) -> list[Any]:
        if member.tag in _CONTAINERS:
            return self._containers(member, rows)
        if member.tag is Tag.NONE:
            self._node(rows)
            return [None] * rows
        self._whole_node(rows)
        self._buffer(0)
        return _LEAVES[member.tag](self, member.tag, rows)

    def _containers(self, member: Member, rows: int) -> list[Any]:
        self._whole_node(rows)
        self._buffer(0)
        edges, total = self._offsets(rows)
        if member.tag is Tag.DICT:
            self._whole_node(total)
            self._buffer(0)
        parts = [self._union(part, total) for part in member.parts]
        if member.tag is Tag.DICT:
            return self._dicts(member, edges, *parts)
        if member.tag is Tag.LIST:
            return [parts[0][start:stop] for start, stop in pairwise(edges)]
        if member.tag is Tag.TUPLE:
            return [tuple(parts[0][start:stop]) for start, stop in pairwise(edges)]
        return self._sets(member, edges, parts[0])

    def _sets(self, member: Member, edges: list[int], items: list[Any]) -> list[Any]:
        careful = _can_collide(member.parts[0])
        sets = []
        try:
            for start, stop in pairwise(edges):
                if careful:
                    check_hashes(items[start:stop])
                sets.append(set(items[start:stop]))
                if len(sets[-1]) != stop - start:
                    raise ValueError("a set has equal items")
        except (TypeError, ValueError) as error:
            raise self._damaged(str(error)) from None
        return sets

    def _dicts(
        self, member: Member, edges: list[int], keys: list[Any], values: list[Any]
    ) -> list[Any]:
        careful = _can_collide(member.parts[0])
        dicts: list[Any] = []
        try:
            for start, stop in pairwise(edges):
                if careful:
                    check_hashes(keys[start:stop])
                row = dict(zip(keys[start:stop], values[start:stop], strict=True))
                if len(row) != stop - start:
                    raise ValueError("a dict has equal keys")
                dicts.append(restore(row) if MARK in row else row)
        except (TypeError, ValueError) as error:
            raise self._damaged(str(error)) from None
        return dicts

    def _bools(self, _: Tag, rows: int) -> list[bool]:
        bits = self._numbers("u1", (rows + 7) // 8)
        return np.unpackbits(bits, count=rows, bitorder="little").view(bool).tolist()

    def _integers(self, _: Tag, rows: int) -> list[int]:
        return self._numbers("<i8", rows).tolist()

    def _floats(self, tag: Tag, rows: int) -> list[float]:
        return self._numbers("<f4" if tag is Tag.FLOAT32 else "<f8", rows).tolist()

    def _halves(self, _: Tag, rows: int) -> list[np.float16]:
        return list(self._numbers("<f2", rows).astype(np.float16))

    def _datetimes(self, _: Tag, rows: int) -> list[datetime]:
        # pyarrow called the type milliseconds and wrote microseconds
        try:
            return [_EPOCH + timedelta(microseconds=time) for time in self._integers(_, rows)]
        except OverflowError:
            raise self._damaged("a time lies outside the years 1 to 9999") from None

    def _texts(self, tag: Tag, rows: int) -> list[Any]:
        edges, total = self._offsets(rows)
        start = self._buffer(total)
        raw = self._value[start : start + total]
        if tag is Tag.BYTES:
            return [raw[begin:end] for begin, end in pairwise(edges)]
        if raw.isascii():
            text = raw.decode("ascii")
            return [text[begin:end] for begin, end in pairwise(edges)]
        try:
            return [raw[begin:end].decode() for begin, end in pairwise(edges)]
        except UnicodeDecodeError:
            raise self._damaged("text isn't UTF-8") from None

    def _references(self, tag: Tag, rows: int) -> list[Any]:
        stored = self._stored[tag]
        found = []
        for index in self._numbers("<i4", rows).tolist():
            if not 0 <= index < len(stored) or stored[index] is _TAKEN:
                raise self._damaged(f"{tag.name.lower()} {index} doesn't exist or is used twice")
            found.append(stored[index])
            stored[index] = _TAKEN
        return found


def _rows_used(slots: bytes, offsets: np.ndarray, members: int) -> list[int] | None:
    """How many rows of each member a union uses; None if it doesn't use each once, in order."""
    if len(slots) <= _FEW_ROWS:
        counts = [0] * (members + 1)
        for slot, offset in zip(slots, offsets.tolist(), strict=True):
            if slot > members or (slot < members and counts[slot] != offset):
                return None
            counts[slot] += 1
        return counts[:members]
    types = np.frombuffer(slots, "u1")
    if types.max() > members:
        return None
    counts = np.bincount(types, minlength=members + 1)[:members].tolist()
    for member, count in enumerate(counts):
        if not np.array_equal(offsets[types == member], np.arange(count)):
            return None
    return counts


def _can_collide(keys: Union) -> bool:
    """Whether there are keys whose hashes a damaged value could choose."""
    return any(member.tag in (Tag.TUPLE, Tag.DICT) for member in keys.members)


_CONTAINERS = {Tag.LIST, Tag.DICT, Tag.TUPLE, Tag.SET}
_LEAVES: dict[Tag, Callable[[Columns, Tag, int], list[Any]]] = (
    {Tag.BOOL: Columns._bools, Tag.FLOAT16: Columns._halves, Tag.DATETIME: Columns._datetimes}
    | dict.fromkeys((Tag.INT, Tag.PYTHON2_INT), Columns._integers)
    | dict.fromkeys((Tag.FLOAT32, Tag.FLOAT64), Columns._floats)
    | dict.fromkeys((Tag.BYTES, Tag.STR), Columns._texts)
    | dict.fromkeys((Tag.TENSOR, Tag.ARRAY, Tag.BUFFER), Columns._references)
)
