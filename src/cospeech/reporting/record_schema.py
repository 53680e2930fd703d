"""The shape of a `record.json`: which key holds what. Records come from anywhere."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from typing import Any

from cospeech.errors import one_line

_LONGEST_TEXT = 1000
_LONGEST_KEY = 200
_LONGEST_NAME = 255  # as of a file
_LARGEST = 1e100
"""Nothing that a run measures is larger, and sums and squares of smaller numbers are finite."""

_MOST_EPOCHS = 10**9
_DEEPEST = 40
_MOST_SETTINGS = 10_000
_MOST_NAMED = 3

Check = Callable[[Any, str], Iterator[str]]
"""Yields what is wrong with a value, given the value and its place."""


def record_problems(values: Any) -> list[str]:
    """What is wrong with a record's shape, each with its key; empty where it can be relied on.

    Three are named at most. Every key may be absent or null; keys that are not known here may hold
    anything.
    """
    if not isinstance(values, Mapping):
        return [f"holds {_kind(values)}, not an object"]
    problems = (
        problem
        for key, check in _SHAPE.items()
        if values.get(key) is not None
        for problem in check(values[key], key)
    )
    return list(islice(problems, _MOST_NAMED))


def _kind(value: Any) -> str:
    if value is None:
        return "nothing"
    kinds = ((bool, "true or false"), (str, "a text"), (int | float, "a number"), (list, "a list"))
    return next((name for kind, name in kinds if isinstance(value, kind)), "an object")


def _text(value: Any, place: str) -> Iterator[str]:
    if not isinstance(value, str):
        yield f"{place} is {_kind(value)}, not a text"
    elif len(value) > _LONGEST_TEXT:
        yield f"{place} has {len(value)} characters"


def _name(value: Any, place: str) -> Iterator[str]:
    """A line that a terminal shows and doesn't obey."""
    if not isinstance(value, str):
        yield f"{place} is {_kind(value)}, not a text"
    elif len(value) > _LONGEST_NAME or one_line(value) != value:
        yield f"{place} is no name"


def _long_text(value: Any, place: str) -> Iterator[str]:
    if not isinstance(value, str):
        yield f"{place} is {_kind(value)}, not a text"


def _flag(value: Any, place: str) -> Iterator[str]:
    if not isinstance(value, bool):
        yield f"{place} is {_kind(value)}, not true or false"


def _number(value: Any, place: str) -> Iterator[str]:
    if value is None:
        return
    if isinstance(value, bool) or not isinstance(value, int | float):
        yield f"{place} is {_kind(value)}, not a number"
    elif abs(value) > _LARGEST and not (isinstance(value, float) and math.isinf(value)):
        yield f"{place} is {value:.1e}, too large to be measured"


def _whole(value: Any, place: str) -> Iterator[str]:
    if isinstance(value, bool) or not isinstance(value, int):
        yield f"{place} is {_kind(value)}, not a whole number"


def _epoch(value: Any, place: str) -> Iterator[str]:
    wrong = list(_whole(value, place))
    yield from wrong
    if not wrong and not 0 <= value < _MOST_EPOCHS:
        yield f"{place} is {value}, no number of an epoch"


def _anything(value: Any, place: str) -> Iterator[str]:
    yield from ()


def _direction(value: Any, place: str) -> Iterator[str]:
    if value not in ("lower", "higher"):
        yield f"{place} is neither lower nor higher"


def _list_of(check: Check) -> Check:
    def checked(value: Any, place: str) -> Iterator[str]:
        if not isinstance(value, list):
            yield f"{place} is {_kind(value)}, not a list"
            return
        for i, item in enumerate(value):
            yield from check(item, f"{place}[{i}]")

    return checked


def _object_of(known: Mapping[str, Check], other: Check, needed: str | None = None) -> Check:
    """An object whose ``known`` keys are checked by their own, all others by another."""

    def checked(value: Any, place: str) -> Iterator[str]:
        if not isinstance(value, Mapping):
            yield f"{place} is {_kind(value)}, not an object"
            return
        if needed is not None and needed not in value:
            yield f"{place} has no {needed!r}"
        for key, item in value.items():
            if len(key) > _LONGEST_KEY:
                yield f"{place} has a key of {len(key)} characters"
            elif item is not None or key == needed:
                yield from known.get(key, other)(item, f"{place}.{key}")

    return checked


def _settings(*objects: str) -> Check:
    """An object of plain values, neither deep nor endless; those of these names are objects."""
    check = _object_of(dict.fromkeys(objects, _OBJECT), _anything)

    def checked(value: Any, place: str) -> Iterator[str]:
        yield from check(value, place)
        left: list[tuple[Any, int]] = [(value, 0)]
        seen = 0
        while left:
            item, depth = left.pop()
            seen += 1
            if depth > _DEEPEST or seen > _MOST_SETTINGS:
                yield f"{place} is nested too deep or has too many values for a config"
                return
            if isinstance(item, Mapping):
                if any(len(key) > _LONGEST_KEY for key in item):
                    yield f"{place} has a key of over {_LONGEST_KEY} characters"
                    return
                left += [(inner, depth + 1) for inner in item.values()]
            elif isinstance(item, list):
                left += [(inner, depth + 1) for inner in item]

    return checked


_OBJECT = _object_of({}, _anything)
_NUMBERS = _object_of({}, _number)
_SHAPE: dict[str, Check] = {
    "schema": _whole,
    "id": _name,
    "status": _name,
    "model": _name,
    "data": _name,
    "ablation": _name,
    "seed": _whole,
    "identity": _text,
    "started": _text,
    "finished": _text,
    "config": _settings("model", "data", "metrics", "training", "choices"),
    "commit": _text,
    "dirty": _flag,
    "versions": _object_of({}, _text),
    "hardware": _settings(),
    "data_fingerprint": _name,
    "encoder": _object_of({"sha256": _text, "name": _text}, _anything),
    "metrics": _list_of(
        _object_of({"key": _name, "title": _name, "better": _direction}, _anything, needed="key")
    ),
    "timings": _NUMBERS,
    "epochs": _list_of(_object_of({"epoch": _epoch}, _number, needed="epoch")),
    # epochs: those that the settings asked for (-1: as many as the method takes), and those it took
    "fit": _object_of({"asked": _whole, "ended": _epoch}, _anything, needed="ended"),
    "final": _object_of({"split": _text, "windows": _NUMBERS, "recordings": _NUMBERS}, _anything),
    "references": _object_of({}, _NUMBERS),
    "samples": _list_of(_text),
    "objective": _number,
    "error": _long_text,
}
