"""The study's figure: lifts with their intervals, and how they change with the lag."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cospeech.errors import CospeechError
from cospeech.files import replacing
from cospeech.reporting.markup import one_line
from cospeech.studies.synchrony.rows import LAGS_S, SynchronyRow

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DIRECTIONS = {
    "audio_to_motion": "audio → motion",
    "motion_to_audio": "motion → audio",
}
_COLOURS = ("#333333", "#b0b0b0", "#4c72b0", "#dd8452", "#55a868", "#c44e52", "#8172b3", "#937860")


def plot_synchrony(rows: Sequence[SynchronyRow], lag_s: float, corpus: str, path: Path) -> None:
    """Draw lifts per system above, and over the lag below, a column per direction.

    Args:
        rows: In the order of the table.
        lag_s: Lag of the upper panels, seconds by which speech follows motion.
        corpus: Name of the corpus and the part, for the title.
        path: Image file to write; its ending chooses the format.

    Raises:
        CospeechError: Matplotlib is not installed.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise CospeechError(
            "plotting the synchrony study needs matplotlib", 'pip install "cospeech[plots]"'
        ) from error
    # A figure of its own, not pyplot's, leaves the caller's backend and open figures alone.
    figure = Figure(figsize=(10.5, 3.6 + 0.36 * len(rows)), layout="constrained")
    FigureCanvasAgg(figure)
    height = 0.8 + 0.36 * len(rows)
    axes = figure.subplots(2, 2, height_ratios=(height, 2.6))
    for column, (direction, title) in enumerate(DIRECTIONS.items()):
        upper, lower = axes[:, column]
        upper.set_title(title, fontsize=11)
        _lifts(upper, rows, direction)
        _profiles(lower, rows, column, lag_s)
    axes[0, 0].set_yticks(range(len(rows)), [row.name for row in rows])
    axes[0, 1].set_yticks(range(len(rows)), [])
    axes[1, 0].set_ylabel("lift")
    figure.suptitle(
        f"Beat consistency over chance on {one_line(corpus)}"
        " (0: mismatched speech, 1: every beat met)",
        x=0.01,
        ha="left",
        fontsize=12,
        parse_math=False,  # a corpus may be called anything: no name is a formula
    )
    with replacing(path) as temporary:
        figure.savefig(temporary, format=path.suffix.removeprefix("."), dpi=160)


def _lifts(axis: Axes, rows: Sequence[SynchronyRow], direction: str) -> None:
    for place, row in enumerate(rows):
        found = getattr(row.at_lag, direction)
        value, interval = found.lift.value, found.interval
        colour = _COLOURS[place % len(_COLOURS)]
        if interval is not None:
            axis.plot(interval, (place, place), color=colour, linewidth=2)
        axis.plot(value, place, "o", color=colour, markersize=6)
        axis.annotate(
            f"{value:+.3f}",
            (value, place),
            xytext=(0, 5),
            textcoords="offset points",
            ha="center",
            fontsize=8.5,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.8},
        )
    axis.axvline(0, color="black", linewidth=0.8)
    axis.locator_params(axis="x", nbins=6)
    axis.set_ylim(len(rows) - 0.5, -0.8)
    axis.set_xlabel("lift, 95 % over recordings", fontsize=10)
    _plain(axis, "x")


def _profiles(axis: Axes, rows: Sequence[SynchronyRow], column: int, lag_s: float) -> None:
    for place, row in enumerate(rows):
        axis.plot(
            LAGS_S,
            row.profile[:, column],
            color=_COLOURS[place % len(_COLOURS)],
            linewidth=2.2 if place == 0 else 1.3,
        )
    axis.axhline(0, color="black", linewidth=0.8)
    axis.axvline(lag_s, color="black", linewidth=0.8, linestyle=":")
    axis.set_xlabel("speech after motion by …, s (dotted: as above)", fontsize=10)
    _plain(axis, "y")


def _plain(axis: Axes, grid: str) -> None:
    axis.spines[["top", "right"]].set_visible(False)
    axis.grid(axis="x" if grid == "x" else "y", alpha=0.3)
    axis.set_axisbelow(True)
    axis.margins(x=0.08)
