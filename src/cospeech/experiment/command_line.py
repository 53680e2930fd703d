"""What the root scripts share: help, typing errors, plain errors, exit codes, quiet libraries."""

from __future__ import annotations

import argparse
import functools
import logging
import os
import sys
import traceback
import warnings
from collections.abc import Callable
from io import TextIOWrapper
from pathlib import Path
from typing import Any, NoReturn, cast

import hydra
from hydra._internal.utils import get_args_parser
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig

from cospeech.errors import ConfigError, CospeechError
from cospeech.experiment.failures import as_sentence
from cospeech.experiment.help import help_text
from cospeech.experiment.leftovers import remove_leftovers
from cospeech.experiment.settings import refuse_unknown_settings
from cospeech.experiment.typed import Command, check_typed
from cospeech.terminal import Printable, keep_printing

_SAYS_NOTHING = (
    ".*LeafSpec.*",
    ".*smaller than the logging interval.*",
    ".*exists and is not empty.*",
)
"""Warnings of our libraries that a user of ours can't act on."""

_failed_jobs: list[tuple[str, str]] = []
"""Of the multirun of this process: the job's overrides, and what it ended with."""


def command(task: Callable[[DictConfig], Any], script: str) -> None:
    """Run a root script: what is typed is checked, and the task is done once or for each job.

    Args:
        task: Takes the composed config; what it returns is what a sweep minimises.
        script: The root script's ``__file__``; ``conf`` is beside it, with a yaml of its name.
    """
    keep_printing()
    logging.raiseExceptions = False  # a log that can't be written is no traceback per line
    path = Path(script).resolve()
    name, conf = path.stem, path.parent / "conf"
    given = _arguments()
    own_yaml = given.config_name is None and given.config_path is None
    known = Command(name, conf, () if given.config_dir is None else (given.config_dir,))
    try:
        if given.help and own_yaml:
            print(help_text(known, given.overrides))
            return
        if own_yaml and not given.hydra_help and given.experimental_rerun is None:
            check_typed(known, given.overrides, given.multirun)
    except CospeechError as error:
        _end(error)

    @hydra.main(version_base="1.3", config_path=str(conf), config_name=name)
    @functools.wraps(task)
    def main(cfg: DictConfig) -> Any:
        return command_line(task, cfg)

    # Hydra's own way with exceptions is a traceback of its own frames.
    asked_for_all = os.environ.get("HYDRA_FULL_ERROR") == "1"
    os.environ["HYDRA_FULL_ERROR"] = "1"
    try:
        main()
    except KeyboardInterrupt:
        print("\nstopped", file=sys.stderr)
        sys.exit(130)
    except Exception as error:
        if _failed_jobs:
            _end_of_multirun()
        sentence = as_sentence(error, _settings_of_place(given.overrides))
        if asked_for_all or sentence is None:
            raise
        _end(sentence)


def command_line(task: Callable[[DictConfig], Any], cfg: DictConfig) -> Any:
    """Run a task; errors meant for the user are printed without a traceback.

    In a multirun they go on up, so that Hydra counts the job as failed and runs the others.
    """
    import torch

    from cospeech.experiment.context import RunInterrupted

    # Lightning's start-up lines (devices, an advertisement) would bury ours.
    logging.getLogger("lightning.pytorch.utilities.rank_zero").setLevel(logging.WARNING)
    for message in _SAYS_NOTHING:
        warnings.filterwarnings("ignore", message=message)
    os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
    torch.set_float32_matmul_precision("high")
    for handler in logging.getLogger().handlers:
        handler.addFilter(Printable())
    for handler in _log_files():
        # Hydra opens it in the terminal's encoding, which may know no letter of a path.
        cast(TextIOWrapper, handler.stream).reconfigure(encoding="utf-8", errors="backslashreplace")
    multirun = HydraConfig.get().mode == RunMode.MULTIRUN
    try:
        if multirun:
            refuse_unknown_settings(cfg)
        return task(cfg)
    except Exception as error:
        sentence = as_sentence(error, cfg)
        if isinstance(sentence, RunInterrupted):
            print(f"\n{sentence}", file=sys.stderr)
            sys.exit(130)
        told = str(sentence) if sentence is not None else _unexpected(error)
        if sentence is not error:
            _to_log_files(error)
        print(f"\nerror: {told}", file=sys.stderr)
        if sentence is None:
            traceback.print_exception(error)
        if sentence is not None:
            folder = Path(HydraConfig.get().runtime.output_dir)
            remove_leftovers(folder, itself=not _is_named_by_user())
        if multirun:
            _failed_jobs.append((" ".join(HydraConfig.get().overrides.task), told))
            raise
        sys.exit(1)


def _settings_of_place(overrides: list[str]) -> DictConfig:
    """Where a command was to write, if it ends before Hydra has given it a config."""
    typed = [text for text in overrides if text.startswith("outputs_dir=")]
    folder = typed[-1].partition("=")[2].strip("'\"") if typed else "outputs"
    return DictConfig({"outputs_dir": str(Path(folder).absolute())})


def _is_named_by_user() -> bool:
    """Whether the command line says where the command writes."""
    overrides = HydraConfig.get().overrides
    typed = (*overrides.hydra, *overrides.task)
    return any(text.startswith(("hydra.run.dir=", "run_dir=")) for text in typed)


def _arguments() -> argparse.Namespace:
    """The process's arguments by Hydra's rules, but with options before and after the settings."""
    parser = get_args_parser()
    given, rest = parser.parse_known_args()
    unknown = [text for text in rest if text.startswith("-")]
    if unknown:
        _end(
            ConfigError(
                f"{unknown[0]}: there is no such option",
                "settings are written name=value, without dashes; --help lists the groups",
            )
        )
    if rest:
        settings = [*given.overrides, *rest]
        options = [text for text in sys.argv[1:] if text not in settings]
        sys.argv[1:] = [*options, *settings]
        given = parser.parse_args()
    return given


def _end(error: CospeechError) -> NoReturn:
    print(f"error: {error}", file=sys.stderr)
    sys.exit(1)


def _end_of_multirun() -> NoReturn:
    print(f"\n{len(_failed_jobs)} of the jobs failed:", file=sys.stderr)
    for overrides, told in _failed_jobs:
        first, *more = told.splitlines()
        print(
            "\n".join([f"  {overrides}: {first}", *(f"  {line}" for line in more)]), file=sys.stderr
        )
    sys.exit(1)


def _unexpected(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    told = f"unexpected {type(error).__name__}" + (f": {lines[0]}" if lines else "")
    files = [handler.baseFilename for handler in _log_files()]
    return "\n".join([told, *(f"  -> the log with all of it: {file}" for file in files)])


def _to_log_files(error: Exception) -> None:
    """The traceback, for whoever looks into it; not on the terminal."""
    info = (type(error), error, error.__traceback__)
    record = logging.LogRecord(__name__, logging.ERROR, "", 0, "%s", (error,), info)
    for handler in _log_files():
        handler.handle(record)


def _log_files() -> list[logging.FileHandler]:
    handlers = logging.getLogger().handlers
    return [handler for handler in handlers if isinstance(handler, logging.FileHandler)]
