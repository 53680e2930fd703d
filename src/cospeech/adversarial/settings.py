"""Adversaries as settings say them: by name, each with a class, a weight, a loss and sizes.

Settings come from records and checkpoints too, which may be a stranger's. So a class is looked up
among the modules of given packages alone, and must be an adversary.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from importlib import import_module
from inspect import Parameter, signature
from typing import Any, ClassVar, Generic, TypeVar

from torch import nn

from cospeech.adversarial.adversary import Adversary
from cospeech.adversarial.losses import ON_PROBABILITIES, GanLosses, chosen_losses
from cospeech.errors import ConfigError


class SettableAdversary(Adversary):
    """Base of the adversaries that a setting can name; it plays from the start.

    A subclass has a static ``network`` that makes the discriminator: of what the method knows of
    its input, and of sizes with defaults, which are the settings.

    Args:
        facts: What the method knows of its input.
        weight: See `Adversary`.
        loss: Name among ``loss_choices``.
        sizes: Of the network.
    """

    network: ClassVar[Callable[..., nn.Module]]
    loss_choices: ClassVar[Mapping[str, GanLosses]] = ON_PROBABILITIES

    def __init__(self, facts: Any, weight: float, loss: str, **sizes: Any) -> None:
        losses = self.loss_choices[loss]
        super().__init__(type(self).network(facts, **sizes), losses, weight, start_epoch=0)


Kind = TypeVar("Kind", bound=SettableAdversary)


@dataclass(frozen=True)
class AdversarySettings(Generic[Kind]):
    """One adversary as it is to be built.

    Attributes:
        kind: Its class.
        arguments: ``weight``, ``loss`` and every size.
    """

    kind: type[Kind]
    arguments: dict[str, Any]

    def build(self, facts: Any) -> Kind:
        """The adversary, untrained, of what the method knows of its input."""
        return self.kind(facts, **self.arguments)

    def identity(self) -> dict[str, Any]:
        """What its training depends on, as JSON values, but for the weight, which others feel."""
        others = {name: value for name, value in self.arguments.items() if name != "weight"}
        return {"class": f"{self.kind.__module__}.{self.kind.__qualname__}", **others}


def checked_settings(
    settings: Mapping[str, Mapping[str, Any] | None],
    built_in: Mapping[str, type[Kind]],
    base: type[Kind],
    methods: Iterable[type],
) -> dict[str, AdversarySettings[Kind]]:
    """The adversaries that play: those of the method in its order, then others.

    Args:
        settings: Name -> ``weight`` and, where wanted, ``loss``, sizes of the class's network, and
            ``class``, its import path, which a name that isn't built in needs; None leaves one out.
        built_in: The method's own adversaries.
        base: What every class must be a subclass of.
        methods: The method's class and those it was made from. A class is found in the modules
            beside theirs.

    Raises:
        ConfigError: An unknown name, class, loss or setting, no weight, or a value of another kind.
    """
    packages = {kind.__module__.rpartition(".")[0] or kind.__module__ for kind in methods}
    checked = {}
    for name, given in settings.items():
        place = f"model.adversaries.{name}"
        if not name.isidentifier() or hasattr(nn.ModuleDict, name):
            raise ConfigError(f"{place}: an adversary can't be called so")
        if given is None:
            continue
        values = dict(given)
        if (path := values.pop("class", None)) is not None:
            kind = _class(path, base, packages, f"{place}.class")
        elif name in built_in:
            kind = built_in[name]
        else:
            raise ConfigError(
                f"{place}: no such adversary; there are {', '.join(built_in)}",
                f"say {place}.class=PACKAGE.MODULE.CLASS for one of your own",
            )
        checked[name] = AdversarySettings(kind, _arguments(kind, values, place))
    return {name: checked[name] for name in (*built_in, *checked) if name in checked}


def _class(path: Any, base: type[Kind], packages: Iterable[str], place: str) -> type[Kind]:
    module, _, name = path.rpartition(".") if isinstance(path, str) else ("", "", "")
    inside = any(f"{module}.".startswith(f"{package}.") for package in packages)
    parts = module.split(".")
    if not inside or not all(part.isidentifier() and part[0] != "_" for part in parts):
        raise ConfigError(
            f"{place}={str(path)[:100]!r} is no class of {' or '.join(sorted(packages))}",
            "put its file beside the method's, or beside your own subclass of the method",
        )
    try:
        found = getattr(import_module(module), name, None)
    except ImportError as error:
        raise ConfigError(f"{place}={path}: {error}") from None
    if not isinstance(found, type) or not issubclass(found, base) or not hasattr(found, "network"):
        raise ConfigError(
            f"{place}={path} is no subclass of {base.__module__}.{base.__name__} with a network"
        )
    return found


def _arguments(
    kind: type[SettableAdversary], given: Mapping[str, Any], place: str
) -> dict[str, Any]:
    _, *sizes = signature(kind.network).parameters.values()
    known = {"weight": Parameter.empty, "loss": next(iter(kind.loss_choices))}
    known |= {size.name: size.default for size in sizes}
    for name in given:
        if name not in known:
            told = ", ".join(known)
            raise ConfigError(f"{place}.{name}: no such setting; there are {told}")
    checked = {
        name: _checked(name, value, known[name], f"{place}.{name}") for name, value in given.items()
    }
    arguments = {**known, **checked}
    if missing := [name for name, value in arguments.items() if value is Parameter.empty]:
        raise ConfigError(
            f"{place} has no {missing[0]}",
            f"say {place}.{missing[0]}=1, or {place}=null to play without it",
        )
    chosen_losses(arguments["loss"], kind.loss_choices, f"{place}.loss")
    return arguments


def _checked(name: str, value: Any, default: Any, place: str) -> Any:
    """A value of the default's type; without a default, a number."""
    if isinstance(default, bool | str):
        if type(value) is not type(default):
            raise ConfigError(f"{place}={value!r}: not like {default!r}")
        return value
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ConfigError(f"{place}={value!r}: not a number")
    if name == "dropout" and not 0 <= value < 1:
        raise ConfigError(f"{place}={value}: from 0 to below 1")
    if name == "weight" and not 0 <= value < float("inf"):
        raise ConfigError(f"{place}={value}: must not be negative")
    if not isinstance(default, int):
        return value
    if not value >= 1 or value % 1:
        raise ConfigError(f"{place}={value}: a whole number from 1")
    return int(value)
