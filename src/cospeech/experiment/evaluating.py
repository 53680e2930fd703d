"""Judging a finished run again, and studies of the metrics."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf

from cospeech.corpus.splits import SPLITS
from cospeech.corpus.store import Store
from cospeech.errors import ConfigError
from cospeech.evaluation import evaluate_recordings, reference_rows
from cospeech.experiment.building import build, chosen_encoder
from cospeech.experiment.comparing import compare_runs
from cospeech.experiment.finished_run import FinishedRun, open_run
from cospeech.experiment.own_or_given import catalogue_of, corpus_of, encoder_of
from cospeech.methods.base import GestureMethod
from cospeech.reporting.record import write_json
from cospeech.reporting.tables import result_table


def evaluate(cfg: DictConfig) -> Any:
    """Judge a finished run again, or run a study of the metrics.

    Args:
        cfg: Composed from ``conf/evaluate.yaml``.

    Raises:
        ConfigError: There is no such ``split``, neither ``run`` nor ``study`` is given, or what
            `open_run` refuses.
    """
    folder = Path(cfg.run_dir)
    if cfg.split not in SPLITS:
        raise ConfigError(f"split={cfg.split} is not one of {', '.join(SPLITS)}")
    if cfg.run is None and OmegaConf.select(cfg, "study_task") is None:
        raise ConfigError(
            "say what to evaluate",
            "python evaluate.py run=outputs/runs/ID, or python evaluate.py study=fgd_noise",
        )
    if "runs" in cfg:
        return compare_runs(cfg, folder)
    if OmegaConf.select(cfg, "study_task") is not None:
        return _study(cfg, folder)
    run, store, model = _finished(cfg)
    encoder, metrics = encoder_of(run, cfg, store)
    catalogue = catalogue_of(run, cfg)
    values: dict[str, Any] = {
        "id": run.id,
        "model": run.model,
        "data": run.data,
        "ablation": run.ablation,
        "seed": run.seed,
        "checkpoint": cfg.checkpoint,
        "encoder": {"sha256": encoder.sha256, "name": str(metrics.encoder)},
        "metrics": catalogue.described(),
        "final": {
            "split": cfg.split,
            "recordings": evaluate_recordings(model, store, cfg.split, encoder, catalogue),
        },
        "references": reference_rows(store, encoder, cfg.split, metrics.reference_seed, catalogue),
    }
    write_json(folder / "evaluation.json", values)
    print(result_table(values))
    return values["final"]


def _study(cfg: DictConfig, folder: Path) -> Any:
    """A study of a corpus, or of a run where it names one; it is given what it has parameters for.

    Raises:
        ConfigError: The study is of a run, and none is given.
    """
    study = build(cfg.study_task)
    wanted = inspect.signature(study).parameters
    given: dict[str, Any] = {"split": cfg.split, "folder": folder}
    if "method" in wanted:
        if cfg.run is None:
            raise ConfigError(
                "this study is of a finished run", "add run=outputs/runs/ID to the command"
            )
        run, given["store"], given["method"] = _finished(cfg)
        given["about"] = [("run", run.id)]
        if "encoder" in wanted:
            given["encoder"], _ = encoder_of(run, cfg, given["store"])
        return study(**given)
    if cfg.run is not None:
        raise ConfigError(
            f"run={cfg.run}: this study is of a corpus, and of no run",
            "leave run out; data=NAME chooses the corpus",
        )
    given["store"] = build(cfg.data).prepare_store()
    if "encoder" in wanted:
        given["encoder"] = chosen_encoder(given["store"], cfg.metrics)
    return study(**given)


def _finished(cfg: DictConfig) -> tuple[FinishedRun, Store, GestureMethod]:
    """The run, corpus and trained method of ``cfg.run``."""
    run = open_run(str(cfg.run), cfg.checkpoint)
    store = corpus_of(run, cfg)
    return run, store, run.load(store)
