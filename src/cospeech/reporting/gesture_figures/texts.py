"""The numbers of all systems as a table, and the paper's findings beside ours."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

from cospeech.metrics.gesture_statistics.catalogue import STATISTICS, Statistic
from cospeech.metrics.gesture_statistics.findings import (
    AGREES,
    DISAGREES,
    PAPER_ORDERS,
    PARTLY,
    UNCLEAR,
    Comparand,
    Verdict,
)
from cospeech.metrics.gesture_statistics.systems import REAL, SystemStatistics
from cospeech.reporting.gesture_figures.system_styles import SystemStyle, shown, title_of
from cospeech.reporting.markup import escaped
from cospeech.reporting.tables import Column, format_table

_SIGNS = {AGREES: "✓", PARTLY: "(✓)", UNCLEAR: "?", DISAGREES: "✗", None: "\N{EN DASH}"}
_STYLES = {AGREES: "yes", PARTLY: "yes", UNCLEAR: "open", DISAGREES: "no", None: "none"}
_NOT_RUN = "not run"
_ALIKE = 1.05
"""Numbers with a smaller ratio are shown as alike."""


def text_table(systems: Sequence[SystemStatistics], verdicts: Sequence[Verdict]) -> str:
    """The numbers for a terminal, a row per statistic, and a line per finding."""
    rows: list[dict[str, Any]] = []
    for statistic in _measured(systems):
        factor = statistic.factor
        row: dict[str, Any] = {"statistic": _heading(statistic)}
        for system in systems:
            estimate = system.estimates.get(statistic.key)
            row[system.name] = shown(None if estimate is None else factor * estimate.value)
        rows.append(row)
    columns = [Column("statistic", " "), *(Column(s.name, title_of(s.name)) for s in systems)]
    lines = [
        f"{_SIGNS[v.answer]:<3} {v.answer or _NOT_RUN:<19}  {v.finding.claim} ({v.finding.section})"
        + (f"; not run: {', '.join(map(title_of, v.missing))}" if v.missing else "")
        for v in verdicts
    ]
    return "\n".join([format_table(rows, columns), "", *lines])


def findings_table(verdicts: Sequence[Verdict]) -> str:
    """What the paper saw and what is seen here, as an HTML table."""
    rows = []
    for verdict in verdicts:
        here = "".join(f"<li>{_comparison(group)}</li>" for group in _grouped(verdict.parts))
        missing = ", ".join(title_of(name) for name in verdict.missing)
        note = f"<small>not run: {escaped(missing)}</small>" if missing else ""
        rows.append(
            f"<tr><td>{escaped(verdict.finding.claim)}<small>section"
            f" {verdict.finding.section}</small></td><td><ul>{here}</ul>{note}</td>"
            f"<td>{chip(verdict)}</td></tr>"
        )
    return (
        '<table class="findings"><tr><th>the paper</th><th>here</th><th></th></tr>'
        f"{''.join(rows)}</table>"
    )


def chip(verdict: Verdict) -> str:
    """A verdict as a coloured word with a sign."""
    answer = verdict.answer
    return f'<span class="chip {_STYLES[answer]}">{_SIGNS[answer]}&nbsp;{answer or _NOT_RUN}</span>'


def tally(verdicts: Sequence[Verdict]) -> str:
    """How many findings hold, in words."""
    answers = [verdict.answer for verdict in verdicts]
    parts = [f"{answers.count(answer)} {word}" for answer, word in _TALLY if answer in answers]
    return ", ".join(parts)


_TALLY = (
    (AGREES, "hold"),
    (PARTLY, "hold as far as run"),
    (UNCLEAR, "unclear"),
    (DISAGREES, "do not hold"),
    (None, "not run"),
)


def numbers_table(systems: Sequence[SystemStatistics], styles: dict[str, SystemStyle]) -> str:
    """Every statistic of every system with its interval, and the paper's order beside ours."""
    heads = "".join(
        f'<th><i class="swatch" style="background: var(--{styles[s.name].colour})"></i>'
        f"{escaped(title_of(s.name))}</th>"
        for s in systems
    )
    lines = []
    for statistic in _measured(systems):
        cells = "".join(_cell(system, statistic) for system in systems)
        paper = PAPER_ORDERS.get(statistic.key)
        expected = f"<b>paper:</b> {escaped(paper)}; " if paper else ""
        wide = f'<td colspan="{len(systems)}">'
        lines.append(
            f'<tr class="title">{wide}<b>{escaped(_heading(statistic))}</b>'
            f" <span>{escaped(statistic.meaning)}</span></td></tr>"
            f'<tr class="values">{cells}</tr>'
            f'<tr class="order">{wide}{expected}<b>here:</b> {_order(systems, statistic)}</td></tr>'
        )
    return f'<table class="numbers"><tr>{heads}</tr>{"".join(lines)}</table>'


def bones_table(
    systems: Sequence[SystemStatistics],
    roles: Sequence[str],
    bones: Sequence[tuple[int, int]],
) -> str:
    """Mean length and variation of each bone, as an HTML table."""
    heads = "".join(f'<th class="number">{escaped(title_of(s.name))}</th>' for s in systems)
    lines = []
    for i, (parent, child) in enumerate(bones):
        name = f"{roles[parent]} to {roles[child]}".replace("_", " ")
        cells = "".join(
            f'<td class="number">{100 * s.bones[i, 0]:.1f} cm'
            f"<small>{shown(100 * s.bones[i, 1], 2)} %</small></td>"
            for s in systems
        )
        lines.append(f"<tr><td>{escaped(name)}</td>{cells}</tr>")
    return f"<table><tr><th></th>{heads}</tr>{''.join(lines)}</table>"


def _measured(systems: Sequence[SystemStatistics]) -> list[Statistic]:
    return [s for s in STATISTICS if any(s.key in system.estimates for system in systems)]


def _heading(statistic: Statistic) -> str:
    return f"{statistic.title}, {statistic.unit}" if statistic.unit else statistic.title


def _cell(system: SystemStatistics, statistic: Statistic) -> str:
    estimate = system.estimates.get(statistic.key)
    if estimate is None:
        return "<td>\N{EN DASH}</td>"
    factor = statistic.factor
    text = shown(factor * estimate.value)
    interval = system.intervals.get(statistic.key)
    if interval is not None:
        low, high = (shown(factor * end) for end in interval)
        text += f"<small>{low} to {high}</small>"
    if statistic.key == "velocity":
        text += f"<small>{shown(factor * estimate.value / _STEPS_PER_SECOND)} cm/frame</small>"
    if len(system.seeds) > 1:
        seeds = " · ".join(shown(factor * e.value) for e in system.by_seed[statistic.key])
        text += f'<small class="seeds">{seeds}</small>'
    floor = system.name == REAL and statistic.to_real
    return f"<td{' class=floor' if floor else ''}>{text}</td>"


_STEPS_PER_SECOND = 20.0


def _order(systems: Sequence[SystemStatistics], statistic: Statistic) -> str:
    """Names from the largest number to the smallest."""
    values = {
        title_of(s.name): s.estimates[statistic.key].value
        for s in systems
        if statistic.key in s.estimates and not (s.name == REAL and statistic.to_real)
    }
    names = sorted(
        (name for name in values if values[name] == values[name]), key=lambda n: -values[n]
    )
    if not names:
        return "\N{EN DASH}"
    text = escaped(names[0])
    for larger, smaller in itertools.pairwise(names):
        alike = values[larger] <= _ALIKE * values[smaller]
        text += f" {'≈' if alike else '&gt;'} {escaped(smaller)}"
    return text


def _grouped(parts: Sequence[Comparand]) -> list[list[Comparand]]:
    """Neighbours that differ in one side alone, and came out alike, together."""
    groups: list[list[Comparand]] = []
    for part in parts:
        if groups and _goes_with(groups[-1], part):
            groups[-1].append(part)
        else:
            groups.append([part])
    return groups


def _goes_with(group: Sequence[Comparand], part: Comparand) -> bool:
    first, own = group[0].comparison, part.comparison
    alike = (
        (first.statistic, first.factor) == (own.statistic, own.factor)
        and group[0].holds == part.holds
        and _doubts(group[0]) == _doubts(part)
    )
    one_smaller = len({*(p.comparison.smaller for p in group), own.smaller}) == 1
    one_larger = len({*(p.comparison.larger for p in group), own.larger}) == 1
    return alike and (one_smaller or one_larger)


def _comparison(group: Sequence[Comparand]) -> str:
    """Both sides with their numbers, and how sure."""
    comparison = group[0].comparison
    statistic = next(s for s in STATISTICS if s.key == comparison.statistic)
    sides = (
        {title_of(part.comparison.smaller): part.smaller for part in group},
        {title_of(part.comparison.larger): part.larger for part in group},
    )
    smaller, larger = (
        ", ".join(
            f"{escaped(name)} <b>{shown(statistic.factor * value)}</b>"
            for name, value in side.items()
        )
        for side in sides
    )
    sign = "&lt;" if group[0].holds else "≥"
    multiple = "" if comparison.factor == 1 else f"{comparison.factor:g} &times; "
    doubts = _doubts(group[0])
    doubt = f' <span class="muted">({", ".join(doubts)})</span>' if doubts else ""
    wrong = "" if group[0].holds else ' class="wrong"'
    return (
        f'<span class="muted">{escaped(_heading(statistic))}:</span>'
        f" <span{wrong}>{smaller} {sign} {multiple}{larger}</span>{doubt}"
    )


def _doubts(part: Comparand) -> list[str]:
    doubts = ["within the interval"] if part.clear is False else []
    agreeing, seeds = part.seeds
    return doubts + ([f"{agreeing} of {seeds} seeds"] if seeds > 1 else [])
