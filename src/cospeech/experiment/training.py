"""One run: prepare, train, evaluate, record."""

from __future__ import annotations

import functools
import logging
import os
import sys
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any, cast

import lightning
from filelock import FileLock, Timeout
from hydra.utils import instantiate
from lightning import Callback, LightningDataModule, LightningModule, Trainer
from lightning.pytorch.callbacks import ModelCheckpoint
from lightning.pytorch.loggers import Logger
from lightning.pytorch.utilities.model_helpers import is_overridden
from omegaconf import DictConfig, OmegaConf

from cospeech.corpus.facts import placeholder_facts
from cospeech.corpus.store import Store
from cospeech.encoders import BATCH_SIZE, keep_encoder
from cospeech.errors import ConfigError, CospeechError, one_line
from cospeech.evaluation import Catalogue, References, evaluate_recordings, reference_rows
from cospeech.experiment.building import (
    build,
    chosen_catalogue,
    chosen_encoder,
    load_weights,
    require_same,
)
from cospeech.experiment.context import RunContext, RunInterrupted, RunResult
from cospeech.experiment.enduring import costs_itself, enduring, other_arithmetic
from cospeech.experiment.folders import resume_command, run_identity
from cospeech.experiment.judgeable import refuse_absent_monitors, refuse_unjudgeable
from cospeech.experiment.stopping import (
    be_the_first_process,
    end_with_the_first_process,
    stopped_like_ctrl_c,
)
from cospeech.methods.base import GestureMethod
from cospeech.methods.capabilities import HandsOverEncoder
from cospeech.methods.fitted import FittedWithoutSteps
from cospeech.metrics.encoder import GestureEncoder, save_encoder
from cospeech.nn.checkpoints import LAST, is_kept
from cospeech.quoting import setting
from cospeech.reporting.record import RunRecord, read_record
from cospeech.reporting.tables import result_table

logger = logging.getLogger(__name__)

_LOST_PEER = ("closed by peer", "reset by peer", "Broken pipe", "NCCL", "Connection refused")


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
        done = earlier.get("fit", {}).get("ended", 0)
        if earlier.get("status") == "ok" and 0 <= cfg.training.epochs < done:
            raise ConfigError(
                f"training.epochs={cfg.training.epochs}: {folder} has {done} epochs already",
                "ask for as many or for more, or leave ckpt_path out for a new run",
            )
    first_process = int(os.environ.get("LOCAL_RANK", 0)) == 0
    lock = FileLock(str(folder / ".lock"))
    if first_process:
        be_the_first_process()
        folder.mkdir(parents=True, exist_ok=True)
        try:
            lock.acquire(timeout=0)
        except Timeout:
            raise ConfigError(
                f"another process is at work in {folder}", "wait for it, or stop it first"
            ) from None
    else:
        end_with_the_first_process()
    try:
        return _recorded(cfg, folder, writes=first_process)
    finally:
        lock.release()


def _recorded(cfg: DictConfig, folder: Path, writes: bool) -> RunResult:
    """The run; its record says how it ended."""
    resolved = cast(dict[str, Any], OmegaConf.to_container(cfg, resolve=True))
    record = RunRecord(
        folder / "record.json",
        {
            "id": one_line(folder.name),
            "model": cfg.choices.model,
            "data": cfg.choices.data,
            "ablation": cfg.choices.ablation,
            "seed": cfg.seed,
            "identity": run_identity(cfg),
            "config": resolved,
        },
        writes=writes,
    )
    try:
        with stopped_like_ctrl_c():
            return _run(cfg, folder, record)
    except RunInterrupted as error:
        _close(record, "interrupted", str(error))
        raise
    except (KeyboardInterrupt, SystemExit):  # Lightning turns the first into the second
        _close(record, "interrupted", "stopped by Ctrl-C or by the system")
        raise RunInterrupted("stopped", f"continue with: {resume_command()}") from None
    except BaseException as error:
        lost_peer = _lost_peer(error)
        told = lost_peer or error
        _close(record, "failed", f"{type(told).__name__}: {told}")
        if lost_peer is None:
            raise
        raise lost_peer from error
    finally:
        wandb = sys.modules.get("wandb")
        if wandb is not None and wandb.run is not None:
            with costs_itself("wandb"):
                wandb.finish()  # or the next job of a multirun would log into this one's run


def _close(record: RunRecord, status: str, error: str) -> None:
    """Say in the record how a run ended, unless it had ended well or can't be written any more."""
    if record.values["status"] != "ok":
        with costs_itself("the record"):
            record.finish(status, error)


def _lost_peer(error: BaseException) -> CospeechError | None:
    """The sentence for what torch's backends say when a process of a distributed run has gone."""
    said = isinstance(error, RuntimeError) and any(part in str(error) for part in _LOST_PEER)
    if not said or "LOCAL_RANK" not in os.environ:
        return None
    return CospeechError(
        "another process of this run has ended", f"continue with: {resume_command()}"
    )


def _run(cfg: DictConfig, folder: Path, record: RunRecord) -> RunResult:
    data = build(cfg.data)
    # What is wrong with the settings is found before anything slow begins, of any corpus ...
    tried = build(cfg.model, corpus=placeholder_facts())
    refuse_unjudgeable(cfg.choices.model, tried)
    data.refuse_impossible(cfg.choices.model, tried.needs)
    catalogue = Catalogue({})
    judged = frozenset[str]()
    if isinstance(tried, GestureMethod):
        catalogue = chosen_catalogue(cfg.metrics)
        refuse_absent_monitors(_monitors(cfg), catalogue, tried)
        judged = catalogue.fields
        data.refuse_impossible("the evaluation", judged)
    lightning.seed_everything(cfg.seed, verbose=False)
    with _timed(record, "prepare_corpus"):
        store: Store = data.prepare_store()
    logger.info("%s", store.describe())
    require_same(record.values["data_fingerprint"], store.fingerprint, "the corpus")
    record.update(data_fingerprint=store.fingerprint)

    # ... and of this one, before its encoder is trained.
    lightning.seed_everything(cfg.seed, verbose=False)
    model: LightningModule = build(cfg.model, corpus=store.facts())
    checkpoint = _checkpoint(cfg, folder)
    if checkpoint is None and isinstance(model, GestureMethod):
        model.read_files()
    data.attach(model, judged)
    for windows in (data.train_dataloader, data.val_dataloader, data.test_dataloader):
        windows()
    without_words = store.recordings.columns["has_words"].count(False)
    if "words" in data.needs and without_words:
        logger.warning(
            "%d of %d recordings have no transcript: their words are padding",
            without_words,
            len(store.recordings),
        )

    encoder: GestureEncoder | None = None
    references: References = {}
    if isinstance(model, GestureMethod):
        with _timed(record, "encoder"):
            encoder = chosen_encoder(store, cfg.metrics)
            references = reference_rows(
                store, encoder, "test", cfg.metrics.reference_seed, catalogue
            )
        known = (record.values["encoder"] or {}).get("sha256")
        require_same(known, encoder.sha256, "the encoder of the evaluation")
        record.update(
            encoder={"sha256": encoder.sha256, "name": str(cfg.metrics.encoder)},
            metrics=catalogue.described(),
        )

    context = RunContext(folder, store, encoder, catalogue, record, resume_command())
    callbacks = [_with_context(node, context) for node in (cfg.callbacks or {}).values() if node]
    loggers: list[Logger] = [enduring(instantiate(node)) for node in (cfg.logger or {}).values()]
    for experiment_logger in loggers:
        experiment_logger.log_hyperparams(
            cast(dict[str, Any], OmegaConf.to_container(cfg.model, resolve=True))
            | {"seed": cfg.seed, **cast(dict, OmegaConf.to_container(cfg.choices, resolve=True))}
        )
    # A fit that has ended is only loaded again, and the run goes on behind it.
    fit = record.values["fit"] or {}
    has_ended = fit.get("asked") == cfg.training.epochs
    settings: dict[str, Any] = {"max_epochs": fit["ended"]} if has_ended else {}
    if isinstance(model, FittedWithoutSteps):
        # There is nothing to share among processes, and torch's refuse what has no weights.
        settings |= {"devices": 1, "strategy": "auto"}
    trainer: Trainer = instantiate(
        cfg.trainer,
        callbacks=callbacks,
        logger=loggers or False,
        default_root_dir=str(folder),
        **settings,
    )
    device = f"{trainer.world_size} x {trainer.strategy.root_device.type}"
    record.update(hardware={**record.values["hardware"], "device": device})
    for difference in other_arithmetic(record.earlier, record.values):
        logger.warning("%s, so the run won't end bit-equal to an unbroken one", difference)

    with _timed(record, "fit"):
        # The encoder may have been trained just now; the run's draws must not depend on it.
        lightning.seed_everything(cfg.seed, verbose=False)
        trainer.fit(
            model,
            datamodule=cast(LightningDataModule, data),
            ckpt_path=checkpoint,
            weights_only=True,
        )
    best = _best_checkpoint(trainer)
    objective = (
        None if best is None or best.best_model_score is None else float(best.best_model_score)
    )
    record.update(objective=objective)

    if best is not None and best.best_model_path:
        again = "train it again: the same command without ckpt_path"
        if isinstance(model, GestureMethod):
            told = f"python evaluate.py {setting('run', str(folder))} checkpoint=last"
            again += f"; or judge its last weights: {told}"
        load_weights(model, Path(best.best_model_path), again)
    if isinstance(model, HandsOverEncoder) and trainer.is_global_zero:
        _keep_encoder(cfg, folder, store, model)
    if cfg.test and (isinstance(model, GestureMethod) or is_overridden("test_step", model)):
        with _timed(record, "test"):
            windows = trainer.test(model, datamodule=cast(LightningDataModule, data), verbose=False)
        if not trainer.is_global_zero:
            return RunResult(folder, record.values, objective, model)
        values = {name.removeprefix("test/"): float(value) for name, value in windows[0].items()}
        final: dict[str, Any] = {"split": "test", "windows": values}
        if isinstance(model, GestureMethod):
            assert encoder is not None
            limit = _limit(cfg.trainer.get("limit_test_batches"))
            with _timed(record, "test_recordings"):
                made = evaluate_recordings(model, store, "test", encoder, catalogue, limit=limit)
            final["recordings"] = made
            for experiment_logger in loggers:
                of_recordings = {f"test_recordings/{name}": value for name, value in made.items()}
                experiment_logger.log_metrics(of_recordings, trainer.global_step)
                # The trainer has closed it already; this writes what has come since.
                experiment_logger.finalize("success")
        record.update(final=final, references=references)
    record.finish("ok")
    with costs_itself("the summary"):  # what is done is done, whatever the terminal makes of it
        _summarise(folder, record)
    return RunResult(folder, record.values, objective, model)


def _summarise(folder: Path, record: RunRecord) -> None:
    if record.values["references"]:
        print(result_table(record.values))
    samples = [folder / name for name in record.values["samples"]]
    print(f"\nrun:    {folder}")
    if samples:
        print(f"listen: {samples[-1].resolve()}")


def _keep_encoder(cfg: DictConfig, folder: Path, store: Store, model: HandsOverEncoder) -> None:
    """The explicitly trained encoder, beside the run and, if made as by default, in the store."""
    path = folder / "encoder.pt"
    save_encoder(model.encoder(str(folder.name)), path)
    as_by_default = (
        cfg.training.batch_size == BATCH_SIZE
        and model.is_usual
        and not any(str(key).startswith("limit_") for key in cfg.trainer)
    )
    if as_by_default:
        path = keep_encoder(store, model.encoder(), cfg.training.epochs, cfg.seed)
    logger.info("encoder kept in %s; judge with it: metrics.encoder=%s", path, path)


def _with_context(node: DictConfig, context: RunContext) -> Callback:
    """A callback; those of ours are partials that wait for the run's context."""
    callback = instantiate(node, _convert_="all")
    return callback(run=context) if isinstance(callback, functools.partial) else callback


def _monitors(cfg: DictConfig) -> dict[str, str]:
    """What callbacks watch, by the setting that says so."""
    found = dict[str, str]()
    for name, node in (cfg.callbacks or {}).items():
        if node and isinstance(monitor := node.get("monitor"), str):
            shared = node._get_node("monitor")._value() == "${training.monitor}"
            found["training.monitor" if shared else f"callbacks.{name}.monitor"] = monitor
    return found


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
    last = folder / "checkpoints" / LAST
    if is_kept(last):
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
        with costs_itself("a timing") if any(error) else nullcontext():
            self.record.add_timing(self.name, time.perf_counter() - self.start)
