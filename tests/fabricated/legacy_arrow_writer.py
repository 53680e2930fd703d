"""Write Python objects as ``pyarrow.serialize`` of releases 0.13 to 0.14.1 wrote them.

For tests and benchmarks of the reader. The bodies (all numbers, text and arrays) are equal byte for
byte to genuine ones; the metadata says the same in flatbuffers of another arrangement.
"""

import struct
from datetime import datetime, timedelta

import numpy as np

from tests.fabricated.flatbuffer_writer import Inline, Numbers, flatbuffer, pad

BOOL, INT, BYTES, STR, FLOAT16, FLOAT32, FLOAT64, DATETIME = 0, 1, 3, 4, 5, 6, 7, 8
LIST, DICT, TUPLE, SET, ARRAY = 9, 10, 11, 12, 14
EPOCH = datetime(1970, 1, 1)

TAGS = {
    bool: BOOL,
    np.bool_: BOOL,
    int: INT,
    bytes: BYTES,
    str: STR,
    np.str_: STR,
    np.float16: FLOAT16,
    np.float32: FLOAT32,
    np.float64: FLOAT64,
    float: FLOAT64,
    datetime: DATETIME,
    list: LIST,
    dict: DICT,
    tuple: TUPLE,
    set: SET,
    np.ndarray: ARRAY,
}
CONTAINERS = (LIST, DICT, TUPLE, SET)
NULL_TYPE, INT_TYPE, FLOAT_TYPE, LIST_TYPE, STRUCT_TYPE, UNION_TYPE = 1, 2, 3, 12, 13, 14
TYPES = {BOOL: 6, BYTES: 4, STR: 5, DATETIME: 8} | dict.fromkeys(CONTAINERS, LIST_TYPE)
SCHEMA_MESSAGE, BATCH_MESSAGE, TENSOR_MESSAGE = 1, 3, 4


def write_legacy_arrow(value: object) -> bytes:
    """The bytes of one value: nested str, bytes, int, float, bool, None, list, tuple, dict, set,
    datetime, numpy scalars and arrays of numbers."""
    arrays: list[np.ndarray] = []
    root = Sequence(arrays)
    root.append(value)
    batch = Batch()
    root.write(batch)
    out = bytearray(struct.pack("<4i", 0, len(arrays), 0, 0))
    schema = {0: ("h", 3), 1: ("B", SCHEMA_MESSAGE), 2: {1: [root.field("list")]}}
    out += message(schema, 8)
    nodes = Numbers("qq", batch.nodes)
    buffers = Numbers("qq", batch.buffers)
    content = {0: ("q", 1), 1: nodes, 2: buffers}
    body = {3: ("q", len(batch.body))}
    out += message({0: ("h", 3), 1: ("B", BATCH_MESSAGE), 2: content} | body, 8) + batch.body
    out += bytes(4)
    pad(out, 64)
    for array in arrays:
        out += tensor(array)
        pad(out, 64)
    return bytes(out)


class Batch:
    """Nodes, buffers and body of the record batch, as columns are written."""

    def __init__(self):
        self.nodes, self.buffers, self.body = [], [], bytearray()

    def add(self, *buffers, rows, nulls=0):
        self.nodes += [rows, nulls]
        for buffer in buffers:
            start = len(self.body)
            self.body += bytes(buffer)
            pad(self.body, 8)
            self.buffers += [start, len(self.body) - start]


class Sequence:
    """A dense union of the values of one sequence, or of all sequences of one level."""

    def __init__(self, arrays):
        self.arrays = arrays
        self.present, self.types, self.offsets = [], [], []
        self.columns = {}

    def append(self, value):
        self.present.append(value is not None)
        if value is None:
            self.types.append(0)
            self.offsets.append(0)
            return
        tag = INT if isinstance(value, np.integer) else TAGS[type(value)]
        column = self.columns.get(tag)
        if column is None:
            column = self.columns[tag] = Container(tag, self.arrays) if tag in CONTAINERS else []
        self.types.append(list(self.columns).index(tag))
        self.offsets.append(len(column))
        if tag == ARRAY:
            self.arrays.append(value)
            value = len(self.arrays) - 1
        column.append(value)

    def __len__(self):
        return len(self.types)

    def field(self, name):
        children = [
            column.field(tag) if tag in CONTAINERS else leaf_field(tag)
            for tag, column in self.columns.items()
        ]
        union = {0: ("h", 1), 1: Numbers("i", range(len(children)))}
        return field(name, UNION_TYPE, union, children)

    def write(self, batch):
        nulls = self.present.count(False)
        bitmap = np.packbits(self.present, bitorder="little") if nulls else b""
        types, offsets = np.array(self.types, "i1"), np.array(self.offsets, "<i4")
        batch.add(bitmap, types, offsets, rows=len(self), nulls=nulls)
        for tag, column in self.columns.items():
            column.write(batch) if tag in CONTAINERS else write_leaf(batch, tag, column)


class Container:
    """All lists, dicts, tuples or sets of one sequence."""

    def __init__(self, tag, arrays):
        self.tag = tag
        self.edges = [0]
        self.parts = [Sequence(arrays) for _ in range(2 if tag == DICT else 1)]

    def append(self, value):
        if self.tag == DICT:
            # pyarrow wrote a dict's keys and values pair by pair, so arrays keep their order
            for pair in value.items():
                for part, item in zip(self.parts, pair, strict=True):
                    part.append(item)
        else:
            for item in value:
                self.parts[0].append(item)
        self.edges.append(self.edges[-1] + len(value))

    def __len__(self):
        return len(self.edges) - 1

    def field(self, tag):
        if tag == DICT:
            item = field("item", STRUCT_TYPE, {}, [part.field("") for part in self.parts])
        else:
            item = self.parts[0].field("item")
        return field(str(tag), LIST_TYPE, {}, [item])

    def write(self, batch):
        batch.add(b"", np.array(self.edges, "<i4"), rows=len(self))
        if self.tag == DICT:
            batch.add(b"", rows=self.edges[-1])
        for part in self.parts:
            part.write(batch)


def leaf_field(tag):
    if tag in (INT, ARRAY):
        width = {0: ("i", 64 if tag == INT else 32), 1: ("?", True)}
        return field(str(tag), INT_TYPE, width, [])
    if tag in (FLOAT16, FLOAT32, FLOAT64):
        return field(str(tag), FLOAT_TYPE, {0: ("h", tag - FLOAT16)}, [])
    return field(str(tag), TYPES[tag], {0: ("h", 1)} if tag == DATETIME else {}, [])


def write_leaf(batch, tag, values):
    rows = len(values)
    if tag in (STR, BYTES):
        texts = [text if tag == BYTES else text.encode() for text in values]
        edges = np.cumsum([0, *map(len, texts)], dtype="<i4")
        batch.add(b"", edges, b"".join(texts), rows=rows)
        return
    if tag == BOOL:
        numbers = np.packbits(values, bitorder="little")
    elif tag == DATETIME:
        numbers = np.array([(time - EPOCH) // timedelta(microseconds=1) for time in values], "<i8")
    else:
        dtype = {INT: "<i8", ARRAY: "<i4", FLOAT16: "<f2", FLOAT32: "<f4", FLOAT64: "<f8"}[tag]
        numbers = np.array(values, dtype)
    batch.add(b"", numbers, rows=rows)


def tensor(array):
    """A tensor message; only layouts without gaps keep their strides."""
    if not (array.flags.c_contiguous or array.flags.f_contiguous):
        array = np.ascontiguousarray(array)
    strides = array.strides if array.size else (array.itemsize,) * array.ndim
    return message(tensor_fields(array.dtype, array.shape, strides), 64) + array.tobytes("A")


def tensor_fields(dtype, shape, strides, size_bytes=None):
    """A tensor message's table; the body has as many bytes as the shape needs, or as told."""
    dtype = np.dtype(dtype)
    if size_bytes is None:
        size_bytes = int(np.prod(shape)) * dtype.itemsize
    if dtype.kind == "f":
        kind, type_ = FLOAT_TYPE, {0: ("h", {2: 0, 4: 1, 8: 2}[dtype.itemsize])}
    else:
        kind, type_ = INT_TYPE, {0: ("i", 8 * dtype.itemsize), 1: ("?", dtype.kind == "i")}
    content = {
        0: ("B", kind),
        1: type_,
        2: [{0: ("q", size)} for size in shape],
        3: Numbers("q", strides),
        4: Inline("qq", (0, size_bytes)),
    }
    return {0: ("h", 3), 1: ("B", TENSOR_MESSAGE), 2: content, 3: ("q", size_bytes)}


def field(name, kind, type_, children):
    return {0: name, 1: ("?", True), 2: ("B", kind), 3: type_, 5: children}


def message(fields, alignment):
    """A message's length and metadata, so that its body is aligned."""
    metadata = flatbuffer(fields)
    metadata += bytes(-(4 + len(metadata)) % alignment)
    return struct.pack("<i", len(metadata)) + metadata
