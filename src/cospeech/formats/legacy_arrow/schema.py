"""The schema message: which Python types a value holds, as a tree.

Every sequence of Python values is a dense union with one member per Python type, named by the
type's tag; lists, dicts, tuples and sets hold further unions (sections 4 and 5 of the format's
description).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from cospeech.formats.legacy_arrow.errors import HINT_REBUILD, LegacyArrowError
from cospeech.formats.legacy_arrow.flatbuffer import BOOL, INT16, INT32, UINT8, Table

V4, V5 = 3, 4
"""Metadata versions: of pyarrow 0.13 to 0.17, and of 1.0 and later."""
SCHEMA_MESSAGE = 1
MAX_LEVELS = 100
"""Arrow levels read; the writer gave up beyond 64."""
MAX_SCHEMA_BYTES = 2**20
"""The schema grows with the variety of the data, not with its amount; those of TED have 5 KB."""
_BYTES_PER_FIELD = 16
"""No field was ever described in fewer; a damaged schema that reuses fields stops here."""


class Tag(IntEnum):
    """Python types as pyarrow 0.13 to 0.17 numbered them; from 1.0 on, one higher."""

    NONE = -1
    BOOL = 0
    INT = 1
    PYTHON2_INT = 2
    BYTES = 3
    STR = 4
    FLOAT16 = 5
    FLOAT32 = 6
    FLOAT64 = 7
    DATETIME = 8
    LIST = 9
    DICT = 10
    TUPLE = 11
    SET = 12
    TENSOR = 13
    ARRAY = 14
    BUFFER = 15


class _Kind(IntEnum):
    NULL = 1
    INT = 2
    FLOAT = 3
    BINARY = 4
    UTF8 = 5
    BOOL = 6
    DATE = 8
    LIST = 12
    STRUCT = 13
    UNION = 14


_SIGNED_INT = {Tag.INT: 64, Tag.PYTHON2_INT: 64, Tag.TENSOR: 32, Tag.ARRAY: 32, Tag.BUFFER: 32}
_FLOAT_PRECISION = {Tag.FLOAT16: 0, Tag.FLOAT32: 1, Tag.FLOAT64: 2}
_KINDS = (
    dict.fromkeys(_SIGNED_INT, _Kind.INT)
    | dict.fromkeys(_FLOAT_PRECISION, _Kind.FLOAT)
    | dict.fromkeys((Tag.LIST, Tag.DICT, Tag.TUPLE, Tag.SET), _Kind.LIST)
    | {
        Tag.NONE: _Kind.NULL,
        Tag.BOOL: _Kind.BOOL,
        Tag.BYTES: _Kind.BINARY,
        Tag.STR: _Kind.UTF8,
        Tag.DATETIME: _Kind.DATE,
    }
)
_BUFFERS = {_Kind.NULL: 0, _Kind.BINARY: 3, _Kind.UTF8: 3}


@dataclass(frozen=True, slots=True)
class Member:
    """All values of one Python type in a sequence.

    Attributes:
        tag: The type.
        parts: What a container holds: the items' union, or for dicts keys' and values'.
    """

    tag: Tag
    parts: tuple[Union, ...] = ()


@dataclass(frozen=True, slots=True)
class Union:
    """A sequence of Python values.

    Attributes:
        members: By type, in order of first appearance.
    """

    members: tuple[Member, ...]


@dataclass(frozen=True, slots=True)
class Schema:
    """A parsed schema message.

    Attributes:
        version: `V4` or `V5`.
        root: The one-row sequence that holds the value.
        node_count: Nodes that the record batch must have.
        buffer_count: Buffers that it must have.
        array_nodes: Which of the nodes count numpy arrays.
    """

    version: int
    root: Union
    node_count: int
    buffer_count: int
    array_nodes: tuple[int, ...]


def parse_schema(metadata: bytes) -> Schema:
    """Read a schema message's metadata, without its length prefix.

    Raises:
        LegacyArrowError: It is damaged, or was written by pyarrow 0.12 or older, or holds types
            that aren't read. The offset counts from the start of the metadata.
    """
    if len(metadata) > MAX_SCHEMA_BYTES:
        raise LegacyArrowError(f"a schema of {len(metadata)} bytes isn't read", 0)
    message = Table.root(metadata)
    version = message.number(0, INT16)
    if message.number(1, UINT8) != SCHEMA_MESSAGE:
        raise LegacyArrowError("the first message isn't a schema", message.at)
    if version not in (V4, V5):
        raise LegacyArrowError(f"metadata version {version} isn't known", message.at)
    schema = message.table(2)
    if schema.number(0, INT16) != 0:
        raise LegacyArrowError("big-endian values aren't read", schema.at)
    _, columns = schema.vector(1, 4)
    field = next(schema.tables(1), None)
    if field is None or columns != 1 or field.string(0) != "list":
        raise LegacyArrowError("the schema isn't one column called 'list'", schema.at)
    return _SchemaReader(version, len(metadata) // _BYTES_PER_FIELD).read(field)


class _SchemaReader:
    def __init__(self, version: int, max_fields: int) -> None:
        self.version = version
        self.max_fields = max_fields
        self.nodes = 0
        self.buffers = 0
        self.array_nodes: list[int] = []

    def read(self, field: Table) -> Schema:
        root = self._union(field, 0)
        return Schema(self.version, root, self.nodes, self.buffers, tuple(self.array_nodes))

    def _enter(self, field: Table, kind: _Kind, level: int) -> None:
        """Check the type of a field, and count its node and buffers in depth-first order."""
        if field.number(2, UINT8) != kind:
            found = field.number(2, UINT8)
            raise LegacyArrowError(f"a column has type {found} instead of {kind:d}", field.at)
        if self.nodes >= self.max_fields:
            raise LegacyArrowError("fields of the schema are used more than once", field.at)
        if level > MAX_LEVELS:
            raise LegacyArrowError(f"nested deeper than {MAX_LEVELS} levels", field.at)
        self.nodes += 1
        if kind is _Kind.UNION:
            self.buffers += 3 if self.version == V4 else 2
        elif kind is _Kind.STRUCT:
            self.buffers += 1
        else:
            self.buffers += _BUFFERS.get(kind, 2)

    def _union(self, field: Table, level: int) -> Union:
        self._enter(field, _Kind.UNION, level)
        union = field.table(3)
        if union.number(0, INT16) != 1:
            raise LegacyArrowError("a union isn't dense", union.at)
        members: list[Member] = []
        for child in field.tables(5):
            member = self._member(child, level + 1)
            if any(member.tag is other.tag for other in members):
                raise LegacyArrowError(f"type {member.tag.name} occurs twice", child.at)
            members.append(member)
        codes = tuple(range(len(members)))
        # counted first: a damaged schema may have thousands of unions share one long list
        if union.vector(1, 4)[1] != len(codes) or union.numbers(1, "i") != codes:
            raise LegacyArrowError("a union's type codes aren't 0, 1, 2, ...", union.at)
        return Union(tuple(members))

    def _member(self, field: Table, level: int) -> Member:
        tag = self._tag(field)
        kind = _KINDS[tag]
        if tag is Tag.ARRAY:
            self.array_nodes.append(self.nodes)
        self._enter(field, kind, level)
        if kind is _Kind.LIST:
            item = self._children(field, 1)[0]
            if tag is not Tag.DICT:
                return Member(tag, (self._union(item, level + 1),))
            self._enter(item, _Kind.STRUCT, level + 1)
            keys, values = self._children(item, 2)
            return Member(tag, (self._union(keys, level + 2), self._union(values, level + 2)))
        if kind is _Kind.INT:
            type_ = field.table(3)
            if type_.number(0, INT32) != _SIGNED_INT[tag] or not type_.number(1, BOOL):
                raise LegacyArrowError(f"integers of type {tag.name} have another width", type_.at)
        if kind is _Kind.FLOAT and field.table(3).number(0, INT16) != _FLOAT_PRECISION[tag]:
            raise LegacyArrowError(f"numbers of type {tag.name} have another width", field.at)
        return Member(tag)

    def _children(self, field: Table, count: int) -> list[Table]:
        if field.vector(5, 4)[1] != count:
            raise LegacyArrowError(f"a container doesn't have {count} columns", field.at)
        return list(field.tables(5))

    def _tag(self, field: Table) -> Tag:
        name = field.string(0)
        if not (name.isascii() and name.isdigit() and len(name) <= 3):
            raise LegacyArrowError(
                f"a column is called {name!r} instead of by a number, as pyarrow 0.12 and older"
                " wrote it",
                field.at,
                HINT_REBUILD,
            )
        number = int(name) - (self.version == V5)
        try:
            return Tag(number)
        except ValueError:
            raise LegacyArrowError(
                f"it holds values of type {number} (sparse tensors, or unknown), which aren't read",
                field.at,
            ) from None
