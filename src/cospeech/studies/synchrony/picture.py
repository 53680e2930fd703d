"""The study's figure: lifts with their intervals, and how they change with the lag."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from cospeech.reporting.charts import SERIES, chart_style, colour, new_figure, save_picture
from cospeech.reporting.markup import one_line
from cospeech.studies.synchrony.rows import LAGS_S, SynchronyRow

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DIRECTIONS = {
    "audio_to_motion": "audio → motion",
    "motion_to_audio": "motion → audio",
}
_COLOURS = ("c0", "c8", *SERIES)


@chart_style()
def plot_synchrony(rows: Sequence[SynchronyRow], lag_s: float, corpus: str, path: Path) -> None:
    """Draw lifts per system above, and over the lag below, a column per direction.

    Args:
        rows: In the order of the table.
        lag_s: Lag of the upper panels, seconds by which speech follows motion.
        corpus: Name of the corpus and the part, for the title.
        path: Image file to write; its ending chooses the format.
    """
    figure = new_figure(756, 259 + 26 * len(rows), "constrained")
    height = 0.8 + 0.36 * len(rows)
    axes = figure.subplots(2, 2, height_ratios=(height, 2.6))
    for column, (direction, title) in enumerate(DIRECTIONS.items()):
        upper, lower = axes[:, column]
        upper.set_title(title, loc="center")
        _lifts(upper, rows, direction)
        _profiles(lower, rows, column, lag_s)
    names = [one_line(row.name) for row in rows]
    axes[0, 0].set_yticks(range(len(rows)), names, color=colour("text"))
    axes[0, 1].set_yticks(range(len(rows)), [])
    axes[1, 0].set_ylabel("lift")
    figure.suptitle(
        f"Beat consistency over chance on {one_line(corpus)}"
        " (0: mismatched speech, 1: every beat met)",
        x=0.01,
        ha="left",
        fontsize=12,
    )
    save_picture(figure, path)


def _lifts(axis: Axes, rows: Sequence[SynchronyRow], direction: str) -> None:
    for place, row in enumerate(rows):
        found = getattr(row.at_lag, direction)
        value, interval = found.lift.value, found.interval
        ink = colour(_COLOURS[place % len(_COLOURS)])
        if interval is not None:
            axis.plot(interval, (place, place), color=ink, linewidth=2)
        axis.plot(value, place, "o", color=ink, markersize=6)
        axis.annotate(
            f"{value:+.3f}",
            (value, place),
            xytext=(0, 5),
            textcoords="offset points",
            ha="center",
            fontsize=8.5,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.8},
        )
    axis.axvline(0, color=colour("text"), linewidth=0.8)
    axis.locator_params(axis="x", nbins=6)
    axis.set_ylim(len(rows) - 0.5, -0.8)
    axis.set_xlabel("lift, 95 % over recordings", fontsize=10)
    _plain(axis, "x")


def _profiles(axis: Axes, rows: Sequence[SynchronyRow], column: int, lag_s: float) -> None:
    for place, row in enumerate(rows):
        axis.plot(
            LAGS_S,
            row.profile[:, column],
            color=colour(_COLOURS[place % len(_COLOURS)]),
            linewidth=2.2 if place == 0 else 1.3,
        )
    axis.axhline(0, color=colour("text"), linewidth=0.8)
    axis.axvline(lag_s, color=colour("text"), linewidth=0.8, linestyle=":")
    axis.set_xlabel("speech after motion by …, s (dotted: as above)", fontsize=10)
    _plain(axis, "y")


def _plain(axis: Axes, grid: Literal["x", "y"]) -> None:
    axis.grid(axis=grid)
    axis.margins(x=0.08)
