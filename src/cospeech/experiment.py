"""One run, from a composed config to a record: the only core file that knows Hydra."""

from __future__ import annotations

import functools
import hashlib
import json
import logging
import os
import shlex
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, cast

import lightning
import torch
from filelock import FileLock, Timeout
from hydra.core.hydra_config import HydraConfig
from hydra.errors import InstantiationException
from hydra.types import RunMode
from hydra.utils import instantiate
from lightning import Callback, LightningDataModule, LightningModule, Trainer
from lightning.pytorch.callbacks import ModelCheckpoint
from lightning.pytorch.loggers import Logger
from omegaconf import DictConfig, OmegaConf

from cospeech.corpus.store import Store
from cospeech.encoders import BATCH_SIZE, encoder_for, keep_encoder
from cospeech.errors import ConfigError, CospeechError
from cospeech.evaluation import References, evaluate_recordings, reference_rows
from cospeech.methods.base import GestureMethod
from cospeech.methods.motion_autoencoder import MotionAutoencoder
from cospeech.metrics.encoder import GestureEncoder, save_encoder
from cospeech.reporting.record import RunRecord, read_record, write_json
from cospeech.reporting.tables import result_table

logger = logging.getLogger(__name__)


class RunInterrupted(CospeechError):
    """The user stopped the run; everything up to the last finished step is saved."""


@dataclass
class RunContext:
    """What callbacks may know of the run they are part of.

    Attributes:
        folder: The run's folder.
        store: The prepared corpus.
        encoder: Encoder of the evaluation space; None for a model that makes no motion.
        references: Reference rows of the store under this encoder, per split.
        record: The run's `record.json`.
        resume_command: What to type to go on after an interruption.
    """

    folder: Path
    store: Store
    encoder: GestureEncoder | None
    references: dict[str, References]
    record: RunRecord
    resume_command: str


@dataclass
class RunResult:
    """What a run gives back to Python callers.

    Attributes:
        folder: The run's folder.
        record: Content of its `record.json`.
        objective: The monitored value of the best checkpoint (what a sweep minimises).
        model: The trained model, best checkpoint's weights; None if the run had finished earlier.
    """

    folder: Path
    record: dict[str, Any]
    objective: float | None
    model: LightningModule | None = field(repr=False, default=None)


def run(cfg: DictConfig) -> RunResult:
    """Prepare the corpus and the encoder, train, evaluate, and leave a record.

    Args:
        cfg: Composed from ``conf/train.yaml``.

    Raises:
        CospeechError: Anything the user can mend; the record says ``failed`` with the message.
        RunInterrupted: The user stopped it; the record says ``interrupted``.
    """
    folder = Path(cfg.run_dir)
    record_path = folder / "record.json"
    if OmegaConf.select(cfg, "study_task") is not None:
        raise ConfigError("this study is of the metrics", "run it with evaluate.py")
    if cfg.ckpt_path == "last" and record_path.is_file():
        earlier = read_record(record_path)
        epochs = earlier.get("config", {}).get("training", {}).get("epochs")
        if earlier.get("status") == "ok" and epochs == cfg.training.epochs:
            logger.info("%s had finished; nothing to do", folder)
            return RunResult(folder, earlier, earlier.get("objective"))
    first_process = int(os.environ.get("LOCAL_RANK", 0)) == 0
    lock = FileLock(str(folder / ".lock"))
    if first_process:
        folder.mkdir(parents=True, exist_ok=True)
        try:
            lock.acquire(timeout=0)
        except Timeout:
            raise ConfigError(
                f"another process is at work in {folder}", "wait for it, or stop it first"
            ) from None
    resolved = cast(dict[str, Any], OmegaConf.to_container(cfg, resolve=True))
    record = RunRecord(
        record_path,
        {
            "id": folder.name,
            "model": cfg.choices.model,
            "data": cfg.choices.data,
            "ablation": cfg.choices.ablation,
            "seed": cfg.seed,
            "identity": run_identity(cfg),
            "config": resolved,
        },
        writes=first_process,
    )
    try:
        return _run(cfg, folder, record)
    except RunInterrupted as error:
        record.finish("interrupted", str(error))
        raise
    except (KeyboardInterrupt, SystemExit):  # Lightning turns the first into the second
        record.finish("interrupted", "stopped by Ctrl-C")
        raise RunInterrupted("stopped", f"continue with: {_resume_command()}") from None
    except BaseException as error:
        record.finish("failed", f"{type(error).__name__}: {error}")
        raise
    finally:
        lock.release()
        wandb = sys.modules.get("wandb")
        if wandb is not None and wandb.run is not None:
            wandb.finish()  # or the next job of a multirun would log into this one's run


def _run(cfg: DictConfig, folder: Path, record: RunRecord) -> RunResult:
    lightning.seed_everything(cfg.seed, verbose=False)
    data = _build(cfg.data)
    with _timed(record, "prepare_corpus"):
        store: Store = data.prepare_store()
    logger.info("%s", store.describe())
    _require_same(record.values["data_fingerprint"], store.fingerprint, "the corpus")
    record.update(data_fingerprint=store.fingerprint)

    # Everything that can be wrong with the settings is found before anything slow begins.
    lightning.seed_everything(cfg.seed, verbose=False)
    model: LightningModule = _build(cfg.model, corpus=store.facts())
    data.attach(model)
    for windows in (data.train_dataloader, data.val_dataloader, data.test_dataloader):
        windows()
    without_words = sum(not recording.has_words for recording in store.recordings)
    if "words" in data.needs and without_words:
        logger.warning(
            "%d of %d recordings have no transcript: their words are padding",
            without_words,
            len(store.recordings),
        )

    encoder: GestureEncoder | None = None
    references: dict[str, References] = {}
    if isinstance(model, GestureMethod):
        with _timed(record, "encoder"):
            encoder = _encoder(store, cfg.metrics)
            for split in ("val", "test"):
                references[split] = reference_rows(
                    store, encoder, split, cfg.metrics.reference_seed
                )
        known = (record.values["encoder"] or {}).get("sha256")
        _require_same(known, encoder.sha256, "the encoder of the evaluation")
        record.update(encoder={"sha256": encoder.sha256, "name": str(cfg.metrics.encoder)})

    context = RunContext(folder, store, encoder, references, record, _resume_command())
    callbacks = [_with_context(node, context) for node in (cfg.callbacks or {}).values() if node]
    loggers: list[Logger] = [instantiate(node) for node in (cfg.logger or {}).values()]
    for experiment_logger in loggers:
        experiment_logger.log_hyperparams(
            cast(dict[str, Any], OmegaConf.to_container(cfg.model, resolve=True))
            | {"seed": cfg.seed, **cast(dict, OmegaConf.to_container(cfg.choices))}
        )
    trainer: Trainer = instantiate(
        cfg.trainer, callbacks=callbacks, logger=loggers or False, default_root_dir=str(folder)
    )

    with _timed(record, "fit"):
        # The encoder may have been trained just now; the run's draws must not depend on it.
        lightning.seed_everything(cfg.seed, verbose=False)
        trainer.fit(
            model,
            datamodule=cast(LightningDataModule, data),
            ckpt_path=_checkpoint(cfg, folder),
            weights_only=True,
        )
    best = _best_checkpoint(trainer)
    objective = (
        None if best is None or best.best_model_score is None else float(best.best_model_score)
    )
    record.update(objective=objective)

    if best is not None and best.best_model_path:
        _load_weights(model, Path(best.best_model_path))
    if isinstance(model, MotionAutoencoder) and trainer.is_global_zero:
        _keep_encoder(cfg, folder, store, model)
    if cfg.test and isinstance(model, GestureMethod):
        assert encoder is not None
        with _timed(record, "test"):
            windows = trainer.test(model, datamodule=cast(LightningDataModule, data), verbose=False)
        if not trainer.is_global_zero:
            return RunResult(folder, record.values, objective, model)
        with _timed(record, "test_recordings"):
            recordings = evaluate_recordings(
                model, store, "test", encoder, limit=_limit(cfg.trainer.get("limit_test_batches"))
            )
        record.update(
            final={
                "split": "test",
                "windows": {
                    name.removeprefix("test/"): float(value) for name, value in windows[0].items()
                },
                "recordings": recordings,
            },
            references=references["test"],
        )
        print(result_table(record.values))
    record.finish("ok")
    samples = [folder / name for name in record.values["samples"]]
    print(f"\nrun:    {folder}")
    if samples:
        print(f"listen: {samples[-1].resolve()}")
    return RunResult(folder, record.values, objective, model)


def prepare(cfg: DictConfig) -> Store:
    """Prepare a corpus and say what is in it.

    Args:
        cfg: Composed from ``conf/prepare.yaml``.
    """
    data = _build(cfg.data)
    store: Store = data.prepare_store()
    print(store.describe())
    for skipped in store.manifest["skipped"]:
        print(f"  skipped {skipped['id']}: {skipped['reason']}")
    print(f"store: {store.path}")
    return store


def evaluate(cfg: DictConfig) -> Any:
    """Judge a finished run again, or run a study of the metrics.

    Args:
        cfg: Composed from ``conf/evaluate.yaml``.

    Raises:
        ConfigError: Neither ``run`` nor ``study`` is given, or the run has no checkpoint.
    """
    folder = Path(cfg.run_dir)
    if cfg.run is None and OmegaConf.select(cfg, "study_task") is None:
        raise ConfigError(
            "say what to evaluate",
            "python evaluate.py run=outputs/runs/ID, or python evaluate.py study=fgd_noise",
        )
    if cfg.run is None:
        data = _build(cfg.data)
        store = data.prepare_store()
        encoder = _encoder(store, cfg.metrics)
        study = _build(cfg.study_task)
        return study(store=store, encoder=encoder, split=cfg.split, folder=folder)
    values = read_record(Path(cfg.run) / "record.json")
    checkpoint = Path(cfg.run) / "checkpoints" / "best.ckpt"
    if not values or not checkpoint.is_file():
        raise ConfigError(
            f"run={cfg.run}: no record.json with checkpoints/best.ckpt there",
            "give the folder of a finished run, e.g. outputs/runs/ID",
        )
    store = _build(values["config"]["data"]).prepare_store()
    _require_same(values["data_fingerprint"], store.fingerprint, "the corpus")
    model = _build(values["config"]["model"], corpus=store.facts())
    if not isinstance(model, GestureMethod):
        raise ConfigError(f"run={cfg.run}: a {values['model']} makes no motion to judge")
    _load_weights(model, checkpoint)
    given = any(item.startswith("metrics") for item in HydraConfig.get().overrides.task)
    metrics = cfg.metrics if given else OmegaConf.create(values["config"]["metrics"])
    encoder = _encoder(store, metrics)
    values["encoder"] = {"sha256": encoder.sha256, "name": str(metrics.encoder)}
    values["final"] = {
        "split": cfg.split,
        "recordings": evaluate_recordings(model, store, cfg.split, encoder),
    }
    values["references"] = reference_rows(store, encoder, cfg.split, metrics.reference_seed)
    print(result_table(values))
    write_json(folder / "evaluation.json", {k: values[k] for k in _EVALUATION_KEYS})
    return values["final"]


_EVALUATION_KEYS = ("id", "model", "data", "ablation", "seed", "encoder", "final", "references")


def _encoder(store: Store, metrics: DictConfig) -> GestureEncoder:
    return encoder_for(store, metrics.encoder, metrics.encoder_epochs, metrics.encoder_seed)


def _build(node: Any, **arguments: Any) -> Any:
    """Hydra's `instantiate`, but a `CospeechError` of the constructor comes out as it is."""
    try:
        return instantiate(node, _convert_="all", **arguments)
    except InstantiationException as error:
        if isinstance(error.__cause__, CospeechError):
            raise error.__cause__ from None
        raise


def _require_same(known: str | None, now: str, what: str) -> None:
    """A resumed or re-evaluated run must meet what it was trained and judged on."""
    if known is not None and known != now:
        raise ConfigError(
            f"{what} has changed since this run was made ({known[:10]} -> {now[:10]}), so its"
            " numbers would not belong together",
            "put the old files back, or start a new run",
        )


def _keep_encoder(cfg: DictConfig, folder: Path, store: Store, model: MotionAutoencoder) -> None:
    """The explicitly trained encoder, beside the run and, if made as by default, in the store."""
    path = folder / "encoder.pt"
    save_encoder(model.encoder(str(folder.name)), path)
    as_by_default = (
        cfg.training.batch_size == BATCH_SIZE
        and model.learning_rate == MotionAutoencoder(store.facts()).learning_rate
        and not any(str(key).startswith("limit_") for key in cfg.trainer)
    )
    if as_by_default:
        path = keep_encoder(store, model.encoder(), cfg.training.epochs, cfg.seed)
    logger.info("encoder kept in %s; judge with it: metrics.encoder=%s", path, path)


def _load_weights(model: LightningModule, path: Path) -> None:
    checkpoint = torch.load(path, map_location="cpu", weights_only=True)
    model.load_state_dict(checkpoint["state_dict"])


def _with_context(node: DictConfig, context: RunContext) -> Callback:
    """A callback; those of ours are partials that wait for the run's context."""
    callback = instantiate(node, _convert_="all")
    return callback(run=context) if isinstance(callback, functools.partial) else callback


def _best_checkpoint(trainer: Trainer) -> ModelCheckpoint | None:
    for callback in trainer.checkpoint_callbacks:
        if isinstance(callback, ModelCheckpoint) and callback.monitor is not None:
            return callback
    return None


def _checkpoint(cfg: DictConfig, folder: Path) -> str | None:
    """The checkpoint to continue from, if any."""
    if cfg.ckpt_path is None:
        return None
    if cfg.ckpt_path != "last":
        path = Path(cfg.ckpt_path)
        if not path.is_file():
            raise ConfigError(f"ckpt_path={path}: no such file", "give a .ckpt file, or `last`")
        return str(path)
    last = folder / "checkpoints" / "last.ckpt"
    if last.is_file():
        logger.info("continuing from %s", last)
        return str(last)
    logger.info("no checkpoint yet in %s: starting from the beginning", folder)
    return None


def _limit(batches: Any) -> int | None:
    """In a debug run that limits test batches, as many whole recordings."""
    return batches if isinstance(batches, int) else None


class _timed:
    """Adds the seconds inside to the record, whatever happens there."""

    def __init__(self, record: RunRecord, name: str) -> None:
        self.record, self.name = record, name

    def __enter__(self) -> None:
        self.start = time.perf_counter()

    def __exit__(self, *error: object) -> None:
        self.record.add_timing(self.name, time.perf_counter() - self.start)


def _resume_command() -> str:
    arguments = [a for a in sys.argv[1:] if not a.startswith("ckpt_path=")]
    hydra = HydraConfig.get()
    if hydra.mode == RunMode.MULTIRUN and not any(a.startswith("study") for a in arguments):
        arguments.append(f"study_name={Path(hydra.sweep.dir).name}")
    return shlex.join([Path(sys.executable).name, sys.argv[0], *arguments, "ckpt_path=last"])


# Run folders ---------------------------------------------------------------------------------


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


_SAYS_NOTHING = (
    ".*LeafSpec.*",
    ".*smaller than the logging interval.*",
    ".*exists and is not empty.*",
)
"""Warnings of our libraries that a user of ours can't act on."""


# Command lines -------------------------------------------------------------------------------


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
        print(f"\nerror: {error}", file=sys.stderr)
        sys.exit(1)
