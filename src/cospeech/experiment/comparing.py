"""Studies of several finished runs side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

from hydra.utils import get_class
from omegaconf import DictConfig, OmegaConf

from cospeech.errors import ConfigError
from cospeech.experiment.building import build, chosen_encoder, require_same
from cospeech.methods.base import GestureMethod
from cospeech.nn.phase_classifier import FrozenPhaseClassifier
from cospeech.reporting.collect import Run, collect
from cospeech.studies.gestures.systems import TrainedSystem


def compare_runs(cfg: DictConfig, folder: Path) -> Any:
    """Load the finished runs under ``cfg.runs`` and hand them to the study.

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
    if cfg.checkpoint not in ("best", "last"):
        raise ConfigError(f"checkpoint={cfg.checkpoint!r} is not one of best, last")
    file = Path("checkpoints") / f"{cfg.checkpoint}.ckpt"
    found = collect(cfg.runs).runs
    runs = [run for run in found if run.status == "ok" and (run.folder / file).is_file()]
    makers = [run for run in runs if hasattr(_method(run), "sample_joints")]
    if not makers:
        raise ConfigError(
            f"runs={cfg.runs}: of {len(runs)} finished runs none makes gesturing joints",
            "train some first: python train.py study=multi_adversary_ablations",
        )
    _require_one_study(makers)
    store = build(OmegaConf.create(makers[0].values["config"]["data"])).prepare_store()
    encoder = chosen_encoder(store, cfg.metrics)
    systems: list[TrainedSystem] = []
    for run in makers:
        require_same(run.values["data_fingerprint"], store.fingerprint, f"{run.folder}: the corpus")
        model = _method(run).load_from_checkpoint(
            run.folder / file, map_location="cpu", weights_only=True
        )
        if cfg.checkpoint == "last" and getattr(model, "steps_left", 0):
            raise ConfigError(
                f"{run.folder}: {model.steps_left} steps of its schedule are left",
                "train it to its end (ckpt_path=last), or say checkpoint=best",
            )
        systems.append(TrainedSystem(_name(run), int(run.values["seed"]), model))
    classifier, judge = _phase_judge(cfg.classifier, systems)
    return build(cfg.study_task)(
        store=store,
        encoder=encoder,
        split=cfg.split,
        folder=folder,
        systems=systems,
        classifier=classifier,
        about=[
            ("checkpoints", str(cfg.checkpoint)),
            ("runs", ", ".join(run.folder.name for run in makers)),
            ("phases judged by", judge),
        ],
    )


def _phase_judge(
    path: str | None, systems: list[TrainedSystem]
) -> tuple[FrozenPhaseClassifier | None, str]:
    """What tells phases, and where it is from."""
    if path is not None:
        return FrozenPhaseClassifier.load(path), str(path)
    for system in sorted(systems, key=lambda system: system.name != "full"):
        found = getattr(system.method, "classifier", None)
        if found is not None:
            text = (
                f"the classifier inside {system.name}, seed {system.seed}: that system was trained"
                " against it, which flatters it; classifier=FILE takes another"
            )
            return found, text
    return None, "nothing"


def _name(run: Run) -> str:
    return str(run.values["ablation"]).split("__")[-1]


def _require_one_study(runs: Sequence[Run]) -> None:
    """Rows of one study differ by their ablation and seed, and by nothing else.

    Raises:
        ConfigError: Two runs of one name and seed, or of one name and different settings, or of
            different experiments.
    """
    hint = "give a folder with the runs of one study: runs=outputs/studies/NAME"
    seen = dict[str, Run]()
    for run in runs:
        name = _name(run)
        first = seen.setdefault(name, run)
        twin = seen.setdefault(f"{name}, seed {run.values['seed']}", run)
        if twin is not run:
            raise ConfigError(
                f"{twin.folder} and {run.folder} are both {name}, seed {run.values['seed']}", hint
            )
        if _settings(first) != _settings(run):
            raise ConfigError(f"{first.folder} and {run.folder} have different settings", hint)
        if (a := _experiment(runs[0])) != (b := _experiment(run)):
            raise ConfigError(
                f"{runs[0].folder} is of experiment={a}, {run.folder} of experiment={b}", hint
            )


def _settings(run: Run) -> dict[str, Any]:
    config = run.values["config"]
    model = {key: value for key, value in config["model"].items() if key != "products_dir"}
    return {"model": model, "training": config["training"]}


def _experiment(run: Run) -> Any:
    return run.values["config"]["choices"]["experiment"]


def _method(run: Run) -> type[GestureMethod]:
    return cast(type[GestureMethod], get_class(run.values["config"]["model"]["_target_"]))
