"""Shares, durations and transitions of gesture phases, system by system."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cospeech.metrics.gesture_statistics.phase_structure import PhaseStructure
from cospeech.reporting.chart import ticks
from cospeech.reporting.gesture_figures.looks import phase_style
from cospeech.reporting.markup import escaped

Row = tuple[str, PhaseStructure]
"""A system's title and its phases."""

_LABEL, _WIDTH, _ROW = 196, 1080, 30
_LONGEST = 2.5


def share_chart(rows: Sequence[Row], classes: Sequence[str]) -> str:
    """Shares of time as stacked SVG bars, one per row, with a legend."""
    room = _WIDTH - _LABEL - 8
    height = _ROW * len(rows) + 34
    parts = [f'<svg viewBox="0 0 {_WIDTH} {height}" role="img" class="plot">']
    x = float(_LABEL)
    for phase in classes:
        parts.append(
            f'<rect class="{phase_style(phase)}" x="{x:.1f}" y="4" width="13" height="13" rx="2"/>'
            f'<text class="name" x="{x + 19:.1f}" y="15">{escaped(phase.replace("_", " "))}'
            "</text>"
        )
        x += 40 + 7.2 * len(phase)
    for i, (title, structure) in enumerate(rows):
        y = 28 + _ROW * i
        parts.append(
            f'<text class="name" x="{_LABEL - 10}" y="{y + 16}" text-anchor="end">'
            f"{escaped(title)}</text>"
        )
        x = float(_LABEL)
        for phase, share in zip(classes, structure.shares, strict=True):
            width = room * (share if np.isfinite(share) else 0.0)
            if width <= 0:
                continue
            text = f"{100 * share:.0f}"
            parts.append(
                f'<rect class="{phase_style(phase)}" x="{x:.1f}" y="{y}" width="{width:.1f}"'
                f' height="{_ROW - 8}"><title>{escaped(phase)}: {100 * share:.1f} %</title>'
                "</rect>"
            )
            if width > 26:
                parts.append(
                    f'<text class="in {phase_style(phase)}" x="{x + width / 2:.1f}"'
                    f' y="{y + 15.5}" text-anchor="middle">{text} %</text>'
                )
            x += width
    return "".join(parts) + "</svg>"


def duration_chart(rows: Sequence[Row], classes: Sequence[str]) -> str:
    """Mean duration of each phase: a panel per phase, a row per system; the line is the first's.

    The axis ends at 2.5 times the first's longest; what lasts longer ends in an arrow.
    """
    first_row = np.nanmax([0.1, *rows[0][1].mean_durations_s])
    every = np.nanmax([[0.1, *structure.mean_durations_s] for _, structure in rows])
    longest = min(every, _LONGEST * first_row)
    gap = 18.0
    panel = (_WIDTH - _LABEL - gap * len(classes)) / len(classes)
    floor = 26 + 24 * len(rows)
    parts = [f'<svg viewBox="0 0 {_WIDTH} {floor + 36}" role="img" class="plot">']
    for i, (title, _) in enumerate(rows):
        parts.append(
            f'<text class="name" x="{_LABEL - 10}" y="{26 + 24 * i + 15}" text-anchor="end">'
            f"{escaped(title)}</text>"
        )
    for k, phase in enumerate(classes):
        left = _LABEL + k * (panel + gap)
        # room for the number to the right of the longest bar
        scale = (panel - 42) / longest
        parts.append(
            f'<text class="name" x="{left:.1f}" y="15">{escaped(phase.replace("_", " "))}</text>'
        )
        for tick in ticks(0.0, float(longest), 3):
            x = left + tick * scale
            parts.append(
                f'<path class="grid" d="M{x:.1f} 22V{floor}"/><text x="{x:.1f}" y="{floor + 15}"'
                f' text-anchor="middle">{tick:g}</text>'
            )
        first = float(rows[0][1].mean_durations_s[k])
        if np.isfinite(first):
            parts.append(f'<path class="median" d="M{left + first * scale:.1f} 22V{floor}"/>')
        for i, (_, structure) in enumerate(rows):
            value = float(structure.mean_durations_s[k])
            y = 26 + 24 * i + 11
            if not np.isfinite(value):
                parts.append(f'<text class="halo" x="{left + 4:.1f}" y="{y + 4}">never</text>')
                continue
            end = left + min(value, longest) * scale
            mark = (
                f'<circle class="{phase_style(phase)}" cx="{end:.1f}" cy="{y}" r="4.5"/>'
                if value <= longest
                else f'<path class="{phase_style(phase)}" d="M{end - 3:.1f} {y - 6}l9 6l-9 6z"/>'
            )
            parts.append(
                f'<path class="stem {phase_style(phase)}" d="M{left:.1f} {y}H{end:.1f}"/>{mark}'
                f'<text class="halo" x="{end + 9:.1f}" y="{y + 4}">{value:.2f}</text>'
            )
    middle = _LABEL + (_WIDTH - _LABEL) / 2
    parts.append(
        f'<text x="{middle}" y="{floor + 32}" text-anchor="middle">mean duration, s</text></svg>'
    )
    return "".join(parts)


def transition_matrices(rows: Sequence[Row], classes: Sequence[str]) -> str:
    """What follows what, in HTML: a matrix per system, from the row's phase to the column's."""
    cell, left, top = 40, 86, 26
    size = cell * len(classes)
    names = [phase.replace("_", " ") for phase in classes]
    panels = []
    for title, structure in rows:
        parts = [
            f'<svg viewBox="0 0 {left + size + 4} {top + size + 4}" role="img" class="matrix">'
        ]
        for k, name in enumerate(names):
            short = name if len(name) <= 6 else f"{name[:5]}."
            parts.append(
                f'<text x="{left + cell * (k + 0.5)}" y="{top - 9}" text-anchor="middle">'
                f"{escaped(short)}</text>"
                f'<text x="{left - 8}" y="{top + cell * (k + 0.5) + 4}" text-anchor="end">'
                f"{escaped(name)}</text>"
            )
        for i, row in enumerate(structure.transitions):
            for j, share in enumerate(row):
                x, y = left + cell * j, top + cell * i
                known = np.isfinite(share) and i != j
                strength = float(share) if known else 0.0
                text = "" if i == j else f"{100 * share:.0f}" if known else "\N{EN DASH}"
                ink = "dark" if strength > 0.55 else "light"
                parts.append(
                    f'<rect class="cell" x="{x}" y="{y}" width="{cell - 2}" height="{cell - 2}"'
                    f' rx="3"/><rect class="heat" x="{x}" y="{y}" width="{cell - 2}"'
                    f' height="{cell - 2}" rx="3" fill-opacity="{strength:.3f}"><title>'
                    f"{escaped(names[i])} to {escaped(names[j])}</title></rect>"
                    f'<text class="{ink}" x="{x + cell / 2 - 1}" y="{y + cell / 2 + 3}"'
                    f' text-anchor="middle">{text}</text>'
                )
        panels.append(
            f"<figure><figcaption><b>{escaped(title)}</b></figcaption>{''.join(parts)}</svg>"
            "</figure>"
        )
    return f'<div class="matrices">{"".join(panels)}</div>'
