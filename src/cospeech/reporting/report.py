"""One self-contained HTML page about many runs, and the same tables for a terminal."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from cospeech.files import write_text
from cospeech.reporting.charts import SERIES, Line, line_chart
from cospeech.reporting.collect import Collection, Run, number
from cospeech.reporting.grouping import Group, differences, group_runs
from cospeech.reporting.markup import escaped, html_page, html_table, markdown, one_line
from cospeech.reporting.results import Results, results_of
from cospeech.reporting.tables import (
    MISSING,
    Column,
    Summary,
    format_table,
    format_value,
    with_interval,
)

_MONITOR = "val/fgd"
_MOST_CHARTS = 60
_MOST_DIFFERENCES = 200
_LONGEST_NAME = 60
_TEXT_COLUMNS = ("label", "protocol", "interval")


def text_report(collection: Collection, style: str = "text") -> str:
    """The results of a collection of runs, for a terminal or a README.

    One table per corpus and encoder: mean ± standard deviation over seeds by each protocol, and
    the reference rows; then, without numbers, the runs that are still at work, that failed or were
    interrupted, that are debug runs, and the records that could not be read.

    Args:
        collection: From `collect`.
        style: ``"text"`` or ``"markdown"``.
    """
    line = markdown if style == "markdown" else one_line
    groups = group_runs(collection.runs)
    parts = []
    for results in results_of(groups):
        if results.rows:
            table = format_table(
                results.rows, results.columns, "markdown" if style == "markdown" else "text"
            )
            parts.append(f"{line(results.title)}\n\n{table}")
    if not parts:
        parts.append("no finished run with final numbers yet")
    for title, members in _apart(groups):
        lines = [f"{run.id}: {run.status}{_reason(run, ': ')}" for _, run in members]
        parts.append("\n".join([f"{title}, not among the results:", *map(line, lines)]))
    parts += [
        line(f"{path}: damaged record, left out ({reason})") for path, reason in collection.damaged
    ]
    return "\n\n".join(parts)


def write_report(collection: Collection, path: str | Path) -> Path:
    """Write the page: results with uncertainty, curves, settings that differ, every run.

    Args:
        collection: From `collect`.
        path: The HTML file, beside or above the runs it links to.

    Returns:
        ``path``.

    Raises:
        CospeechError: The file can't be written.
    """
    path = Path(path)
    groups = group_runs(collection.runs)
    name = collection.folder.resolve().name
    found = results_of(groups)
    body = [
        f"<h1>{escaped(name)}</h1>",
        f'<p class="muted">{_count(len(collection.runs), "run")} in {_count(len(groups), "group")};'
        " ± is the standard deviation over training seeds, the small line the 95 % interval of the"
        " mean (Student's t). Numbers of different corpora or encoders are not comparable.</p>",
    ]
    for results in found:
        body += _results_section(results, path.parent)
    if not any(results.rows for results in found):
        body.append("<section>No finished run with final numbers yet.</section>")
    body += _differences_section([group for group in groups if not group.is_debug])
    for title, members in _apart(groups):
        body += [f"<h2>{title}</h2>", _curves(members), _runs_table(members, path.parent, [])]
    if collection.damaged:
        items = "".join(
            f"<li><code>{escaped(file)}</code>: {escaped(reason)}</li>"
            for file, reason in collection.damaged
        )
        body.append(f'<h2>Damaged records</h2><section class="bad"><ul>{items}</ul></section>')
    write_text(path, html_page(f"{escaped(name)}: results", body))
    return path


def _apart(groups: Sequence[Group]) -> list[tuple[str, list[tuple[Group, Run]]]]:
    """What is shown without being a result, under its heading."""
    everyone = [(group, run) for group in groups for run in group.members]
    kinds: dict[str, list[tuple[Group, Run]]] = {
        "Still running": [],
        "Failed and interrupted runs": [],
        "Debug runs": [],
    }
    for group, run in everyone:
        if group.is_debug:
            kinds["Debug runs"].append((group, run))
        elif run.status.startswith("running"):
            kinds["Still running"].append((group, run))
        elif run.status != "ok":
            kinds["Failed and interrupted runs"].append((group, run))
    return [(title, members) for title, members in kinds.items() if members]


def _results_section(results: Results, folder: Path) -> list[str]:
    colours = {id(group): colour for group, colour in _coloured(results.groups)}
    members = [(group, run) for group in results.groups for run in (*group.runs, *group.superseded)]
    rows = []
    for row in results.rows:
        group = row.get("group")
        cells = {column.key: _cell(row.get(column.key)) for column in results.columns}
        if group is None:
            cells = {key: f'<span class="muted">{text}</span>' for key, text in cells.items()}
        elif "label" in cells:
            cells["label"] = _swatch(colours[id(group)]) + cells["label"]
        rows.append(list(cells.values()))
    numbers = [i for i, c in enumerate(results.columns) if c.key not in _TEXT_COLUMNS]
    table = html_table([escaped(c.heading) for c in results.columns], rows, numbers)
    return [
        f"<h2>{escaped(results.title)}</h2>",
        f"<section>{table}</section>" if rows else "",
        _curves(members),
        _runs_table(members, folder, [c for c in results.columns if c.key in ("fgd", "interval")]),
    ]


def _cell(value: Any) -> str:
    text = escaped(format_value(value))
    if isinstance(value, Summary) and value.ci95 is not None:
        low, high = value.ci95
        text += f"<small>{format_value(low)} to {format_value(high)}</small>"
    return text


def _coloured(groups: Sequence[Group]) -> list[tuple[Group, str]]:
    return [(g, SERIES[i % len(SERIES)]) for i, g in enumerate(groups)]


def _swatch(colour: str) -> str:
    return f'<i class="swatch" style="background: var(--{colour})"></i>'


def _curves(members: Sequence[tuple[Group, Run]]) -> str:
    """Validation by epoch, of runs of one corpus and encoder; nothing where they differ."""
    if len({run.space for _, run in members if run.epochs()}) > 1:
        return ""
    keys = dict.fromkeys(
        key
        for _, run in members
        for row in run.epochs()
        for key, value in row.items()
        if key.startswith("val/") and number(value) is not None
    )
    groups = list(dict.fromkeys(group for group, _ in members))
    colours = dict(_coloured(groups))
    parts = []
    for key in sorted(keys, key=lambda key: (key != _MONITOR, key))[:_MOST_CHARTS]:
        lines = [
            Line(f"{group.label}, seed {format_value(run.seed)}", colours[group], _curve(run, key))
            for group, run in members
        ]
        chart = line_chart(lines, "epoch", _short(key))
        if key == _MONITOR:
            parts.append(chart)
        elif chart:
            parts.append(f"<details><summary>{escaped(key)}</summary>{chart}</details>")
    if not any(parts):
        return ""
    legend = " ".join(
        f'<span class="legend">{_swatch(colour)}{escaped(group.label)}</span>'
        for group, colour in colours.items()
    )
    return f"<h3>Validation, epoch by epoch</h3><section>{legend}{''.join(parts)}</section>"


def _curve(run: Run, key: str) -> list[tuple[float, float]]:
    values = ((number(row.get("epoch")), number(row.get(key))) for row in run.epochs())
    return [(x, y) for x, y in values if x is not None and y is not None]


def _differences_section(groups: Sequence[Group]) -> list[str]:
    if len(groups) < 2:
        return []
    table = differences([group.members[0] for group in groups])
    if not table:
        return []
    heads = ["setting", *(escaped(group.label) for group in groups)]
    rows = [
        (f"<code>{escaped(key)}</code>", *(escaped(format_value(value)) for value in values))
        for key, values in list(table.items())[:_MOST_DIFFERENCES]
    ]
    more = len(table) - _MOST_DIFFERENCES
    rest = f"<p>and {more:,} more settings</p>" if more > 0 else ""
    return [
        "<h2>Why different: what sets the groups apart</h2>",
        f"<section>{html_table(heads, rows)}{rest}</section>",
    ]


def _runs_table(
    members: Sequence[tuple[Group, Run]], folder: Path, judged_by: Sequence[Column]
) -> str:
    """Every run with its links, and its own numbers by the recordings protocol."""
    titles = ["run", "status", "seed", "epochs", "time", "commit", "see and hear"]
    titles[3:3] = [column.heading for column in judged_by]
    rows = []
    for group, run in members:
        note = " (a newer run of this seed counts)" if run in group.superseded else ""
        error = escaped(_reason(run, ""))
        seconds = sum(number(value) or 0.0 for value in run.mapping("timings").values())
        commit = str(run.values.get("commit") or MISSING)[:10]
        changed = ", uncommitted changes" if run.values.get("dirty") else ""
        own = with_interval(run.final("recordings"))
        cells = [
            f'<a href="{_address(run.folder, folder)}/">{escaped(run.id)}</a>'
            f"<small>{escaped(group.label)}{note}</small>",
            escaped(run.status) + (f'<small class="bad">{error}</small>' if error else ""),
            escaped(format_value(run.seed)),
            *(escaped(format_value(own.get(column.key))) for column in judged_by),
            str(len(run.epochs())),
            f"{seconds / 60:.1f} min" if seconds else MISSING,
            f"<code>{escaped(commit)}</code>{changed}",
            " ".join(_link(sample, folder) for sample in run.samples()) or MISSING,
        ]
        rows.append(cells)
    table = html_table([escaped(title) for title in titles], rows)
    return f"<h3>Runs</h3><section>{table}</section>"


def _link(sample: Path, folder: Path) -> str:
    return f'<a href="{_address(sample, folder)}">{escaped(sample.stem)}</a>'


def _address(target: Path, folder: Path) -> str:
    """A relative address from a page in a folder, as a quoted path without a scheme."""
    try:
        relative = target.absolute().relative_to(folder.absolute())
    except ValueError:
        # ways up are those of the folders that links stand for
        relative = Path(os.path.relpath(target.resolve(), folder.resolve()))
    return quote(os.fsencode(relative.as_posix()))


def _reason(run: Run, before: str) -> str:
    return f"{before}{format_value(run.error)}" if run.error else ""


def _short(name: str) -> str:
    return name if len(name) <= _LONGEST_NAME else f"{name[:_LONGEST_NAME]}…"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"
