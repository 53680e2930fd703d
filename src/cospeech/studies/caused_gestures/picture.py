"""The study's figure: who answers what, and how late."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cospeech.reporting.charts import SERIES, chart_style, colour, new_figure, save_picture
from cospeech.reporting.markup import one_line
from cospeech.studies.caused_gestures.measuring import LAGS_S, SystemNumbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PANELS = {
    "concept_place": "words: place of the concept\n(0.5: luck, 1: always the likest)",
    "words_answered": "words: faster than\nbetween strokes (0.5: luck)",
    "beats_answered": "beats: faster than\nbetween strokes (0.5: luck)",
    "beats_lift": "beats met by a peak of speed\n(0: chance, 1: all)",
}
"""Number -> title of its panel."""

_NOTHING = {"beats_lift": 0.0}
_COLOURS = ("c0", "c8", *SERIES)


@chart_style()
def plot_caused_gestures(systems: Sequence[SystemNumbers], corpus: str, path: Path) -> None:
    """Draw a panel per number above, and the wrists' speed at the beats over the lag below.

    Args:
        systems: In the order of the table.
        corpus: Name of the corpus and the part, for the title.
        path: Image file to write; its ending chooses the format.
    """
    figure = new_figure(980, 350 + 22 * len(systems), "constrained")
    height = 1.0 + 0.3 * len(systems)
    grid = figure.add_gridspec(2, len(PANELS), height_ratios=(height, 2.6))
    for column, (key, title) in enumerate(PANELS.items()):
        axes = figure.add_subplot(grid[0, column])
        axes.set_title(title, loc="center", fontsize=10)
        _draw_numbers(axes, systems, key)
        names = [one_line(system.name) for system in systems] if column == 0 else []
        axes.set_yticks(range(len(systems)), names or [""] * len(systems), color=colour("text"))
    _draw_profiles(figure.add_subplot(grid[1, :]), systems)
    figure.suptitle(
        f"Caused gestures of {one_line(corpus)}, 95 % over takes", x=0.01, ha="left", fontsize=12
    )
    save_picture(figure, path)


def _draw_numbers(axes: Axes, systems: Sequence[SystemNumbers], key: str) -> None:
    for place, system in enumerate(systems):
        number = system.numbers[key]
        if not np.isfinite(number.value):
            continue
        ink = colour(_COLOURS[place % len(_COLOURS)])
        if number.interval is not None:
            axes.plot(number.interval, (place, place), color=ink, linewidth=2)
        axes.plot(number.value, place, "o", color=ink, markersize=6)
        for value in number.by_seed if len(number.by_seed) > 1 else ():
            axes.plot(value, place, "|", color=ink, markersize=10)
    axes.axvline(_NOTHING.get(key, 0.5), color=colour("text"), linewidth=0.8)
    axes.locator_params(axis="x", nbins=5)
    axes.set_ylim(len(systems) - 0.5, -0.5)
    axes.grid(axis="x")
    axes.margins(x=0.08)


def _draw_profiles(axes: Axes, systems: Sequence[SystemNumbers]) -> None:
    for place, system in enumerate(systems):
        axes.plot(
            LAGS_S,
            system.profile,
            color=colour(_COLOURS[place % len(_COLOURS)]),
            linewidth=2.2 if place == 0 else 1.3,
            label=one_line(system.name),
        )
    axes.axvline(0, color=colour("text"), linewidth=0.8)
    axes.set_xlabel("seconds after the recorded beats", fontsize=10)
    axes.set_ylabel("rank of the wrists' speed")
    axes.grid(axis="y")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=9)
