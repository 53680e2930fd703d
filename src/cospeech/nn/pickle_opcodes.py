"""What the loading of a pickle would do, found without doing it: names, storages and its cost."""

from __future__ import annotations

import pickletools
from _compat_pickle import IMPORT_MAPPING, NAME_MAPPING
from collections.abc import Collection
from dataclasses import dataclass
from typing import IO, Any, NamedTuple

MOST_BYTES = 16 * 2**20
MOST_OPCODES = 500_000
"""A tensor takes some thirty."""

MOST_OBJECTS = 200_000
"""Containers and whatever is made by a call; a tensor takes six."""

MOST_ODD_KEYS = 1_000
"""Keys that are no texts or small integers: their hashes can be chosen to collide."""

MOST_WORK = 10_000_000
"""Entries that are hashed, copied or given to a call, where shared ones count each time."""


class Claim(NamedTuple):
    """A storage that a pickle refers to.

    Attributes:
        kind: Its class, as ``module.name``.
        key: Its name in the file.
        numbers: How many it holds.
    """

    kind: str
    key: str
    numbers: int


@dataclass(slots=True, eq=False)
class _Value:
    """What stands on the loader's stack: how many values it unfolds to, shared ones each time."""

    kind: str
    size: int = 1
    content: Any = None
    is_held: bool = False


_LEAVES = {
    "NONE": "none",
    "NEWTRUE": "bool",
    "NEWFALSE": "bool",
    "BININT": "int",
    "BININT1": "int",
    "BININT2": "int",
    "LONG1": "long",
    "BINFLOAT": "float",
    "BINUNICODE": "text",
    "SHORT_BINSTRING": "text",
}
_CONTAINERS = {"EMPTY_TUPLE": "tuple", "EMPTY_LIST": "list", "EMPTY_DICT": "dict"}
_TUPLES = {"TUPLE1": 1, "TUPLE2": 2, "TUPLE3": 3}
_ORDERED = "collections.OrderedDict"
_LONGEST_KEPT = 10  # entries of a storage's tuple, with room


class Walk:
    """One pickle, up to its end; the bytes after it are left.

    Args:
        file: Where it begins.
        dictionaries: Names of classes that are read as if they were ordered dictionaries.

    Attributes:
        names: Classes and functions that it refers to.
        claims: Storages that it refers to.

    Raises:
        ValueError: Its loading would take time or memory out of all proportion, or it does what
            no file of tensors does.
    """

    def __init__(self, file: IO[bytes], dictionaries: Collection[str] = ()) -> None:
        self._dictionaries = {_ORDERED, *dictionaries}
        self.names: set[str] = set()
        self.claims: list[Claim] = []
        self._stack: list[_Value] = []
        self._below: list[list[_Value]] = []
        self._memo: dict[int, _Value] = {}
        self._objects = self._work = self._odd_keys = 0
        for count, (opcode, argument, place) in enumerate(pickletools.genops(file)):
            if count == MOST_OPCODES or (place or 0) > MOST_BYTES:
                raise ValueError("it has far more values than networks have")
            self._step(opcode.name, argument)

    def _step(self, name: str, argument: Any) -> None:
        if (kind := _LEAVES.get(name)) is not None:
            self._stack.append(_Value(kind, content=argument))
        elif name in ("BINPUT", "LONG_BINPUT"):
            self._memo[argument] = self._stack[-1]
        elif name in ("BINGET", "LONG_BINGET"):
            self._stack.append(self._memo[argument])
        elif (kind := _CONTAINERS.get(name)) is not None:
            self._made(_Value(kind, content=()))
        elif name == "MARK":
            self._below.append(self._stack)
            self._stack = []
        elif name == "TUPLE":
            self._tuple(self._since_mark())
        elif (count := _TUPLES.get(name)) is not None:
            self._tuple([self._stack.pop() for _ in range(count)][::-1])
        elif name == "APPEND":
            self._put([self._stack.pop()], "list")
        elif name == "APPENDS":
            self._put(self._since_mark(), "list")
        elif name == "SETITEM":
            self._put_pairs([self._stack.pop(), self._stack.pop()][::-1])
        elif name == "SETITEMS":
            self._put_pairs(self._since_mark())
        elif name == "GLOBAL":
            self._global(argument)
        elif name in ("REDUCE", "NEWOBJ"):
            self._call(self._stack.pop(), self._stack.pop())
        elif name == "BUILD":
            self._build(self._stack.pop())
        elif name == "BINPERSID":
            self._storage(self._stack.pop())
        elif name not in ("PROTO", "STOP"):
            raise ValueError(f"it has the opcode {name}")

    def _since_mark(self) -> list[_Value]:
        values, self._stack = self._stack, self._below.pop()
        return values

    def _made(self, value: _Value) -> None:
        self._objects += 1
        if self._objects > MOST_OBJECTS:
            raise ValueError("it has far more values than networks have")
        self._stack.append(value)

    def _does(self, work: int) -> None:
        self._work += work
        if self._work > MOST_WORK:
            raise ValueError("its values refer to one another too often")

    def _hold(self, values: list[_Value]) -> int:
        """How many values they unfold to; none may grow any more."""
        size = 0
        for value in values:
            value.is_held = True
            size += value.size
        return size

    def _tuple(self, values: list[_Value]) -> None:
        size = 1 + self._hold(values)
        self._does(size)
        kept = tuple(values) if len(values) <= _LONGEST_KEPT else ()
        self._made(_Value("tuple", size, kept))

    def _put(self, values: list[_Value], kind: str) -> None:
        target = self._stack[-1]
        if target.kind != kind:
            raise ValueError(f"it puts values into a {target.kind}")
        if target.is_held:
            raise ValueError("its values refer to one another in a circle")
        target.size += self._hold(values)
        if target.size > MOST_WORK:
            raise ValueError("its values refer to one another too often")

    def _put_pairs(self, values: list[_Value]) -> None:
        for key in values[::2]:
            if key.kind not in ("text", "int"):
                self._odd_keys += 1
                self._does(key.size)
                if self._odd_keys > MOST_ODD_KEYS:
                    raise ValueError("far too many of its keys are no texts")
        self._put(values, "dict")

    def _global(self, argument: Any) -> None:
        module, _, name = str(argument).partition(" ")
        module, name = NAME_MAPPING.get((module, name), (IMPORT_MAPPING.get(module, module), name))
        self.names.add(f"{module}.{name}")
        self._stack.append(_Value("name", content=f"{module}.{name}"))

    def _call(self, arguments: _Value, called: _Value) -> None:
        if called.kind != "name" or arguments.kind != "tuple":
            raise ValueError("it calls what is no function")
        size = 1 + self._hold([arguments])
        self._does(size)
        if called.content not in self._dictionaries:
            kind = "tuple" if called.content == "torch.Size" else "object"
            self._made(_Value(kind, size, ()))
        elif arguments.size > 1:  # whose keys no opcode would name
            raise ValueError("it makes a dictionary in an unusual way")
        else:
            self._made(_Value("dict"))

    def _build(self, state: _Value) -> None:
        # Whatever becomes of it: its entries are gone through once.
        self._does(1 + self._hold([state]))
        target = self._stack[-1]
        if target.kind == "dict" and state.kind != "dict":
            raise ValueError("it gives a dictionary attributes that are none")
        target.size += state.size

    def _storage(self, value: _Value) -> None:
        parts = value.content if value.kind == "tuple" else ()
        kinds = [part.kind for part in parts[1:5]]
        if kinds[:3] != ["name", "text", "text"] or kinds[3:] not in (["int"], ["long"]):
            raise ValueError("it refers to a storage in an unusual way")
        kind, key, device, count = (part.content for part in parts[1:5])
        if device.partition(":")[0] not in ("cpu", "cuda", "mps", "xpu"):
            raise ValueError(f"it has a storage on {device[:20]!r}")
        self.claims.append(Claim(kind, key, count))
        self._made(_Value("object"))
