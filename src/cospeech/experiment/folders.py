"""Which folder a run gets, which one it goes on in, and the command that does so."""

from __future__ import annotations

import hashlib
import json
import shlex
import sys
from datetime import datetime
from pathlib import Path

from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

from cospeech.errors import ConfigError
from cospeech.reporting.record import read_record


def resume_command() -> str:
    """What to type to go on with this run."""
    arguments = [a for a in sys.argv[1:] if not a.startswith("ckpt_path=")]
    in_sweep = HydraConfig.initialized() and HydraConfig.get().mode == RunMode.MULTIRUN
    if in_sweep and not any(argument.startswith("study") for argument in arguments):
        arguments.append(f"study_name={Path(HydraConfig.get().sweep.dir).name}")
    return shlex.join([Path(sys.executable).name, sys.argv[0], *arguments, "ckpt_path=last"])


def run_identity(cfg: DictConfig) -> str:
    """Hash of the settings that decide what a run computes; equal ones can go on with each other.

    The number of epochs is left out, so that a run can be made longer.
    """
    parts = {key: cfg.get(key) for key in ("model", "data", "training", "metrics", "seed")}
    values = OmegaConf.to_container(OmegaConf.create({**parts}), resolve=False)
    assert isinstance(values, dict)
    values["training"] = {
        key: value for key, value in (values["training"] or {}).items() if key != "epochs"
    }
    text = json.dumps(values, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def run_folder(
    mode: str, parent: str, prefix: str, checkpoint: str | None, *, _root_: DictConfig
) -> str:
    """The run's folder: a new one, or with ``ckpt_path=last`` the newest with the same settings.

    Args:
        mode: ``"run"`` for a path, ``"sweep"`` for the name alone (a sweep joins it itself).
        parent: Folder that holds the runs.
        prefix: ``<model>-<data>-<ablation>-s<seed>``.
        checkpoint: The config's ``ckpt_path``.
    """
    folder = Path(parent)
    if checkpoint == "last":
        identity = run_identity(_root_)
        found = [
            path.parent
            for path in sorted(folder.glob(f"{prefix}-*/record.json"))
            if read_record(path).get("identity") == identity
        ]
        if found:
            return found[-1].name if mode == "sweep" else str(found[-1])
        if mode == "run":
            raise ConfigError(
                f"ckpt_path=last: no run {prefix}-* with these settings in {folder}",
                "start it without ckpt_path, or give the checkpoint's file",
            )
    name = f"{prefix}-{datetime.now():%Y%m%d-%H%M%S-%f}"
    return name if mode == "sweep" else str(folder / name)


OmegaConf.register_new_resolver("run_folder", run_folder, use_cache=False)
