"""What the root scripts share: plain errors, exit codes, quiet libraries."""

from __future__ import annotations

import logging
import os
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig

from cospeech.errors import CospeechError
from cospeech.experiment.context import RunInterrupted
from cospeech.experiment.leftovers import remove_leftovers

_SAYS_NOTHING = (
    ".*LeafSpec.*",
    ".*smaller than the logging interval.*",
    ".*exists and is not empty.*",
)
"""Warnings of our libraries that a user of ours can't act on."""


def command_line(task: Callable[[DictConfig], Any], cfg: DictConfig) -> Any:
    """Run a task; errors meant for the user are printed without a traceback.

    In a multirun they go on up, so that Hydra counts the job as failed and runs the others.
    """
    # Lightning's start-up lines (devices, an advertisement) would bury ours.
    logging.getLogger("lightning.pytorch.utilities.rank_zero").setLevel(logging.WARNING)
    for message in _SAYS_NOTHING:
        warnings.filterwarnings("ignore", message=message)
    os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
    torch.set_float32_matmul_precision("high")
    try:
        return task(cfg)
    except RunInterrupted as error:
        print(f"\n{error}", file=sys.stderr)
        sys.exit(130)
    except CospeechError as error:
        if HydraConfig.get().mode == RunMode.MULTIRUN:
            raise
        remove_leftovers(Path(HydraConfig.get().runtime.output_dir))
        print(f"\nerror: {error}", file=sys.stderr)
        sys.exit(1)
