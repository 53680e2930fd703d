"""Studies of several finished runs side by side."""

from __future__ import annotations

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
            finished, or they are of several corpora.
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
    store = build(OmegaConf.create(makers[0].values["config"]["data"])).prepare_store()
    encoder = chosen_encoder(store, cfg.metrics)
    systems: list[TrainedSystem] = []
    for run in makers:
        require_same(run.values["data_fingerprint"], store.fingerprint, f"{run.folder}: the corpus")
        model = _method(run).load_from_checkpoint(
            run.folder / file, map_location="cpu", weights_only=True
        )
        name = str(run.values["ablation"]).split("__")[-1]
        systems.append(TrainedSystem(name, int(run.values["seed"]), model))
    classifier = cfg.classifier and FrozenPhaseClassifier.load(cfg.classifier)
    if classifier is None:
        own = sorted(systems, key=lambda system: system.name != "full")
        classifier = next((c for s in own if (c := getattr(s.method, "classifier", None))), None)
    return build(cfg.study_task)(
        store=store,
        encoder=encoder,
        split=cfg.split,
        folder=folder,
        systems=systems,
        classifier=classifier,
    )


def _method(run: Run) -> type[GestureMethod]:
    return cast(type[GestureMethod], get_class(run.values["config"]["model"]["_target_"]))
