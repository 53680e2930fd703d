"""Studies of several finished runs side by side."""

from __future__ import annotations

import inspect
import logging
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf

from cospeech.corpus.store import Store
from cospeech.errors import ConfigError, CospeechError
from cospeech.experiment.building import build, require_same
from cospeech.experiment.finished_run import CHECKPOINTS, FinishedRun, open_run
from cospeech.experiment.own_or_given import corpus_of, encoder_of
from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
from cospeech.methods.base import GestureMethod
from cospeech.methods.capabilities import HasSchedule, HoldsPhaseClassifier, MakesJoints
from cospeech.reporting.collect import collect
from cospeech.studies.trained_system import TrainedSystem

logger = logging.getLogger(__name__)


def compare_runs(cfg: DictConfig, folder: Path) -> Any:
    """Load the finished runs that ``cfg.runs`` names and hand them to the study.

    A study that asks for a ``classifier`` is of runs that make gesturing joints, and of one
    training study; any other takes runs of any method, under the names of model and ablation.

    Args:
        cfg: Composed from ``conf/evaluate.yaml`` and a study with ``runs``: a folder with runs
            below it, a run's folder, or a list of such.
        folder: Where the study writes.

    Raises:
        ConfigError: ``runs`` isn't set, ``checkpoint`` is neither best nor last, no run there is
            finished, or they don't belong together: several corpora, schedules, or runs of one
            name and seed.
    """
    named = None if OmegaConf.is_missing(cfg, "runs") else cfg.runs
    folders = [named] if isinstance(named, str) else [str(each) for each in named or () if each]
    if not folders:
        raise ConfigError("runs is not set", "add runs=DIR, a folder with finished runs below it")
    if cfg.checkpoint not in CHECKPOINTS:
        raise ConfigError(f"checkpoint={cfg.checkpoint!r} is not one of {', '.join(CHECKPOINTS)}")
    runs = _finished_below(folders, cfg.checkpoint)
    study = build(cfg.study_task)
    if "classifier" in inspect.signature(study).parameters:
        return _compare_joints(study, runs, cfg, folder)
    return _compare_methods(study, runs, cfg, folder)


def _compare_joints(
    study: Callable[..., Any], runs: Sequence[FinishedRun], cfg: DictConfig, folder: Path
) -> Any:
    """Runs that make gesturing joints, with what tells their phases."""
    makers = [run for run in runs if issubclass(run.method, MakesJoints)]
    if not makers:
        raise ConfigError(
            f"runs={cfg.runs}: of {len(runs)} finished runs none makes gesturing joints",
            "train some first: python train.py study=multi_adversary_ablations",
        )
    _require_one_study(makers)
    store = corpus_of(makers[0], cfg)
    encoder, _ = encoder_of(makers[0], cfg, store)
    systems = _loaded(makers, _name, store, cfg.checkpoint)
    classifier, judge = _phase_judge(cfg.classifier, systems)
    return study(
        store=store,
        encoder=encoder,
        split=cfg.split,
        folder=folder,
        systems=systems,
        classifier=classifier,
        about=[*_about(makers, cfg), ("phases judged by", judge)],
    )


def _compare_methods(
    study: Callable[..., Any], runs: Sequence[FinishedRun], cfg: DictConfig, folder: Path
) -> Any:
    """Runs of any method that makes motion, on one corpus."""
    makers = [run for run in runs if issubclass(run.method, GestureMethod)]
    if not makers:
        raise ConfigError(
            f"runs={cfg.runs}: of {len(runs)} finished runs none makes motion",
            "train some first: python train.py model=NAME",
        )
    _require_seeds(makers, _full_name, "give each variant an ablation's yaml, or judge it alone")
    store = corpus_of(makers[0], cfg)
    return study(
        store=store,
        split=cfg.split,
        folder=folder,
        systems=_loaded(makers, _full_name, store, cfg.checkpoint),
        about=_about(makers, cfg),
    )


def _about(runs: Sequence[FinishedRun], cfg: DictConfig) -> list[tuple[str, str]]:
    return [
        ("checkpoints", str(cfg.checkpoint)),
        ("runs", ", ".join(run.folder.name for run in runs)),
    ]


def _loaded(
    runs: Sequence[FinishedRun],
    name_of: Callable[[FinishedRun], str],
    store: Store,
    checkpoint: str,
) -> list[TrainedSystem]:
    systems = []
    for run in runs:
        require_same(run.fingerprint, store.fingerprint, f"{run.folder}: the corpus")
        model = run.load(store)
        if checkpoint == "last" and isinstance(model, HasSchedule) and model.steps_left:
            raise ConfigError(
                f"{run.folder}: {model.steps_left} steps of its schedule are left",
                "train it to its end (ckpt_path=last), or say checkpoint=best",
            )
        systems.append(TrainedSystem(name_of(run), run.seed, model))
    return systems


def _finished_below(folders: Sequence[str], checkpoint: str) -> list[FinishedRun]:
    """The finished runs below folders; those that can't be used are named in warnings."""
    found = dict[Path, FinishedRun]()
    for listed in (run for folder in folders for run in collect(folder).runs):
        if listed.folder.resolve() in found:
            continue
        if listed.status != "ok":
            logger.warning("%s is left out: %s", listed.folder, listed.status)
            continue
        try:
            found[listed.folder.resolve()] = open_run(listed.folder, checkpoint)
        except CospeechError as error:
            logger.warning("%s is left out: %s", listed.folder, error)
    return list(found.values())


def _phase_judge(
    path: str | None, systems: list[TrainedSystem]
) -> tuple[FrozenPhaseClassifier | None, str]:
    """What tells phases, and where it is from."""
    if path is not None:
        return FrozenPhaseClassifier.load(path), str(path)
    for system in sorted(systems, key=lambda system: system.name != "full"):
        holder = system.method
        if isinstance(holder, HoldsPhaseClassifier) and holder.classifier is not None:
            text = (
                f"the classifier inside {system.name}, seed {system.seed}: that system was trained"
                " against it, which flatters it; classifier=FILE takes another"
            )
            return holder.classifier, text
    return None, "nothing"


def _name(run: FinishedRun) -> str:
    return run.ablation.split("__")[-1]


def _full_name(run: FinishedRun) -> str:
    return run.model if run.ablation == "full" else f"{run.model} {_name(run)}"


def _require_one_study(runs: Sequence[FinishedRun]) -> None:
    """Rows of one study differ by their ablation and seed, and by nothing else.

    Raises:
        ConfigError: Two runs of one name and seed, or of one name and different settings, or of
            different experiments.
    """
    hint = "give a folder with the runs of one study: runs=outputs/studies/NAME"
    _require_seeds(runs, _name, hint)
    for run in runs:
        if (a := runs[0].experiment) != (b := run.experiment):
            raise ConfigError(
                f"{runs[0].folder} is of experiment={a}, {run.folder} of experiment={b}", hint
            )


def _require_seeds(
    runs: Sequence[FinishedRun], name_of: Callable[[FinishedRun], str], hint: str
) -> None:
    """Runs of one name are seeds of one training.

    Raises:
        ConfigError: Two runs of one name and seed, or of one name and different settings.
    """
    seen = dict[str, FinishedRun]()
    for run in runs:
        name = name_of(run)
        first = seen.setdefault(name, run)
        twin = seen.setdefault(f"{name}, seed {run.seed}", run)
        if twin is not run:
            raise ConfigError(
                f"{twin.folder} and {run.folder} are both {name}, seed {run.seed}", hint
            )
        if _settings(first) != _settings(run):
            raise ConfigError(f"{first.folder} and {run.folder} have different settings", hint)


def _settings(run: FinishedRun) -> dict[str, Any]:
    model = {key: value for key, value in run.config["model"].items() if key != "products_dir"}
    return {"method": run.method, "model": model, "training": run.config["training"]}
