"""The two charts of the paper's figure 11: velocity per step, range per window."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from cospeech.reporting.charts import chart_style, colour, inline_svg, new_axes, titled
from cospeech.reporting.markup import one_line
from cospeech.studies.multi_adversary_figures.measured import FPS, SystemStatistics
from cospeech.studies.multi_adversary_figures.styles import style_of, title_of

_WIDTH, _HEIGHT, _LEFT = 1080, 420, 62
_MARK_EVERY = 14
_GOLDEN = 0.6180339887
_STRIP_GAP = 0.22
_CM = 100.0


@chart_style()
def velocity_chart(systems: Sequence[SystemStatistics]) -> str:
    """Median wrist velocity at each step, every system in one SVG chart.

    Lines differ in dash and marker too, and are named in the order in which they end. The band is
    the 95 % interval of real's curve.

    Args:
        systems: Real first.
    """
    figure, axes = new_axes(_WIDTH, _HEIGHT, _LEFT, right=282, top=22, bottom=46)
    steps = np.arange(1, len(systems[0].velocity) + 1)
    handles = []
    for place, system in reversed(list(enumerate(systems))):
        style = style_of(place)
        title = one_line(title_of(system.name))
        (line,) = axes.plot(
            steps,
            _CM * system.velocity,
            color=colour(style.colour),
            linewidth=1.8 if place else 3.4,
            linestyle=(0, style.dash) if style.dash else "-",
            marker=style.marker,
            markersize=6,
            markeredgecolor=colour("panel"),
            markevery=((3 + 5 * place) % _MARK_EVERY, _MARK_EVERY),
            label=title,
        )
        titled(line, title)
        handles.append((float(system.velocity[-1]), -place, line))
    band = systems[0].velocity_band
    if band is not None:
        axes.fill_between(steps, *(_CM * band), color=colour("c0"), alpha=0.1, linewidth=0)
    axes.set_ylim(bottom=0)
    axes.set_xticks([1, *range(10, len(steps) + 1, 10)])
    axes.yaxis.set_major_formatter("{x:g}")
    axes.grid(axis="y")
    axes.set_xlabel(f"predicted step ({FPS:g} per second, {len(steps)} of them)")
    axes.set_ylabel("median wrist velocity, cm/s")
    per_frame = axes.secondary_yaxis(
        "right",
        functions=(lambda speed: np.divide(speed, FPS), lambda move: np.multiply(move, FPS)),
    )
    per_frame.set_ylabel("cm per frame")
    per_frame.yaxis.set_major_formatter("{x:g}")
    axes.legend(
        handles=[line for *_, line in sorted(handles, reverse=True)],
        loc="center left",
        bbox_to_anchor=(1.08, 0.5),
        handlelength=3.5,
        fontsize=11,
    )
    return inline_svg(figure, "plot")


@chart_style()
def range_chart(systems: Sequence[SystemStatistics]) -> str:
    """Range of each window as a point, quartiles as a box, one column per system, in SVG.

    Training seeds have their points side by side, and one box together. The dashed line is the
    median of real motion.
    """
    figure, axes = new_axes(_WIDTH, _HEIGHT, _LEFT, right=16, top=22, bottom=56)
    axes.set_xlim(-0.5, len(systems) - 0.5)
    under: dict[str, Any] = {"ha": "center", "transform": axes.transAxes}
    slot = (_WIDTH - _LEFT - 16) / len(systems)
    for place, system in enumerate(systems):
        style, values = style_of(place), _CM * system.ranges
        ink = colour(style.colour)
        width = min(44 / slot, 0.34)
        drawn = axes.boxplot(
            values.ravel(),
            positions=[place - 0.06 - width / 2],
            widths=width,
            whis=(0, 100),
            showcaps=False,
            patch_artist=True,
            manage_ticks=False,
            boxprops={"facecolor": f"{ink}29", "edgecolor": ink, "linewidth": 1.2},
            whiskerprops={"color": ink, "linewidth": 1.2},
            medianprops={"color": ink, "linewidth": 3},
        )
        first, middle, last = np.quantile(values, [0.25, 0.5, 0.75]).tolist()
        text = f"median {middle:.1f} cm, quartiles {first:.1f} and {last:.1f} cm"
        titled(drawn["boxes"][0], text)
        # the golden ratio spreads neighbours in rank evenly over the column, without a draw
        seeds, count = values.shape
        offsets = _STRIP_GAP + (1 - _STRIP_GAP) * ((np.arange(count) * _GOLDEN) % 1.0)
        strip = min(60.0 * seeds / slot, 0.44) / seeds
        for seed in range(seeds):
            axes.plot(
                place + strip * (seed + offsets),
                np.sort(values[seed]),
                style.marker or "o",
                color=ink,
                markersize=5.5,
                markeredgewidth=0,
                alpha=0.62,
            )
        name = textwrap.wrap(one_line(title_of(system.name)), max(8, int(slot / 7.5)))
        for row, line in enumerate(name):
            # line by line: each is centred in whatever font the page has
            axes.text((place + 0.5) / len(systems), -0.055 - 0.04 * row, line, **under)
    reals = axes.axhline(float(np.median(_CM * systems[0].ranges)), ls=(0, (5, 4)), lw=1)
    reals.set(color=colour("text"), alpha=0.6, zorder=1)
    low, high = axes.get_ylim()
    axes.set_ylim(0 if low < 0.4 * high else low, high)
    axes.set_xticks([])
    axes.yaxis.set_major_formatter("{x:g}")
    axes.grid(axis="y")
    axes.set_ylabel("largest distance from the mean pose, cm")
    return inline_svg(figure, "plot")
