"""Whether the settings of an object in the config are arguments that its constructor takes."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any

from hydra._internal.utils import _locate  # get_object logs each failure as an error
from omegaconf import DictConfig, ListConfig

from cospeech.errors import ConfigError
from cospeech.suggestions import did_you_mean

_OF_HYDRA = ("_target_", "_partial_", "_recursive_", "_convert_", "_args_")


def known_arguments(target: str) -> list[str] | None:
    """Names that a class or function takes; None where it takes any, or doesn't say.


    Raises:
        ConfigError: There is no such class or function.
    """
    try:
        parameters = inspect.signature(_locate(target)).parameters
    except (ImportError, AttributeError) as error:
        told = str(error.__cause__ or error).strip().split("\n")[0]
        raise ConfigError(f"_target_={target} can't be imported: {told}") from None
    except (TypeError, ValueError):  # some builtins have no signature
        return None
    if any(item.kind is inspect.Parameter.VAR_KEYWORD for item in parameters.values()):
        return None
    return list(parameters)


def refuse_unknown_settings(cfg: DictConfig) -> None:
    """Compare every object of a config with its constructor's arguments; nothing is constructed.

    Raises:
        ConfigError: A setting that isn't an argument; with the nearest one.
    """
    for path, node in _objects(cfg, ""):
        known = known_arguments(str(node["_target_"]))
        if known is None:
            continue
        for key in node:
            name = str(key)
            if name not in known and name not in _OF_HYDRA:
                target = str(node["_target_"]).rpartition(".")[2]
                raise ConfigError(
                    f"{path}.{name}: {target} has no such setting{did_you_mean(name, known)}",
                    f"{path} knows: {', '.join(sorted(known))}",
                )


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
            yield from _objects(node._get_node(key), f"{path}.{key}" if path else str(key))
