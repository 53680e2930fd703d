"""The numbers of all systems as a table, and the paper's findings beside ours."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from typing import Any

from cospeech.reporting.markup import escaped, html_table
from cospeech.reporting.tables import MISSING, Column, format_table
from cospeech.studies.multi_adversary_figures.findings import (
    AGREES,
    DISAGREES,
    PARTLY,
    UNCLEAR,
    Compared,
    Verdict,
)
from cospeech.studies.multi_adversary_figures.measured import (
    FPS,
    REAL,
    Setting,
    SystemStatistics,
)
from cospeech.studies.multi_adversary_figures.paper import STATISTICS
from cospeech.studies.multi_adversary_figures.styles import shown, style_of, title_of

_NOT_RUN = "not run"
_ANSWERS = {
    AGREES: ("✓", "yes", "hold"),
    PARTLY: ("(✓)", "yes", "hold as far as run"),
    UNCLEAR: ("?", "open", "unclear"),
    DISAGREES: ("✗", "no", "do not hold"),
    None: (MISSING, "none", _NOT_RUN),
}
"""Of each answer its sign, its CSS class and what several findings do."""

_ALIKE = 1.05
"""Numbers with a smaller ratio are shown as alike."""


def text_table(systems: Sequence[SystemStatistics], verdicts: Sequence[Verdict]) -> str:
    """The numbers for a terminal, a row per statistic, and a line per finding."""
    rows: list[dict[str, Any]] = [
        {"statistic": STATISTICS[key].heading}
        | {system.name: shown(_value(system, key)) for system in systems}
        for key in _measured(systems)
    ]
    columns = [Column("statistic", " "), *(Column(s.name, title_of(s.name)) for s in systems)]
    lines = [
        f"{_ANSWERS[v.answer][0]:<3} {v.answer or _NOT_RUN:<19}  {v.claim} ({v.section})"
        + (f"; not run: {', '.join(map(title_of, v.not_run))}" if v.not_run else "")
        for v in verdicts
    ]
    return "\n".join([format_table(rows, columns), "", *lines])


def findings_table(verdicts: Sequence[Verdict]) -> str:
    """What the paper saw and what is seen here, as an HTML table."""
    rows = []
    for verdict in verdicts:
        here = "".join(f"<li>{_comparison(group)}</li>" for group in _grouped(verdict.comparisons))
        missing = escaped(", ".join(map(title_of, verdict.not_run)))
        note = f"<small>not run: {missing}</small>" if missing else ""
        sign, style, _ = _ANSWERS[verdict.answer]
        rows.append(
            (
                f"{escaped(verdict.claim)}<small>section {verdict.section}</small>",
                f"<ul>{here}</ul>{note}",
                f'<span class="chip {style}">{sign}&nbsp;{verdict.answer or _NOT_RUN}</span>',
            )
        )
    return html_table(["the paper", "here", ""], rows, style="findings")


def tally(verdicts: Sequence[Verdict]) -> str:
    """How many findings hold, in words."""
    answers = [verdict.answer for verdict in verdicts]
    return ", ".join(
        f"{answers.count(answer)} {word}"
        for answer, (_, _, word) in _ANSWERS.items()
        if answer in answers
    )


def numbers_table(systems: Sequence[SystemStatistics]) -> str:
    """Every statistic of every system with its interval, and the paper's order beside ours."""
    heads = "".join(
        f'<th><i class="swatch" style="background: var(--{style_of(place).colour})"></i>'
        f"{escaped(title_of(system.name))}</th>"
        for place, system in enumerate(systems)
    )
    lines = []
    wide = f'<td colspan="{len(systems)}">'
    for key in _measured(systems):
        statistic = STATISTICS[key]
        cells = "".join(_cell(system, key) for system in systems)
        expected = f"<b>paper:</b> {escaped(statistic.paper)}; " if statistic.paper else ""
        lines.append(
            f'<tr class="title">{wide}<b>{escaped(statistic.heading)}</b>'
            f" <span>{escaped(statistic.meaning)}</span></td></tr>"
            f'<tr class="values">{cells}</tr>'
            f'<tr class="order">{wide}{expected}<b>here:</b> {_order(systems, key)}</td></tr>'
        )
    return f'<table class="numbers"><tr>{heads}</tr>{"".join(lines)}</table>'


def bones_table(systems: Sequence[SystemStatistics], setting: Setting) -> str:
    """Mean length and variation of each bone, as an HTML table."""
    rows = []
    for i, (parent, child) in enumerate(setting.bones):
        name = f"{setting.roles[parent]} to {setting.roles[child]}".replace("_", " ")
        lengths = (
            f"{100 * s.bones[i, 0]:.1f} cm<small>{shown(100 * s.bones[i, 1], 2)} %</small>"
            for s in systems
        )
        rows.append((escaped(name), *lengths))
    heads = ["", *(escaped(title_of(system.name)) for system in systems)]
    return html_table(heads, rows, range(1, len(heads)))


def _measured(systems: Sequence[SystemStatistics]) -> list[str]:
    return [key for key in STATISTICS if any(key in system.numbers for system in systems)]


def _value(system: SystemStatistics, key: str) -> float:
    """In the unit shown; NaN where it wasn't measured."""
    number = system.numbers.get(key)
    return math.nan if number is None else STATISTICS[key].factor * number.value


def _cell(system: SystemStatistics, key: str) -> str:
    number = system.numbers.get(key)
    if number is None:
        return f"<td>{MISSING}</td>"
    factor = STATISTICS[key].factor
    text = shown(factor * number.value)
    if number.interval is not None:
        text += f"<small>{' to '.join(shown(factor * end) for end in number.interval)}</small>"
    if key == "velocity":
        text += f"<small>{shown(factor * number.value / FPS)} cm/frame</small>"
    if len(system.seeds) > 1:
        seeds = " · ".join(shown(factor * value) for value in number.by_seed.values())
        text += f'<small class="seeds">{seeds}</small>'
    floor = system.name == REAL and STATISTICS[key].to_real
    return f"<td{' class=floor' if floor else ''}>{text}</td>"


def _order(systems: Sequence[SystemStatistics], key: str) -> str:
    """Names from the largest number to the smallest."""
    values = {
        escaped(title_of(system.name)): _value(system, key)
        for system in systems
        if not (system.name == REAL and STATISTICS[key].to_real)
    }
    known = [name for name in values if not math.isnan(values[name])]
    known.sort(key=lambda name: -values[name])
    text = known[0] if known else MISSING
    for larger, smaller in itertools.pairwise(known):
        text += f" {'≈' if values[larger] <= _ALIKE * values[smaller] else '&gt;'} {smaller}"
    return text


def _grouped(parts: Iterable[Compared]) -> list[list[Compared]]:
    """Neighbours that differ in one side alone, and came out alike, together."""
    groups: list[list[Compared]] = []
    for part in parts:
        together = [*groups[-1], part] if groups else [part]
        one_sided = 1 in (len({p.smaller for p in together}), len({p.larger for p in together}))
        outcomes = {(p.statistic, p.factor, p.holds, _doubts(p)) for p in together}
        if groups and one_sided and len(outcomes) == 1:
            groups[-1] = together
        else:
            groups.append([part])
    return groups


def _comparison(group: Sequence[Compared]) -> str:
    """Both sides with their numbers, and how sure."""
    first = group[0]
    statistic = STATISTICS[first.statistic]
    smaller, larger = (
        ", ".join(
            f"{escaped(title_of(name))} <b>{shown(statistic.factor * value)}</b>"
            for name, value in dict.fromkeys(side)
        )
        for side in ((part.smaller for part in group), (part.larger for part in group))
    )
    sign = "&lt;" if first.holds else "≥"
    multiple = "" if first.factor == 1 else f"{first.factor:g} &times; "
    doubts = _doubts(first)
    doubt = f' <span class="muted">({doubts})</span>' if doubts else ""
    wrong = "" if first.holds else ' class="wrong"'
    return (
        f'<span class="muted">{escaped(statistic.heading)}:</span>'
        f" <span{wrong}>{smaller} {sign} {multiple}{larger}</span>{doubt}"
    )


def _doubts(part: Compared) -> str:
    doubts = ["within the interval"] if part.clear is False else []
    agreeing, seeds = part.seeds_that_agree
    return ", ".join(doubts + ([f"{agreeing} of {seeds} seeds"] if seeds > 1 else []))
