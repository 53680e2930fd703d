"""Whether the settings of a config are such that something can be made of them."""

from __future__ import annotations

import inspect
import re
import types
import typing
from collections.abc import Iterator, Mapping
from typing import Any

from hydra._internal.utils import _locate  # get_object logs each failure as an error
from omegaconf import DictConfig, ListConfig, OmegaConf

from cospeech.errors import ConfigError
from cospeech.experiment.plain_arguments import fits
from cospeech.quoting import setting
from cospeech.suggestions import did_you_mean

_OF_HYDRA = ("_target_", "_partial_", "_recursive_", "_convert_", "_args_")
_OURS = ("cospeech.", "data_modules.", "callbacks.")
_ANOTHER_KEY = re.compile(r"\$\{([\w.]+)\}")
_AT_LEAST_ONE = re.compile(r"(?:size|width|layers|encoder_epochs)$")
_LEAST = {"training.epochs": -1}
"""Whole numbers of ours that may be negative; the others count or seed something."""

_WORDS = {int: "a whole number", float: "a number", bool: "true or false", str: "a text"}


def known_arguments(target: str) -> list[str] | None:
    """Names that a class or function takes; None where it takes any, or doesn't say.

    Raises:
        ConfigError: There is no such class or function.
    """
    parameters = _parameters(target)
    return None if parameters is None else list(parameters)


def refuse_unknown_settings(cfg: DictConfig) -> None:
    """Compare every object of a config with its constructor's arguments; nothing is constructed.

    Values are compared with the types that our own constructors declare.

    Raises:
        ConfigError: A setting that isn't an argument, with the nearest one; or a text in the place
            of a number and the like.
    """
    for path, node in _objects(cfg, ""):
        target = str(node["_target_"])
        known = _parameters(target)
        if known is None:
            continue
        for key in node:
            name = str(key)
            if name in _OF_HYDRA:
                continue
            if name not in known:
                raise ConfigError(
                    f"{path}.{name}: {target.rpartition('.')[2]} has no such setting"
                    + did_you_mean(name, known),
                    f"{path} knows: {', '.join(sorted(known))}",
                )
            if target.startswith(_OURS):
                value, annotation = node._get_node(key), known[name].annotation
                _refuse_other_type(f"{path}.{name}", value, annotation)
                if annotation in (int, int | None):
                    _refuse_too_small(f"{path}.{name}", value)


def refuse_wrong_values(cfg: DictConfig, usual: DictConfig) -> None:
    """Check the values that are no constructor's argument: ``seed``, ``training``, ``metrics``.

    Args:
        cfg: What is to be checked.
        usual: The same without the values that were typed: those of the yaml files, whose types
            are wanted. What is null or missing there is wanted as a text.

    Raises:
        ConfigError: A value of another type, an empty text, or a number that is too small.
    """
    for path, node in _plain_values(cfg, ""):
        default = _usual_node(usual, path)
        if default is None or default._is_interpolation() or not hasattr(default, "_value"):
            kind: Any = int if path in _LEAST else None
        elif default._is_none() or default._is_missing():
            kind = str | None
        else:
            kind = type(default._value())
        if kind is None or node._is_interpolation() or node._is_missing():
            continue
        _refuse_other_type(path, node, kind)
        if node._value() == "":
            raise ConfigError(f"{path} is empty", "leave it out, or give it a value")
        if kind is int:
            _refuse_too_small(path, node)


def _usual_node(usual: DictConfig, path: str) -> Any:
    """The node of the yaml files; where it stands for another key (``${data.encoder}``), that's."""
    above, _, name = path.rpartition(".")
    node: Any = OmegaConf.select(usual, above) if above else usual
    node = node._get_node(name, validate_access=False) if isinstance(node, DictConfig) else None
    other = _ANOTHER_KEY.fullmatch(str(node._value())) if hasattr(node, "_value") else None
    return node if other is None else _usual_node(usual, other[1])


def _plain_values(node: DictConfig, path: str) -> Iterator[tuple[str, Any]]:
    """Values that belong to no object, with their dotted names."""
    for key in node:
        if str(key) == "hydra":
            continue
        item: Any = node._get_node(key)
        name = f"{path}.{key!s}" if path else str(key)
        is_open = isinstance(item, DictConfig) and not item._is_none() and not item._is_missing()
        if not is_open:
            yield name, item
        elif "_target_" not in item:
            yield from _plain_values(item, name)


def _refuse_too_small(path: str, node: Any) -> None:
    if node._is_none() or node._is_missing() or node._is_interpolation():
        return
    least = _LEAST.get(path, 1 if _AT_LEAST_ONE.search(path) else 0)
    if node._value() < least:
        raise ConfigError(f"{path}={node._value()}: a whole number of at least {least} is wanted")


def _parameters(target: str) -> Mapping[str, inspect.Parameter] | None:
    try:
        callee = _locate(target)
        try:
            parameters = inspect.signature(callee, eval_str=True).parameters
        except NameError:  # a name for the type checker alone
            parameters = inspect.signature(callee).parameters
    except (ImportError, AttributeError) as error:
        told = str(error.__cause__ or error).strip().split("\n")[0]
        raise ConfigError(f"_target_={target} can't be imported: {told}") from None
    except (TypeError, ValueError):  # some builtins have no signature
        return None
    takes_any = any(p.kind is inspect.Parameter.VAR_KEYWORD for p in parameters.values())
    return None if takes_any else parameters


def _refuse_other_type(path: str, node: Any, annotation: Any) -> None:
    union = isinstance(annotation, types.UnionType) or typing.get_origin(annotation) is typing.Union
    wanted = set(typing.get_args(annotation) if union else [annotation])
    if not wanted <= {int, float, bool, str, types.NoneType} or not hasattr(node, "_value"):
        return
    if node._is_missing() or node._is_interpolation():
        return
    value = node._value()
    if fits(value, annotation):
        return
    words = " or ".join(_WORDS[kind] for kind in (int, float, bool, str) if kind in wanted)
    told = "null" if value is None else repr(value)
    if isinstance(node, DictConfig | ListConfig) and value is not None:
        told = "a list or a mapping"
    is_number = type(value) in (int, float)
    hint = f"as a text: {setting(path, str(value))}" if str in wanted and is_number else None
    raise ConfigError(f"{path}: wants {words}, not {told}", hint)


def _objects(node: Any, path: str) -> Iterator[tuple[str, DictConfig]]:
    if isinstance(node, ListConfig) and not node._is_none():
        for index in range(len(node)):
            yield from _objects(node._get_node(index), f"{path}.{index}")
    if not isinstance(node, DictConfig) or node._is_none() or node._is_missing():
        return
    if "_target_" in node:
        yield path, node
    for key in node:
        if key != "hydra":
            yield from _objects(node._get_node(key), f"{path}.{key!s}" if path else str(key))
