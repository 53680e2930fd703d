"""Preparing a corpus, and what is said of it."""

from __future__ import annotations

from collections import Counter, defaultdict
from typing import Any

from omegaconf import DictConfig

from cospeech.corpus.store import Store
from cospeech.experiment.building import build
from cospeech.experiment.context import RunInterrupted
from cospeech.reporting.corpus_report import write_corpus_report

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
