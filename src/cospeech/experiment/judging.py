"""Preparing a corpus, judging a finished run, and studies of the metrics."""

from __future__ import annotations

import inspect
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf

from cospeech.corpus.splits import SPLITS
from cospeech.corpus.store import Store
from cospeech.errors import ConfigError
from cospeech.evaluation import evaluate_recordings, reference_rows
from cospeech.experiment.building import build, chosen_catalogue, chosen_encoder
from cospeech.experiment.comparing import compare_runs
from cospeech.experiment.context import RunInterrupted
from cospeech.experiment.finished_run import FinishedRun, open_run
from cospeech.experiment.judging_again import corpus_of, encoder_of
from cospeech.methods.base import GestureMethod
from cospeech.reporting.corpus_report import write_corpus_report
from cospeech.reporting.record import write_json
from cospeech.reporting.tables import result_table

FAULTS_SHOWN = 20
"""Sources that could not be read, named on the terminal."""

ADVICE_SHOWN = 4
"""Different pieces of advice about one kind of remark that are printed."""


def prepare(cfg: DictConfig) -> Store:
    """Prepare a corpus and say what is in it.

    Args:
        cfg: Composed from ``conf/prepare.yaml``.
    """
    data = build(cfg.data)
    try:
        store: Store = data.prepare_store()
    except KeyboardInterrupt:
        raise RunInterrupted(
            "stopped; what is done is kept", "the same command goes on from here"
        ) from None
    report = store.path / "report.html"
    if not report.is_file():
        write_corpus_report(store, report, seed=cfg.seed)
    print(store.describe())
    print(what_was_left_out(store.manifest))
    print(f"store:  {store.path}")
    print(f"report: {report.resolve()}")
    return store


def what_was_left_out(manifest: dict[str, Any]) -> str:
    """Kept and dropped, by reason, for the terminal."""
    skipped = manifest["skipped"]
    recordings = len(manifest["recordings"]["id"])
    lines = [f"kept:   {recordings} recordings of {manifest['sources']} sources"]
    if manifest["window_grid"] is not None:
        lines[0] += f", {sum(manifest['rows']['windows'])} published windows"
    windows = ", ".join(f"{n} {reason}" for reason, n in manifest["dropped_windows"].items())
    if windows:
        lines.append(f"dropped windows:    {windows}")
    rules = Counter(item["kind"] for item in skipped if not item["is_fault"])
    if rules:
        lines.append("dropped recordings: " + ", ".join(f"{n} {kind}" for kind, n in rules.items()))
    faults = [item for item in skipped if item["is_fault"]]
    if faults:
        kinds = Counter(item["kind"] for item in faults)
        counted = "; ".join(f"{_takes(count)}: {kind}" for kind, count in kinds.items())
        lines.append(f"dropped as faults:  {counted}")
    lines += [f"not usable: {item['id']}: {item['reason']}" for item in faults[:FAULTS_SHOWN]]
    if len(faults) > FAULTS_SHOWN:
        lines.append(f"  and {len(faults) - FAULTS_SHOWN} more: see the report or the manifest")
    return "\n".join([*lines, *_remarks(manifest)])


def _remarks(manifest: dict[str, Any]) -> list[str]:
    """What is odd about recordings that are kept, counted, and what to do about it."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    has_words = manifest["recordings"]["has_words"]
    if any(has_words) and not all(has_words):
        advice = "a transcript lies beside the audio, under the same name"
        counts["no transcript"][advice] = has_words.count(False)
    for kind, advice, count in manifest["remarks"]:
        counts[kind][advice] += count
    lines = []
    for kind, by_advice in sorted(counts.items(), key=lambda item: -item[1].total()):
        for advice, count in by_advice.most_common(ADVICE_SHOWN):
            lines.append(f"{_takes(count)}: {kind}")
            lines += [f"  -> {advice}"] if advice else []
        if more := by_advice.total() - sum(dict(by_advice.most_common(ADVICE_SHOWN)).values()):
            lines.append(f"{more} more: {kind}, each with advice of its own: see the log")
    return lines


def _takes(count: int) -> str:
    return f"{count} take" if count == 1 else f"{count} takes"


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
    catalogue = chosen_catalogue(cfg.metrics)
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
