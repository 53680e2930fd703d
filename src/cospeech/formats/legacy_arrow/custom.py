"""Values that pyarrow's Python side turned into a dict marked with their type.

Only the types below come back. Anything pickled is refused: these files come from the internet.
"""

from __future__ import annotations

import re
from collections import Counter, OrderedDict, defaultdict, deque
from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import Any

import numpy as np

MARK = "_pytype_"
MAX_EQUAL_HASHES = 100
MAX_NAME_LENGTH = 200

_DECIMAL = re.compile(r"-?[0-9]{1,4000}", re.ASCII)
_DTYPE = re.compile(
    r"\|b1|\|S\d{1,9}|[<>]U\d{1,9}|[<>|]([iuf]\d|f16|c\d\d?)|[<>][mM]8\[[a-zA-Z]+\]"
)


def check_hashes(keys: Iterable[Hashable]) -> None:
    """Refuse keys chosen so that a dict or set of them would take hours to build.

    Python's own protection, a random seed in the hash of text, doesn't cover tuples of numbers.

    Raises:
        ValueError: More than `MAX_EQUAL_HASHES` keys have one hash.
        TypeError: A key can't be hashed.
    """
    counts = Counter(map(hash, keys))
    if counts and max(counts.values()) > MAX_EQUAL_HASHES:
        raise ValueError("a dict's keys or a set's items collide")


def restore(marked: dict[Any, Any]) -> object:
    """The value that a dict with `MARK` stands for.

    Raises:
        ValueError: It is pickled, of another type than those known, or damaged.
    """
    name = marked[MARK]
    if not isinstance(name, str) or len(name) > MAX_NAME_LENGTH:
        raise ValueError("a custom type's name isn't a short text")
    if "pickle" in marked:
        raise ValueError(f"a value of type {name!r} is pickled, which is never read")
    reader = _READERS.get(name)
    if reader is None:
        raise ValueError(f"values of type {name!r} aren't read")
    if marked.keys() != {MARK, "data"}:
        raise ValueError(f"a value of type {name!r} has other parts than its data")
    return reader(marked["data"])


def _integer(data: object) -> int:
    if not isinstance(data, str) or not _DECIMAL.fullmatch(data):
        raise ValueError("a large integer isn't written in decimal digits")
    return int(data)


def _array(data: object) -> np.ndarray:
    match data:
        case (np.ndarray() as raw, str(name)) if raw.dtype == np.uint8 and _DTYPE.fullmatch(name):
            try:
                return raw.view(np.dtype(name))
            except TypeError as error:
                raise ValueError(f"an array can't be seen as {name}: {error}") from None
        case (list(items), "|O") if not _holds_array(items):
            return np.array(items, dtype=object)
    raise ValueError("an array of an unusual type is damaged, or of a type that isn't read")


def _holds_array(items: Sequence[Any]) -> bool:
    """Whether numpy would take an array apart into one Python object per number."""
    return any(
        _holds_array(item)
        if isinstance(item, list | tuple)
        else isinstance(item, np.ndarray | deque)
        for item in items
    )


def _pairs(data: object, parts: int) -> list[tuple[Any, Any]]:
    match data:
        case (list(keys), list(values), *rest) if len(rest) == parts - 2 and not any(rest):
            if len(keys) == len(values):
                check_hashes(keys)
                return list(zip(keys, values, strict=True))
    raise ValueError("a dict-like value doesn't consist of keys and values")


def _counter(data: object) -> Counter:
    return Counter(dict(_pairs(data, 2)))


def _default_dict(data: object) -> defaultdict:
    return defaultdict(None, _pairs(data, 3))


def _deque(data: object) -> deque:
    if not isinstance(data, list):
        raise ValueError("a deque's data isn't a list")
    return deque(data)


_READERS: dict[str, Callable[[object], object]] = {
    "int": _integer,
    "np.array": _array,
    "np.matrix": _array,
    "collections.OrderedDict": lambda data: OrderedDict(_pairs(data, 2)),
    "collections.Counter": _counter,
    "collections.defaultdict": _default_dict,
    "collections.deque": _deque,
}
