"""What a user typed behind a command: Hydra's overrides, read and explained."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig, ListConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from cospeech.errors import ConfigError
from cospeech.experiment.settings import (
    known_arguments,
    refuse_unknown_settings,
    refuse_wrong_values,
)
from cospeech.quoting import quoted, setting
from cospeech.suggestions import did_you_mean

_OPEN = ("callbacks", "logger", "metrics.catalogue")
"""Nodes whose children are objects, so that a user may add one with a `_target_`."""

_OF_HYDRA = ("defaults", "hydra")
"""What of a command's yaml is no setting of the command."""

_SAID_IN_FULL = "data_modules."
"""What has all its arguments in its yaml; others are asked, which takes seconds of importing."""

_OF_ONE_MODEL = ("ablation", "experiment")


@dataclass(frozen=True)
class Command:
    """One of the root scripts.

    Attributes:
        name: Of the script and of its yaml: ``"train"``.
        conf: The folder of the yaml.
        more: Further folders with yaml files of the user's (``--config-dir``).
    """

    name: str
    conf: Path
    more: tuple[str, ...] = ()

    def compose(self, overrides: Sequence[str]) -> DictConfig:
        """The config, with Hydra's own part under ``hydra``."""
        paths = [f"hydra.searchpath=[{','.join(quoted(path) for path in self.more)}]"]
        with initialize_config_dir(str(self.conf), version_base="1.3"):
            given = [*overrides, *(paths if self.more else [])]
            return compose(self.name, overrides=given, return_hydra_config=True)

    def choices(self, group: str) -> list[str]:
        """What can be chosen in a group; empty where there is no such group."""
        with initialize_config_dir(str(self.conf), version_base="1.3"):
            found = set(GlobalHydra.instance().config_loader().get_group_options(group))
        for folder in self.more:
            found |= {path.stem for path in (Path(folder) / group).glob("*.yaml")}
        return sorted(found - {"base"})

    def groups(self) -> list[str]:
        """The groups that this command has a choice of."""
        defaults = OmegaConf.load(self.conf / f"{self.name}.yaml").defaults
        names = [str(next(iter(item))) for item in defaults if isinstance(item, DictConfig)]
        return [name for name in names if not name.startswith(("optional ", "override "))]


def check_typed(command: Command, overrides: Sequence[str], multirun: bool) -> None:
    """Refuse, before anything is made or imported, what can't become a run.

    Of a sweep, each value is tried once, beside the first ones of the others.

    Raises:
        ConfigError: An argument that Hydra can't read, an unknown group, choice or setting, or
            choices that don't go together; the message names what is near.
    """
    typed = read_overrides(overrides)
    first = _jobs(command, typed)[0]
    cfg = _composed(command, first, typed)
    multirun = multirun or cfg.hydra.mode == RunMode.MULTIRUN
    for override in typed:
        if override.is_sweep_override() and not multirun:
            text = str(override.input_line)
            name, _, value = text.partition("=")
            raise ConfigError(
                f"{text}: several values, and this is one run",
                f"for a run each: python {command.name}.py -m ...;"
                f" for one value: {setting(name, value)}",
            )
    if multirun:
        given = {override.key_or_group for override in typed}
        swept = cfg.hydra.sweeper.get("params") or {}
        typed += read_overrides([f"{k}={v}" for k, v in swept.items() if k not in given])
    configs = [(job, _composed(command, job, typed)) for job in _jobs(command, typed)]
    for job, cfg in configs:
        _refuse_unknown_additions(command, job, cfg)
        _refuse_choices_of_others(command, job, cfg)
    for job, cfg in configs:
        refuse_unknown_settings(cfg)
        refuse_wrong_values(cfg, _usual(command, job))


# Reading ----------------------------------------------------------------------------------------


def read_overrides(overrides: Iterable[str]) -> list[Override]:
    """Arguments in Hydra's grammar.

    Raises:
        ConfigError: One isn't; with the quoting that it needs.
    """
    parser, read = OverridesParser.create(), []
    for text in overrides:
        try:
            read += parser.parse_overrides([text])
        except (HydraException, ValueError, RecursionError) as error:
            raise _unreadable(text, error) from None
    return read


def _unreadable(text: str, error: Exception) -> ConfigError:
    if "=" not in text:
        return ConfigError(f"{text}: settings are written name=value", "--help lists the groups")
    told = " ".join(str(error).split("\nSee ")[0].split())[:200]
    name, _, value = text.partition("=")
    argument = setting(name, value)
    if not _reads_back(shlex.split(argument)[0], value):
        return ConfigError(f"{text}: not in Hydra's grammar ({told})", "--help lists the groups")
    return ConfigError(
        f"{text}: characters of this value mean something to Hydra",
        f"quote it, for the shell and for Hydra: {argument}",
    )


def _reads_back(argument: str, value: str) -> bool:
    try:
        override = OverridesParser.create().parse_override(argument)
        if override.is_sweep_override():
            return False
        return bool(OmegaConf.create({"value": override.value()})["value"] == value)
    except (HydraException, OmegaConfBaseException, ValueError):
        return False


# Composing --------------------------------------------------------------------------------------


def _jobs(command: Command, typed: Sequence[Override]) -> list[list[str]]:
    """Overrides of jobs in which every value of every sweep occurs."""
    values = [list(_values(command, override)) for override in typed]
    first = [found[0] for found in values if found]
    jobs = [first]
    given = [found for found in values if found]
    for index, found in enumerate(given):
        jobs += [[*first[:index], value, *first[index + 1 :]] for value in found[1:]]
    return jobs


def _values(command: Command, override: Override) -> Iterator[str]:
    if not override.is_sweep_override():
        yield str(override.input_line)
    elif override.is_discrete_sweep():
        with initialize_config_dir(str(command.conf), version_base="1.3"):
            override.config_loader = GlobalHydra.instance().config_loader()
            for value in override.sweep_string_iterator():
                yield f"{override.get_key_element()}={value}"


def _composed(command: Command, job: Sequence[str], typed: Sequence[Override]) -> DictConfig:
    try:
        return command.compose(job)
    except (HydraException, OmegaConfBaseException) as error:
        raise _explained(command, job, error) from None


def _usual(command: Command, job: Sequence[str]) -> DictConfig:
    """The config of the same choices, with the values that the yaml files give."""
    chosen = [
        str(override.input_line)
        for override in read_overrides(job)
        if command.choices(_group(override)) or str(override.key_or_group).startswith("hydra.")
    ]
    return _of_choices(command, tuple(chosen))


@cache
def _of_choices(command: Command, chosen: tuple[str, ...]) -> DictConfig:
    return command.compose(chosen)


def _explained(command: Command, job: Sequence[str], error: Exception) -> ConfigError:
    """What is wrong with arguments that can't be composed."""
    parsed = read_overrides(job)
    groups = [override for override in parsed if command.choices(_group(override))]
    for override in groups:
        group, choices = _group(override), command.choices(_group(override))
        chosen = override.value()
        for choice in chosen if isinstance(chosen, list) else [chosen]:
            if choice is not None and str(choice) not in choices:
                near = did_you_mean(str(choice), choices)
                return ConfigError(
                    f"{group}={choice}: there is no such {group}{near}",
                    f"one of: {', '.join(choices)}",
                )
    missing = [
        group
        for group in command.groups()
        if f"You must specify '{group}'" in str(error)
        and group not in [_group(override) for override in groups]
    ]
    others = [override for override in parsed if override not in groups]
    for override in others if missing else []:
        name = str(override.key_or_group).partition(".")[0]
        yaml = OmegaConf.load(command.conf / f"{command.name}.yaml")
        known = [*command.groups(), *(str(key) for key in yaml if key not in _OF_HYDRA)]
        if name not in known and not name.startswith("hydra"):
            return _no_such(command, name, name, known)
    if missing:
        choices = command.choices(missing[0])
        return ConfigError(
            f"{missing[0]} is not set", f"add {missing[0]}=NAME, one of: {', '.join(choices)}"
        )
    try:
        cfg = command.compose([str(override.input_line) for override in groups])
    except (HydraException, OmegaConfBaseException):
        told = _in_one_line(error)
        if "In 'study/" in told.problem:
            return ConfigError(
                f"this study is not for {command.name}.py ({told.problem})",
                "the first lines of its yaml in conf/study have the command that runs it",
            )
        return told
    for override in others:
        if not override.is_add():
            refused = _unknown(command, cfg, override)
            if refused is not None:
                return refused
    return _in_one_line(error)


def _in_one_line(error: BaseException) -> ConfigError:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    cause = str(error.__cause__ or "").strip().split("\n")[0]
    told = "; ".join(lines[:2] + ([cause] if cause and cause not in lines else []))
    return ConfigError(told or type(error).__name__, "--help lists the groups")


def _group(override: Override) -> str:
    return str(override.key_or_group).partition("@")[0]


# Unknown names ----------------------------------------------------------------------------------


def _unknown(command: Command, cfg: DictConfig, override: Override) -> ConfigError | None:
    """An error about a setting that isn't in the config, or None where it is."""
    key = str(override.key_or_group)
    prefix, name, node = _first_missing(cfg, key)
    if name is None or key.startswith("hydra"):
        return None
    valid = [str(item) for item in node] if isinstance(node, DictConfig) else []
    if not prefix:
        valid = [*(item for item in valid if item not in _OF_HYDRA), *command.groups()]
    whole = ".".join([*prefix, name])
    refused = _no_such(command, whole, name, valid, ".".join(prefix), cfg)
    if "did you mean" in str(refused) or not isinstance(node, DictConfig):
        return refused
    text = str(override.input_line)
    if ".".join(prefix) in _OPEN and "_target_" in text and not override.is_delete():
        hint = f"one more is added with +: {shlex.quote('+' + text)}"
        return ConfigError(f"{whole}: not in {'.'.join(prefix)}", hint)
    target = str(node.get("_target_", ""))
    if target and not target.startswith(_SAID_IN_FULL):
        arguments = known_arguments(target)
        if arguments is None or name in arguments:
            hint = f"a setting that isn't in the yaml is added with +: {shlex.quote('+' + text)}"
            return ConfigError(f"{whole}: not in {'.'.join(prefix)}", hint)
        valid += arguments
    return _no_such(command, whole, name, valid, ".".join(prefix), cfg)


def _no_such(
    command: Command,
    whole: str,
    name: str,
    valid: Sequence[str],
    prefix: str = "",
    cfg: DictConfig | None = None,
) -> ConfigError:
    names = sorted({item for item in valid if not item.startswith("_")})
    near = did_you_mean(name, names)
    if not near and cfg is not None:
        same = [path for path in _paths(cfg) if path.rpartition(".")[2] == name]
        near = f"; did you mean {same[0]!r}?" if same else ""
    where = prefix or f"{command.name}.py"
    return ConfigError(
        f"{whole}: there is no such setting{near}", f"{where} knows: {', '.join(names)}"
    )


def _first_missing(cfg: DictConfig, key: str) -> tuple[list[str], str | None, Any]:
    """The part of a key that isn't there, what is above it, and the node that lacks it."""
    node: Any = cfg
    above = list[str]()
    for part in key.split("."):
        if isinstance(node, ListConfig) and part.isdigit() and int(part) < len(node):
            node = node._get_node(int(part))
        elif _has(node, part):
            node = node._get_node(part)
        else:
            return above, part, node
        above.append(part)
    return above, None, node


def _has(node: Any, name: str) -> bool:
    """Whether a mapping has a key, also one that is still to be set (``???``)."""
    if not isinstance(node, DictConfig) or node._is_none() or node._is_missing():
        return False
    return name in set(node.keys())


def _paths(cfg: DictConfig, above: str = "") -> Iterator[str]:
    for key in cfg:
        node = cfg._get_node(key)
        path = f"{above}{key!s}"
        if path == "hydra":
            continue
        yield path
        if isinstance(node, DictConfig) and not node._is_none() and not node._is_missing():
            yield from _paths(node, f"{path}.")


def _refuse_unknown_additions(command: Command, job: Sequence[str], cfg: DictConfig) -> None:
    """``+key``: of what the command knows, or the argument of an object that takes it."""
    parsed = read_overrides(job)
    added = [
        override
        for override in parsed
        if (override.is_add() or override.is_force_add())
        and not command.choices(_group(override))
        and not str(override.key_or_group).startswith("hydra")
    ]
    if not added:
        return
    without = command.compose([str(o.input_line) for o in parsed if o not in added])
    for override in added:
        key = str(override.key_or_group)
        above, name, node = _first_missing(without, key)
        if name is None:
            continue
        above_it = ".".join(above)
        if above_it in _OPEN and _has(OmegaConf.select(cfg, above_it)[name], "_target_"):
            continue
        if any("_target_" in node for node in _objects_above(without, above)):
            continue  # a name of its own arguments, or it is refused with those
        valid = [str(item) for item in node] if isinstance(node, DictConfig) else []
        if not above:
            valid = [*(item for item in valid if item not in _OF_HYDRA), *command.groups()]
        raise _no_such(command, key, name, valid, ".".join(above), without)


def _objects_above(cfg: DictConfig, above: Sequence[str]) -> Iterator[DictConfig]:
    node: Any = cfg
    for part in above:
        node = node[int(part)] if isinstance(node, ListConfig) else node._get_node(part)
        if isinstance(node, DictConfig):
            yield node


def _owner(command: Command, choice: str) -> str | None:
    """The model that an ablation's or an experiment's name begins with."""
    return max(
        (model for model in command.choices("model") if choice.startswith(f"{model}_")),
        key=len,
        default=None,
    )


def _refuse_choices_of_others(command: Command, job: Sequence[str], cfg: DictConfig) -> None:
    """An ablation or an experiment changes settings that the model has."""
    choices = cfg.hydra.runtime.choices
    chosen = [group for group in _OF_ONE_MODEL if choices.get(group) not in (None, "full")]
    if not chosen or not isinstance(cfg.get("model"), DictConfig):
        return
    alone = _settings_of_model(command, str(choices.model))
    for group in chosen:
        if _changes(command, group, choices[group]) - alone:
            fitting = [
                name
                for name in command.choices(group)
                if _owner(command, name) in (None, choices.model)
                and name != "full"
                and _changes(command, group, name) <= alone
            ]
            raise ConfigError(
                f"{group}={choices[group]} is not of model={choices.model}, which has no"
                f" {', '.join(sorted(_changes(command, group, choices[group]) - alone))}",
                f"{group}s for it: {', '.join(fitting) or 'none'}",
            )


@cache
def _settings_of_model(command: Command, model: str) -> frozenset[str]:
    return frozenset(str(key) for key in command.compose([f"model={model}"]).model)


def _changes(command: Command, group: str, name: str) -> set[str]:
    """Names of the model's settings that a yaml sets."""
    for folder in [*map(Path, command.more), command.conf]:
        path = folder / group / f"{name}.yaml"
        if path.is_file():
            model = OmegaConf.select(OmegaConf.load(path), "model")
            return {str(key) for key in model} if isinstance(model, DictConfig) else set()
    return set()
