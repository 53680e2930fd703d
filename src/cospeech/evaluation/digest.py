"""What the values of a metric depend on besides the windows, as a hash."""

from __future__ import annotations

import hashlib
import inspect
import json
import sys
from collections.abc import Iterator, Mapping
from functools import partial
from types import FunctionType, ModuleType
from typing import Any

import numpy as np
from torch import Tensor

from cospeech.metrics.window_metric import WindowMetric

_DEEPEST = 8


def digest_of(metrics: Mapping[str, WindowMetric]) -> str:
    """Changes with the metrics' names, their settings and the code that defines them."""
    said = [
        [name, type(metric).__qualname__, _settings(metric), sources_of(type(metric))]
        for name, metric in metrics.items()
    ]
    return hashlib.sha256(json.dumps(said).encode()).hexdigest()


def sources_of(kind: type) -> list[str]:
    """Hashes of the files that a class is made of, in order of their modules' names.

    They are those of its bases, and of what these take from modules of the same packages.
    """
    left = [base.__module__ for base in kind.__mro__ if issubclass(base, WindowMetric)]
    packages = {name.partition(".")[0] for name in left}
    seen = set[str]()
    while left:
        name = left.pop()
        if name in seen or name.partition(".")[0] not in packages or name not in sys.modules:
            continue
        seen.add(name)
        left += _modules_used(sys.modules[name])
    return [_source(sys.modules[name]) for name in sorted(seen)]


def _modules_used(module: ModuleType) -> Iterator[str]:
    for value in list(vars(module).values()):
        if isinstance(value, ModuleType):
            yield value.__name__
        elif isinstance(name := getattr(value, "__module__", None), str):
            yield name


def _source(module: ModuleType) -> str:
    try:
        text = inspect.getsource(module)
    except (OSError, TypeError):  # typed into an interpreter
        text = module.__name__
    return hashlib.sha256(text.encode()).hexdigest()


def _settings(metric: WindowMetric) -> Any:
    usual = vars(WindowMetric())
    own = {key: value for key, value in vars(metric).items() if key not in usual}
    tensors = dict(metric.named_buffers()) | dict(metric.named_parameters())
    modules = {name: repr(module) for name, module in metric.named_children()}
    return _plain({"own": own, "tensors": tensors, "modules": modules})


def _plain(value: Any, depth: int = 0) -> Any:
    """A value as JSON can hold it: equal for equal values, and for no others."""
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, Tensor):
        value = value.detach().cpu().numpy()
    if isinstance(value, np.ndarray):
        hashed = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
        return [str(value.dtype), list(value.shape), hashed]
    if isinstance(value, np.generic):
        return value.item()
    if depth == _DEEPEST:
        return repr(value)
    if isinstance(value, Mapping):
        return [[str(key), _plain(value[key], depth + 1)] for key in sorted(value, key=str)]
    if isinstance(value, (list, tuple)):
        return [_plain(item, depth + 1) for item in value]
    if isinstance(value, (set, frozenset)):
        return sorted(json.dumps(_plain(item, depth + 1)) for item in value)
    if isinstance(value, partial):
        return _plain([value.func, value.args, value.keywords], depth + 1)
    if isinstance(value, (type, FunctionType)):
        return f"{value.__module__}.{value.__qualname__}"
    if hasattr(value, "__dict__") and type(value).__repr__ is object.__repr__:
        return [type(value).__qualname__, _plain(vars(value), depth + 1)]
    return [type(value).__qualname__, repr(value)]
