"""Which folder a run gets, which one it goes on in, and the command that does so."""

from __future__ import annotations

import hashlib
import json
import shlex
import sys
from datetime import datetime
from pathlib import Path
from typing import Any

from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

from cospeech.errors import ConfigError
from cospeech.quoting import quoted, setting
from cospeech.reporting.record import read_record

_DECIDES = ("model", "data", "training", "metrics", "seed")
"""The parts of a config that decide what a run computes."""

_DECIDES_NOT = ("training.epochs", "data.workers", "data.store_dir", "metrics.catalogue")
"""Settings below those that may change: how long, by how many processes, where, and what is looked
at."""

_SETTINGS_SHOWN = 6


def resume_command() -> str:
    """What to type to go on with this run."""
    arguments = [a for a in sys.argv[1:] if not a.startswith("ckpt_path=")]
    in_sweep = HydraConfig.initialized() and HydraConfig.get().mode == RunMode.MULTIRUN
    if in_sweep and not any(argument.startswith("study") for argument in arguments):
        arguments.append(f"study_name={quoted(Path(HydraConfig.get().sweep.dir).name)}")
    return shlex.join([Path(sys.executable).name, sys.argv[0], *arguments, "ckpt_path=last"])


def run_identity(cfg: DictConfig) -> str:
    """Hash of the settings that decide what a run computes; equal ones can go on with each other.

    The number of epochs is left out, so that a run can be made longer, and so is what changes no
    result.
    """
    parts = {key: cfg.get(key) for key in _DECIDES}
    values = OmegaConf.to_container(OmegaConf.create({**parts}), resolve=False)
    assert isinstance(values, dict)
    for part, _, name in (key.partition(".") for key in _DECIDES_NOT):
        (values[part] or {}).pop(name, None)
    text = json.dumps(_with_names(values), sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _with_names(value: Any) -> Any:
    """A tree whose keys are all text: yaml's numbers and words can't be sorted together."""
    if isinstance(value, dict):
        return {str(key): _with_names(item) for key, item in value.items()}
    return [_with_names(item) for item in value] if isinstance(value, list) else value


def changed_settings(cfg: DictConfig, record: Path) -> list[str]:
    """The settings that decide what a run computes and differ from a run's record.

    Args:
        cfg: Composed from ``conf/train.yaml``.
        record: A ``record.json``; one that can't be read tells of no difference.

    Returns:
        ``"model.layers was 4, is 2"``, a setting each; without the number of epochs, what changes
        no result, and those that follow from others (``${...}``).
    """
    config = read_record(record).get("config")
    if not config:
        return []
    before = _leaves({key: config.get(key) for key in _DECIDES}, "")
    now = _leaves({key: _unresolved(cfg, key) for key in _DECIDES}, "")
    return [
        f"{key} was {_short(before, key)}, is {_short(now, key)}"
        for key in sorted(before.keys() | now.keys())
        if key not in _DECIDES_NOT
        and before.get(key, _ABSENT) != now.get(key, _ABSENT)
        and "${" not in str(now.get(key))
    ]


def run_folder(
    mode: str, parent: str, prefix: str, checkpoint: str | None, *, _root_: DictConfig
) -> str:
    """The run's folder: a new one, or with ``ckpt_path=last`` the newest with the same settings.

    Where ``run_dir`` is typed, it is that one.

    Args:
        mode: ``"run"`` for a path, ``"sweep"`` for the name alone (a sweep joins it itself).
        parent: Folder that holds the runs.
        prefix: ``<model>-<data>-<ablation>-s<seed>``.
        checkpoint: The config's ``ckpt_path``.

    Raises:
        ConfigError: ``ckpt_path=last`` and no run has these settings; names a damaged record, or
            the settings that differ from the newest run of the prefix.
    """
    if mode == "run" and _is_typed(_root_):
        return str(_root_.run_dir)
    folder = Path(parent)
    if checkpoint == "last":
        identity = run_identity(_root_)
        records = sorted(folder.glob(f"{prefix}-*/record.json"))
        found = [path.parent for path in records if read_record(path).get("identity") == identity]
        if found:
            return found[-1].name if mode == "sweep" else str(found[-1])
        damaged = [path for path in records if not read_record(path)]
        if mode == "run" and damaged:
            file = damaged[-1]
            raise ConfigError(
                f"ckpt_path=last: {file} is damaged, and no other run {prefix}-* in {folder} has"
                " these settings",
                "to go on from its weights in a new folder: "
                + setting("ckpt_path", str(file.parent / "checkpoints" / "last.ckpt")),
            )
        if mode == "run":
            raise ConfigError(
                f"ckpt_path=last: no run {prefix}-* with these settings in {folder}"
                + (_difference(_root_, records[-1]) if records else ""),
                "leave ckpt_path out for a new run, or give a run's checkpoint: ckpt_path=FILE",
            )
    name = f"{prefix}-{datetime.now():%Y%m%d-%H%M%S-%f}"
    return name if mode == "sweep" else str(folder / name)


def command_folder(folder: str, *, _root_: DictConfig) -> str:
    """The folder of a command that is no training: ``run_dir`` where it is typed, or this one."""
    return str(_root_.run_dir) if _is_typed(_root_) else folder


def _is_typed(cfg: DictConfig) -> bool:
    """Whether ``run_dir`` is a folder of the user's, and not Hydra's own as in the yaml files."""
    return not OmegaConf.is_interpolation(cfg, "run_dir")


def _difference(cfg: DictConfig, record: Path) -> str:
    changed = changed_settings(cfg, record)
    if not changed:
        return ""
    more = len(changed) - _SETTINGS_SHOWN
    shown = [*changed[:_SETTINGS_SHOWN], *([f"and {more} more"] if more > 0 else [])]
    return f"; in the newest, {record.parent.name}, {'; '.join(shown)}"


_ABSENT = object()


def _short(values: dict[str, Any], key: str) -> str:
    return str(values[key])[:80] if key in values else "absent"


def _unresolved(cfg: DictConfig, key: str) -> Any:
    node = cfg.get(key)
    return OmegaConf.to_container(node, resolve=False) if OmegaConf.is_config(node) else node


def _leaves(value: Any, path: str) -> dict[str, Any]:
    """Every value of a tree by its dotted name."""
    if not isinstance(value, dict) or not value:
        return {path: value}
    found = dict[str, Any]()
    for key, item in value.items():
        found |= _leaves(item, f"{path}.{key}" if path else str(key))
    return found


OmegaConf.register_new_resolver("run_folder", run_folder, use_cache=False)
OmegaConf.register_new_resolver("command_folder", command_folder, use_cache=False)
