"""Shares, durations and transitions of gesture phases, system by system."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cospeech.metrics.phase_structure import PhaseStructure
from cospeech.reporting.charts import (
    chart_style,
    colour,
    inline_svg,
    new_axes,
    new_figure,
    phase_colours,
    titled,
)
from cospeech.reporting.markup import escaped, one_line

Row = tuple[str, PhaseStructure]
"""A system's title and its phases."""

_LABEL, _WIDTH = 196, 1080
_LONGEST = 2.5
_STRONG = 0.55


@chart_style()
def share_chart(rows: Sequence[Row], classes: Sequence[str]) -> str:
    """Shares of time as stacked SVG bars, one per row, with a legend."""
    figure, axes = new_axes(_WIDTH, 34 + 30 * len(rows), _LABEL, right=8, top=28, bottom=2)
    shares = np.nan_to_num([structure.shares for _, structure in rows])
    starts = np.cumsum(shares, axis=1) - shares
    for k, phase in enumerate(classes):
        name, (fill, ink) = _name(phase), phase_colours(phase)
        bars = axes.barh(
            range(len(rows)),
            shares[:, k],
            left=starts[:, k],
            height=0.74,
            color=fill,
            edgecolor=colour("panel"),
            label=name,
        )
        for row, bar in enumerate(bars):
            share = float(shares[row, k])
            titled(bar, f"{name}: {100 * share:.1f} %")
            if share > 0.03:
                place = (starts[row, k] + share / 2, row)
                text = f"{100 * share:.0f} %"
                axes.annotate(text, place, color=ink, ha="center", va="center")
    axes.set(xlim=(0, 1), ylim=(len(rows) - 0.5, -0.5))
    axes.set_xticks([])
    axes.set_yticks(range(len(rows)), [one_line(title) for title, _ in rows], color=colour("text"))
    axes.spines[:].set_visible(False)
    axes.legend(
        loc="lower left", bbox_to_anchor=(0, 1), ncols=len(classes), handlelength=1, borderpad=0
    )
    return inline_svg(figure, "plot")


@chart_style()
def duration_chart(rows: Sequence[Row], classes: Sequence[str]) -> str:
    """Mean duration of each phase: a panel per phase, a row per system; the line is the first's.

    The axis ends at 2.5 times the first's longest; what lasts longer ends in an arrow.
    """
    durations = np.array([structure.mean_durations_s for _, structure in rows])
    longest = min(np.nanmax([*durations.flat, 0.1]), _LONGEST * np.nanmax([*durations[0], 0.1]))
    height = 62 + 24 * len(rows)
    figure = new_figure(_WIDTH, height)
    figure.subplots_adjust(_LABEL / _WIDTH, 36 / height, 1, 1 - 24 / height, 0.1)
    panels = figure.subplots(1, len(classes), sharey=True, squeeze=False)[0]
    # on the ground of the page, so that no line runs through a number
    ground = {"facecolor": colour("panel"), "edgecolor": "none", "pad": 1}
    beside: dict[str, Any] = {"textcoords": "offset points", "va": "center", "bbox": ground}
    beside["color"] = colour("muted")
    first: dict[str, Any] = {"ls": (0, (5, 4)), "lw": 1, "alpha": 0.6, "zorder": 1}
    for k, (phase, axes) in enumerate(zip(classes, panels, strict=True)):
        fill, _ = phase_colours(phase)
        axes.set_title(_name(phase), fontsize=11.5)
        for row, value in enumerate(durations[:, k].tolist()):
            if not np.isfinite(value):
                axes.annotate("never", (0, row), (4, 0), **beside)
                continue
            end = min(value, longest)
            axes.hlines(row, 0, end, color=fill, linewidth=3)
            axes.plot(end, row, "o" if value <= longest else ">", color=fill, markersize=9)
            axes.annotate(f"{value:.2f}", (end, row), (9, 0), **beside)
        if np.isfinite(durations[0, k]):
            axes.axvline(durations[0, k], color=colour("text"), **first)
        # room for the number to the right of the longest bar
        axes.set(xlim=(0, 1.4 * longest), ylim=(len(rows) - 0.5, -0.5))
        axes.locator_params(axis="x", nbins=3)
        axes.xaxis.set_major_formatter("{x:g}")
        axes.spines[:].set_visible(False)
        axes.grid(axis="x")
    panels[0].set_yticks(range(len(rows)), [one_line(t) for t, _ in rows], color=colour("text"))
    middle = (1 + _LABEL / _WIDTH) / 2
    figure.text(middle, 4 / height, "mean duration, s", color=colour("muted"), ha="center")
    return inline_svg(figure, "plot")


def transition_matrices(rows: Sequence[Row], classes: Sequence[str]) -> str:
    """What follows what, in HTML: a matrix per system, from the row's phase to the column's."""
    names = [escaped(_name(phase)) for phase in classes]
    heads = "".join(f"<th><span>{name}</span></th>" for name in names)
    panels = []
    for title, structure in rows:
        lines = []
        for i, shares in enumerate(structure.transitions):
            cells = "".join(_cell(float(share), i == j) for j, share in enumerate(shares))
            lines.append(f"<tr><th>{names[i]}</th>{cells}</tr>")
        panels.append(
            f"<figure><figcaption><b>{escaped(title)}</b></figcaption>"
            f'<table class="matrix"><tr><th></th>{heads}</tr>{"".join(lines)}</table></figure>'
        )
    return f'<div class="matrices">{"".join(panels)}</div>'


def _cell(share: float, diagonal: bool) -> str:
    if diagonal:
        return "<td></td>"
    if not np.isfinite(share):
        return "<td>\N{EN DASH}</td>"
    strong = ' class="strong"' if share > _STRONG else ""
    return f'<td{strong} style="--share: {100 * share:.0f}%">{100 * share:.0f}</td>'


def _name(phase: str) -> str:
    return one_line(phase.replace("_", " "))
