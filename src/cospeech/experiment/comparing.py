"""Studies of several finished runs side by side."""

from __future__ import annotations

import inspect
import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf

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
    """Load the finished runs under ``cfg.runs`` and hand them to the study.

    A study that judges phases, by a ``classifier``, gets the runs that make gesturing joints; any
    other those of all methods.

    Args:
        cfg: Composed from ``conf/evaluate.yaml`` and a study with ``runs``.
        folder: Where the study writes.

    Raises:
        ConfigError: ``runs`` isn't set, ``checkpoint`` is neither best nor last, no run there is
            finished, or they don't belong together: several corpora, schedules, or runs of one
            name and seed.
    """
    if OmegaConf.is_missing(cfg, "runs"):
        raise ConfigError("runs is not set", "add runs=DIR, a folder with finished runs below it")
    if cfg.checkpoint not in CHECKPOINTS:
        raise ConfigError(f"checkpoint={cfg.checkpoint!r} is not one of {', '.join(CHECKPOINTS)}")
    runs = _finished_below(cfg.runs, cfg.checkpoint)
    study = build(cfg.study_task)
    wanted = inspect.signature(study).parameters
    judges_phases = "classifier" in wanted
    capable = MakesJoints if judges_phases else GestureMethod
    makers = [run for run in runs if issubclass(run.method, capable)]
    if not makers and judges_phases:
        raise ConfigError(
            f"runs={cfg.runs}: of {len(runs)} finished runs none makes gesturing joints",
            "train some first: python train.py study=multi_adversary_ablations",
        )
    if not makers:
        raise ConfigError(
            f"runs={cfg.runs}: of {len(runs)} finished runs none makes motion",
            "give a folder with runs of a method: runs=outputs/runs/ID, or outputs/studies/NAME",
        )
    _require_one_study(makers)
    store = corpus_of(makers[0], cfg)
    systems: list[TrainedSystem] = []
    for run in makers:
        require_same(run.fingerprint, store.fingerprint, f"{run.folder}: the corpus")
        model = run.load(store)
        if cfg.checkpoint == "last" and isinstance(model, HasSchedule) and model.steps_left:
            raise ConfigError(
                f"{run.folder}: {model.steps_left} steps of its schedule are left",
                "train it to its end (ckpt_path=last), or say checkpoint=best",
            )
        systems.append(TrainedSystem(_name(run), run.seed, model))
    about = [
        ("checkpoints", str(cfg.checkpoint)),
        ("runs", ", ".join(run.folder.name for run in makers)),
    ]
    given: dict[str, Any] = {}
    if "encoder" in wanted:
        given["encoder"], _ = encoder_of(makers[0], cfg, store)
    if judges_phases:
        given["classifier"], judge = _phase_judge(cfg.classifier, systems)
        about.append(("phases judged by", judge))
    return study(store=store, split=cfg.split, folder=folder, systems=systems, about=about, **given)


def _finished_below(folder: str, checkpoint: str) -> list[FinishedRun]:
    """The finished runs below a folder; those that can't be used are named in warnings."""
    found = []
    for listed in collect(folder).runs:
        if listed.status != "ok":
            logger.warning("%s is left out: %s", listed.folder, listed.status)
            continue
        try:
            found.append(open_run(listed.folder, checkpoint))
        except CospeechError as error:
            logger.warning("%s is left out: %s", listed.folder, error)
    return found


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


def _require_one_study(runs: Sequence[FinishedRun]) -> None:
    """Rows of one study differ by their ablation and seed, and by nothing else.

    Raises:
        ConfigError: Two runs of one name and seed, or of one name and different settings, or of
            different experiments.
    """
    hint = "give a folder with the runs of one study: runs=outputs/studies/NAME"
    seen = dict[str, FinishedRun]()
    for run in runs:
        name = _name(run)
        first = seen.setdefault(name, run)
        twin = seen.setdefault(f"{name}, seed {run.seed}", run)
        if twin is not run:
            raise ConfigError(
                f"{twin.folder} and {run.folder} are both {name}, seed {run.seed}", hint
            )
        if _settings(first) != _settings(run):
            raise ConfigError(f"{first.folder} and {run.folder} have different settings", hint)
        if (a := runs[0].experiment) != (b := run.experiment):
            raise ConfigError(
                f"{runs[0].folder} is of experiment={a}, {run.folder} of experiment={b}", hint
            )


def _settings(run: FinishedRun) -> dict[str, Any]:
    model = {key: value for key, value in run.config["model"].items() if key != "products_dir"}
    return {"method": run.method, "model": model, "training": run.config["training"]}
