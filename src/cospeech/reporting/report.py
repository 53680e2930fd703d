"""One self-contained HTML page about many runs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import quote

from cospeech.reporting.chart import SERIES_COLOURS, Line, line_chart
from cospeech.reporting.collect import (
    PROTOCOLS,
    Collection,
    Group,
    Run,
    differences,
    group_runs,
    number,
    result_columns,
)
from cospeech.reporting.files import replacing
from cospeech.reporting.markup import escaped
from cospeech.reporting.tables import METRICS, MISSING, Column, Summary, format_table, format_value

_MONITOR = "val/fgd"


def text_report(collection: Collection, style: str = "text") -> str:
    """The results of a collection of runs, for a terminal or a README.

    One table per protocol: mean ± standard deviation over seeds, reference rows below; then the
    runs that failed and the records that could not be read.

    Args:
        collection: From `collect`.
        style: ``"text"`` or ``"markdown"``.
    """
    groups = group_runs(collection.runs)
    parts = []
    for protocol in PROTOCOLS:
        rows = _rows(groups, protocol)
        if rows:
            table = format_table(
                rows, result_columns(rows), "text" if style == "text" else "markdown"
            )
            parts.append(f"{_protocol_title(protocol)}\n\n{table}")
    if not parts:
        parts.append("no finished run with final numbers yet")
    unfinished = [run for group in groups for run in group.unfinished]
    parts += [f"{run.id}: {run.status}{_error(run, ': ')}" for run in unfinished]
    parts += [f"{path}: damaged record, left out ({reason})" for path, reason in collection.damaged]
    return "\n\n".join(parts)


def write_report(collection: Collection, path: str | Path) -> Path:
    """Write the page: results with uncertainty, curves, settings that differ, every run.

    Args:
        collection: From `collect`.
        path: The HTML file, beside or above the runs it links to.

    Returns:
        ``path``.
    """
    path = Path(path)
    groups = group_runs(collection.runs)
    name = collection.folder.resolve().name
    body = [
        f"<h1>{escaped(name)}</h1>",
        f'<p class="muted">{_count(len(collection.runs), "run")} in {_count(len(groups), "group")};'
        " ± is the standard deviation over training seeds, the small line the 95 % interval of the"
        " mean (Student's t).</p>",
    ]
    for protocol in PROTOCOLS:
        body += _results_section(groups, protocol)
    body += _curves_section(groups)
    body += _differences_section(groups)
    body += _runs_section(groups, path.parent)
    if collection.damaged:
        items = "".join(
            f"<li><code>{escaped(str(file))}</code>: {escaped(reason)}</li>"
            for file, reason in collection.damaged
        )
        body.append(f'<h2>Damaged records</h2><section class="bad"><ul>{items}</ul></section>')
    css = (files("cospeech.reporting") / "report.css").read_text(encoding="utf-8")
    page = (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escaped(name)}: results</title><style>{css}</style></head>\n<body>\n"
        + "\n".join(body)
        + "\n</body></html>\n"
    )
    with replacing(path) as temporary:
        temporary.write_text(page, encoding="utf-8", newline="\n")
    return path


def _protocol_title(protocol: str) -> str:
    return {
        "windows": "Windows protocol: real seed poses, one window at a time",
        "recordings": "Recordings protocol: generated over whole recordings, then cut",
    }[protocol]


def _rows(groups: Sequence[Group], protocol: str) -> list[dict[str, Any]]:
    """A row per group that has numbers, then the reference rows of each corpus and encoder."""
    with_numbers = [group for group in groups if any(run.final(protocol) for run in group.runs)]
    rows = [group.row(protocol) for group in with_numbers]
    spaces: dict[tuple[Any, Any], Group] = {}
    for group in with_numbers:
        run = group.runs[0]
        space = run.values.get("data_fingerprint"), run.mapping("encoder").get("sha256")
        spaces.setdefault(space, group)
    for group in spaces.values():
        of = f" ({group.label})" if len(spaces) > 1 else ""
        for name, values in group.runs[0].mapping("references").items():
            if isinstance(values, dict):
                shown = {metric.key: number(values.get(metric.key)) for metric in METRICS}
                label = f"{str(name).replace('_', ' ')}{of}"
                rows.append({"label": label, "data": group.data, "runs": None, **shown})
    return rows


def _results_section(groups: Sequence[Group], protocol: str) -> list[str]:
    rows = _rows(groups, protocol)
    if not rows:
        return []
    columns = result_columns(rows)
    colours = {group.label: colour for group, colour in _coloured(groups)}
    lines = []
    for row in rows:
        reference = row["runs"] is None
        cells = []
        for column in columns:
            value = row.get(column.key)
            text = _cell(value)
            if column.key == "label" and not reference:
                text = f'<i class="swatch" style="background:{colours[row["label"]]}"></i>{text}'
            cells.append(f"<td{_number_class(column)}>{text}</td>")
        lines.append(f"<tr{' class=reference' if reference else ''}>{''.join(cells)}</tr>")
    heads = "".join(f"<th{_number_class(c)}>{escaped(c.heading)}</th>" for c in columns)
    return [
        f"<h2>{_protocol_title(protocol)}</h2>",
        f"<section><table><tr>{heads}</tr>{''.join(lines)}</table></section>",
    ]


def _number_class(column: Column) -> str:
    return "" if column.key in ("label", "data") else ' class="number"'


def _cell(value: Any) -> str:
    text = escaped(format_value(value))
    if isinstance(value, Summary) and value.ci95 is not None:
        low, high = value.ci95
        text += f"<small>{format_value(low)} to {format_value(high)}</small>"
    return text


def _coloured(groups: Sequence[Group]) -> list[tuple[Group, str]]:
    return [(g, SERIES_COLOURS[i % len(SERIES_COLOURS)]) for i, g in enumerate(groups)]


def _curves_section(groups: Sequence[Group]) -> list[str]:
    keys = dict.fromkeys(
        key
        for group in groups
        for run in group.members
        for row in run.epochs()
        for key, value in row.items()
        if key.startswith("val/") and number(value) is not None
    )
    parts = []
    for key in sorted(keys, key=lambda key: (key != _MONITOR, key)):
        lines = [
            Line(f"{group.label}, seed {run.seed}", colour, _curve(run, key))
            for group, colour in _coloured(groups)
            for run in group.members
        ]
        chart = line_chart(lines, "epoch", key)
        if key == _MONITOR:
            parts.append(chart)
        elif chart:
            parts.append(f"<details><summary>{escaped(key)}</summary>{chart}</details>")
    if not parts:
        return []
    legend = " ".join(
        f'<span style="margin-right:16px"><i class="swatch" style="background:{colour}"></i>'
        f"{escaped(group.label)}</span>"
        for group, colour in _coloured(groups)
    )
    return ["<h2>Validation, epoch by epoch</h2>", f"<section>{legend}{''.join(parts)}</section>"]


def _curve(run: Run, key: str) -> list[tuple[float, float]]:
    values = ((number(row.get("epoch")), number(row.get(key))) for row in run.epochs())
    return [(x, y) for x, y in values if x is not None and y is not None]


def _differences_section(groups: Sequence[Group]) -> list[str]:
    if len(groups) < 2:
        return []
    table = differences([group.members[0] for group in groups])
    if not table:
        return []
    heads = "".join(f"<th>{escaped(group.label)}</th>" for group in groups)
    lines = "".join(
        f"<tr><td><code>{escaped(key)}</code></td>"
        + "".join(f"<td>{escaped(format_value(value))}</td>" for value in values)
        + "</tr>"
        for key, values in table.items()
    )
    return [
        "<h2>Why different: what sets the groups apart</h2>",
        f"<section><table><tr><th>setting</th>{heads}</tr>{lines}</table></section>",
    ]


def _runs_section(groups: Sequence[Group], folder: Path) -> list[str]:
    heads = "".join(
        f"<th>{title}</th>"
        for title in ("run", "status", "seed", "epochs", "time", "commit", "see and hear")
    )
    lines = []
    for group in groups:
        for run in group.members:
            note = " (a newer run of this seed counts)" if run in group.superseded else ""
            error = escaped(_error(run, ""))
            seconds = sum(number(value) or 0.0 for value in run.mapping("timings").values())
            commit = str(run.values.get("commit") or MISSING)[:10]
            changed = ", uncommitted changes" if run.values.get("dirty") else ""
            cells = [
                f"{escaped(run.id)}<small>{escaped(group.label)}{note}</small>",
                escaped(run.status) + (f'<small class="bad">{error}</small>' if error else ""),
                escaped(format_value(run.seed)),
                str(len(run.epochs())),
                f"{seconds / 60:.1f} min" if seconds else MISSING,
                f"<code>{escaped(commit)}</code>{changed}",
                " ".join(_link(sample, run, folder) for sample in run.samples()) or MISSING,
            ]
            lines.append(f"<tr>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>")
    return [
        "<h2>Runs</h2>",
        f"<section><table><tr>{heads}</tr>{''.join(lines)}</table></section>",
    ]


def _link(sample: Path, run: Run, folder: Path) -> str:
    relative = Path(os.path.relpath(sample, folder)).as_posix()
    name = sample.relative_to(run.folder).with_suffix("").name
    return f'<a href="{quote(relative)}">{escaped(name)}</a>'


def _error(run: Run, before: str) -> str:
    error = run.values.get("error")
    return f"{before}{str(error).splitlines()[0]}" if error else ""


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"
