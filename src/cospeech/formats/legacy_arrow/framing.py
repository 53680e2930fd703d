"""The layout of a whole value: counts, schema, record batch, tensors, buffers.

Sections 1, 2 and 6 of the format's description. Everything is counted from the first byte.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from struct import Struct
from typing import Any, TypeVar

import numpy as np

from cospeech.formats.legacy_arrow.columns import Columns
from cospeech.formats.legacy_arrow.errors import HINT_REBUILD, LegacyArrowError
from cospeech.formats.legacy_arrow.flatbuffer import INT32, INT64, UINT8, Table
from cospeech.formats.legacy_arrow.schema import V4, Schema, Tag, parse_schema
from cospeech.formats.legacy_arrow.tensors import copy_tensor, tensor_layout

RECORD_BATCH_MESSAGE = 3
_HEADER_BYTES = 16
_HEADER = Struct("<4i")
_MARKED_LENGTH = Struct("<ii")
_MARKER = -1
_Parsed = TypeVar("_Parsed")

_parse_known_schema = lru_cache(maxsize=64)(parse_schema)
_MAX_CACHED_BYTES = 32 * 1024


def loads(value: bytes) -> object:
    """The object that `pyarrow.serialize` of release 0.13 to 11.0 wrote.

    Gives what pyarrow's own ``deserialize`` gave: None, bool, int, float, ``np.float16``, str,
    bytes, datetime, list, tuple, dict, set, numpy arrays (row-major, writable, copied, so that the
    value can go), and OrderedDict, Counter, deque. Buffers come as bytes, ``np.matrix`` and
    pyarrow's tensors as arrays. Time and memory are bounded by a multiple of the value's size.

    Raises:
        LegacyArrowError: The value is damaged or cut short; or release 0.12 or older wrote it; or
            it holds pickled, pandas or torch objects, types or sparse tensors.
    """
    if len(value) < _HEADER_BYTES + _MARKED_LENGTH.size:
        raise LegacyArrowError(f"only {len(value)} bytes, too short for any value", len(value))
    counts = _HEADER.unpack_from(value)
    marked = INT32.unpack_from(value, _HEADER_BYTES)[0] == _MARKER
    if not marked and counts[3] != 0:
        raise LegacyArrowError(
            "it is damaged, or was written by pyarrow 0.11 or older, which nothing here reads",
            12,
            HINT_REBUILD,
        )
    start, stop = _metadata(value, _HEADER_BYTES, marked)
    metadata = value[start:stop]
    parse = _parse_known_schema if len(metadata) <= _MAX_CACHED_BYTES else parse_schema
    schema = _parsed(parse, metadata, start)

    start, stop = _metadata(value, stop, marked)
    batch = _parsed(_parse_batch, value[start:stop], start)
    if stop + batch.body_bytes > len(value):
        raise LegacyArrowError("the record batch runs past the end", stop)
    if len(batch.nodes) != schema.node_count or len(batch.buffers) != schema.buffer_count:
        raise LegacyArrowError("the record batch doesn't have the schema's columns", start)
    buffers = _placed(batch.buffers, stop, batch.body_bytes)

    stored = _stored_counts(counts, marked, schema, batch)
    at = _end_of_stream(value, stop + batch.body_bytes, marked)
    contents: dict[Tag, list[Any]] = {}
    for tag in (Tag.TENSOR, Tag.ARRAY):
        contents[tag], at = _tensors(value, at, stored[tag], marked)
    contents[Tag.BUFFER] = _raw_buffers(value, at, stored[Tag.BUFFER])
    return Columns(value, schema, batch.nodes, buffers, contents).read()


class _Batch:
    """A record batch's metadata: nodes as (length, nulls), buffers as (offset, length)."""

    def __init__(self, nodes: tuple[int, ...], buffers: tuple[int, ...], body_bytes: int) -> None:
        self.nodes = list(zip(nodes[::2], nodes[1::2], strict=True))
        self.buffers = list(zip(buffers[::2], buffers[1::2], strict=True))
        self.body_bytes = body_bytes


def _parse_batch(metadata: bytes) -> _Batch:
    message = Table.root(metadata)
    if message.number(1, UINT8) != RECORD_BATCH_MESSAGE:
        raise LegacyArrowError("the second message isn't a record batch", message.at)
    body_bytes = message.number(3, INT64)
    batch = message.table(2)
    if batch.number(0, INT64) != 1 or body_bytes < 0:
        raise LegacyArrowError("the record batch isn't one row", batch.at)
    return _Batch(batch.numbers(1, "q", 2), batch.numbers(2, "q", 2), body_bytes)


def _parsed(parse: Callable[[bytes], _Parsed], metadata: bytes, start: int) -> _Parsed:
    """Parse a message's metadata; errors then count from the start of the value."""
    try:
        return parse(metadata)
    except LegacyArrowError as error:
        raise error.moved_by(start) from None


def _metadata(value: bytes, at: int, marked: bool) -> tuple[int, int]:
    """Where the metadata of the message at a place begins and ends."""
    start = at + (8 if marked else 4)
    if start > len(value):
        raise LegacyArrowError("it ends where a message should begin", min(at, len(value)))
    if marked:
        marker, length = _MARKED_LENGTH.unpack_from(value, at)
        if marker != _MARKER:
            raise LegacyArrowError("a message lacks its marker", at)
    else:
        length = INT32.unpack_from(value, at)[0]
    if length <= 0 or start + length > len(value):
        raise LegacyArrowError(f"a message's length of {length} bytes is impossible", at)
    return start, start + length


def _placed(buffers: list[tuple[int, int]], body: int, body_bytes: int) -> list[tuple[int, int]]:
    """Start in the value and length of each buffer, checked to lie one after the other."""
    end = 0
    for offset, length in buffers:
        if length and (offset < end or length < 0 or offset + length > body_bytes):
            raise LegacyArrowError("buffers overlap or leave the record batch", body)
        end = max(end, offset + length) if length else end
    return [(body + offset if length else body, length) for offset, length in buffers]


def _stored_counts(
    counts: tuple[int, ...], marked: bool, schema: Schema, batch: _Batch
) -> dict[Tag, int]:
    """How many tensors, arrays and buffers follow; from 0.16 on sparse tensors come second."""
    four = False
    if marked:
        arrays = sum(batch.nodes[node][0] for node in schema.array_nodes)
        four = schema.version != V4 or counts[3] != 0 or arrays != counts[1]
    if four and counts[1] != 0:
        raise LegacyArrowError("it holds sparse tensors, which aren't read, or is damaged", 4)
    numbers = (counts[0], *counts[2:]) if four else counts[:3]
    if min(numbers) < 0:
        raise LegacyArrowError(f"its counts {counts} are impossible", 0)
    return dict(zip((Tag.TENSOR, Tag.ARRAY, Tag.BUFFER), numbers, strict=True))


def _end_of_stream(value: bytes, at: int, marked: bool) -> int:
    """Check the end of the stream; returns where the next message begins."""
    end = b"\xff\xff\xff\xff\0\0\0\0" if marked else b"\0\0\0\0"
    if value[at : at + len(end)] != end:
        raise LegacyArrowError("the stream doesn't end after its record batch", at)
    return _aligned(at + len(end))


def _aligned(at: int) -> int:
    return -(-at // 64) * 64


def _tensors(value: bytes, at: int, count: int, marked: bool) -> tuple[list[np.ndarray], int]:
    """So many arrays from a place on, and where the next message begins."""
    arrays = []
    # in values with an array per frame thousands of messages begin with the same bytes
    known = layout = None
    for _ in range(count):
        if known is None or layout is None or not value.startswith(known, at):
            start, stop = _metadata(value, at, marked)
            layout = _parsed(tensor_layout, value[start:stop], start)
            known = value[at:stop]
        body = at + len(known)
        at = _aligned(body + layout.size_bytes)
        if body + layout.size_bytes > len(value):
            raise LegacyArrowError(f"an array of {layout.size_bytes} bytes is cut short", body)
        arrays.append(copy_tensor(value, body, layout))
    return arrays, at


def _raw_buffers(value: bytes, at: int, count: int) -> list[bytes]:
    buffers = []
    for _ in range(count):
        if at + INT64.size > len(value):
            raise LegacyArrowError("it ends where a buffer should begin", min(at, len(value)))
        length = INT64.unpack_from(value, at)[0]
        start = at + INT64.size
        at = start + length
        if length < 0 or at > len(value):
            raise LegacyArrowError(f"a buffer of {length} bytes is cut short", start)
        buffers.append(value[start:at])
    return buffers
