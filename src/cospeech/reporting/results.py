"""The tables of results that the terminal and the page show alike."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from cospeech.reporting.collect import PROTOCOLS, Run, flatten, number
from cospeech.reporting.grouping import Group
from cospeech.reporting.tables import Column, Summary, metric_columns, with_interval

INTERVAL = Column("interval", "95 % over recordings")
_MOST_OTHER_METRICS = 8
_OF_FGD = ("fgd_low", "fgd_high")


@dataclass(frozen=True, eq=False)
class Results:
    """What was measured on one corpus with one encoder.

    Attributes:
        title: Names both.
        groups: Those with finished runs, in order.
        columns: Of the table.
        rows: A row per group and protocol, then the reference rows. Their ``group`` is that of
            the row; None for a reference.
    """

    title: str
    groups: Sequence[Group]
    columns: Sequence[Column]
    rows: Sequence[Mapping[str, Any]]


def results_of(groups: Iterable[Group]) -> list[Results]:
    """The results of finished runs that are no debug runs, one table per corpus and encoder."""
    spaces: dict[tuple[str | None, str | None], list[Group]] = {}
    for group in groups:
        if group.runs and not group.is_debug:
            spaces.setdefault(group.space, []).append(group)
    return [_results(alike) for alike in spaces.values()]


def _results(groups: Sequence[Group]) -> Results:
    runs = [run for group in groups for run in group.runs]
    named = metric_columns(*(run.values for run in runs))
    metrics = [m for m in named if any(_has(run, m.key) for run in runs)] or _others(runs)
    rows = [
        _row(group, protocol, metrics)
        for protocol in PROTOCOLS
        for group in groups
        if any(run.final(protocol) for run in group.runs)
    ]
    for name, values in _references(runs).items():
        shown = {metric.key: number(values.get(metric.key)) for metric in named}
        interval = with_interval(values).get("interval")
        label = name.replace("_", " ")
        rows.append({"label": label, "protocol": "reference", **shown, "interval": interval})
    metrics = [m for m in named if any(row.get(m.key) is not None for row in rows)] or metrics
    columns = [Column("label", " "), Column("protocol"), Column("runs")]
    for metric in metrics:
        columns.append(metric)
        if metric.key == "fgd" and any(row.get("interval") is not None for row in rows):
            columns.append(INTERVAL)
    return Results(_title(groups), groups, columns, rows)


def _row(group: Group, protocol: str, metrics: Sequence[Column]) -> dict[str, Any]:
    """Seeds have a deviation; a single run has the interval that its own table has."""
    values: dict[str, Summary | None] = {m.key: group.summary(protocol, m.key) for m in metrics}
    one = group.runs[0].final(protocol) if len(group.runs) == 1 else {}
    return {
        "label": group.label,
        "protocol": protocol,
        "runs": len(group.runs),
        **values,
        "interval": with_interval(one).get("interval"),
        "group": group,
    }


def _references(runs: Sequence[Run]) -> dict[str, dict[str, Any]]:
    """The newest run's reference rows; what it wasn't judged by is of the newest run that was.

    All runs of a corpus, an encoder and a seed of the references have the same, or an older code's.
    """
    newest, *older = sorted(
        runs, key=lambda run: (bool(run.mapping("references")), _finished(run)), reverse=True
    )
    rows = {name: dict(values or {}) for name, values in newest.mapping("references").items()}
    for run in older:
        if _reference_seed(run) != _reference_seed(newest):
            continue
        for name, row in rows.items():
            values = run.mapping("references").get(name) or {}
            # an interval belongs to its own FGD
            ends = _OF_FGD if row.get("fgd") is not None else ()
            for key, value in values.items():
                if row.get(key) is None and key not in ends:
                    row[key] = value
    return rows


def _reference_seed(run: Run) -> Any:
    return flatten(run.mapping("config")).get("metrics.reference_seed")


def _has(run: Run, metric: str) -> bool:
    return any(run.final(protocol).get(metric) is not None for protocol in PROTOCOLS)


def _others(runs: Sequence[Run]) -> list[Column]:
    """What a method without gestures is judged by: whatever its records hold."""
    keys = dict.fromkeys(
        key
        for run in runs
        for protocol in PROTOCOLS
        for key, value in run.final(protocol).items()
        if number(value) is not None
    )
    return [Column(key) for key in list(keys)[:_MOST_OTHER_METRICS]]


def _finished(run: Run) -> str:
    return str(run.values.get("finished") or "")


def _title(groups: Sequence[Group]) -> str:
    first = groups[0]
    fingerprint, sha256 = first.space
    corpus = f"Corpus {first.data}" + (f" {fingerprint[:12]}" if fingerprint else "")
    if sha256 is None:
        return corpus
    name = first.runs[0].mapping("encoder").get("name") or ""
    return f"{corpus} · encoder {name} {sha256[:12]}".replace("  ", " ")
