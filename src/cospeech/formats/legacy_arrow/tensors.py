"""Tensor messages: one numpy array each, copied out of the value."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cospeech.formats.legacy_arrow.errors import LegacyArrowError
from cospeech.formats.legacy_arrow.flatbuffer import BOOL, INT16, INT32, INT64, UINT8, Table

TENSOR_MESSAGE = 4
MAX_DIMENSIONS = 32
_INT, _FLOAT = 2, 3


@dataclass(frozen=True, slots=True)
class TensorLayout:
    """What a tensor message says about its body.

    Attributes:
        dtype: Little-endian.
        shape: Any number of dimensions, sizes from 0.
        strides: In bytes; row-major or column-major without gaps.
        size_bytes: Length of the body.
    """

    dtype: np.dtype
    shape: tuple[int, ...]
    strides: tuple[int, ...]
    size_bytes: int


def parse_tensor(metadata: bytes) -> TensorLayout:
    """Read a tensor message's metadata, without its length prefix.

    Raises:
        LegacyArrowError: It is damaged. The offset counts from the start of the metadata.
    """
    message = Table.root(metadata)
    if message.number(1, UINT8) != TENSOR_MESSAGE:
        raise LegacyArrowError("a message isn't a tensor", message.at)
    tensor = message.table(2)
    dtype = _dtype(tensor)
    if max(tensor.vector(2, 4)[1], tensor.vector(3, 8)[1]) > MAX_DIMENSIONS:
        raise LegacyArrowError("a tensor has too many dimensions", tensor.at)
    shape = tuple(dimension.number(0, INT64) for dimension in tensor.tables(2))
    strides = tensor.numbers(3, "q")
    size_bytes = message.number(3, INT64)
    place = tensor.place(4)
    if place is None or tensor.number(4, INT64) != 0:
        raise LegacyArrowError("a tensor's data doesn't start at its body", tensor.at)
    # an empty array's other sizes can be anything, but numpy must be able to hold them
    extent = math.prod(max(size, 1) for size in shape) * dtype.itemsize
    if any(size < 0 for size in shape) or extent >= 2**63:
        raise LegacyArrowError(f"shape {shape} is impossible", tensor.at)
    if math.prod(shape) * dtype.itemsize != size_bytes:
        raise LegacyArrowError(
            f"shape {shape} of {dtype} doesn't fit a body of {size_bytes} bytes", tensor.at
        )
    if size_bytes == 0:
        return TensorLayout(dtype, shape, _row_major(shape, dtype.itemsize), 0)
    _check_strides(shape, strides, dtype.itemsize, tensor.at)
    return TensorLayout(dtype, shape, strides, size_bytes)


_parse_known = lru_cache(maxsize=1024)(parse_tensor)
_MAX_CACHED_BYTES = 2048


def tensor_layout(metadata: bytes) -> TensorLayout:
    """`parse_tensor`, remembered for the usual small metadata."""
    return (_parse_known if len(metadata) <= _MAX_CACHED_BYTES else parse_tensor)(metadata)


def copy_tensor(value: bytes, body: int, layout: TensorLayout) -> np.ndarray:
    """The array whose body starts at `body`; row-major, writable, owning its memory."""
    return np.ndarray(layout.shape, layout.dtype, value, body, layout.strides).copy()


def _dtype(tensor: Table) -> np.dtype:
    kind = tensor.number(0, UINT8)
    type_ = tensor.table(1)
    if kind == _INT:
        bits = type_.number(0, INT32)
        if bits in (8, 16, 32, 64):
            return np.dtype(f"<{'i' if type_.number(1, BOOL) else 'u'}{bits // 8}")
    elif kind == _FLOAT:
        precision = type_.number(0, INT16)
        if precision in (0, 1, 2):
            return np.dtype(("<f2", "<f4", "<f8")[precision])
    raise LegacyArrowError("a tensor's numbers are of an unknown type", type_.at)


def _row_major(shape: tuple[int, ...], item_size: int) -> tuple[int, ...]:
    strides = []
    for size in reversed(shape):
        strides.append(item_size)
        item_size *= max(size, 1)
    return tuple(reversed(strides))


def _check_strides(
    shape: tuple[int, ...], strides: tuple[int, ...], item_size: int, at: int
) -> None:
    """Only what the writer produced; a step over a dimension of size 1 is never taken."""
    rows = _row_major(shape, item_size)
    columns = _row_major(shape[::-1], item_size)[::-1]
    for expected in (rows, columns):
        if len(strides) == len(shape) and all(
            size == 1 or step == wanted
            for size, step, wanted in zip(shape, strides, expected, strict=True)
        ):
            return
    raise LegacyArrowError(f"strides {strides} don't fit shape {shape}", at)
