"""The paper's figure 2: controlled quantities over the time of one recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cospeech.reporting.charts import SERIES, chart_style, colour, new_figure, save_picture
from cospeech.reporting.markup import one_line
from cospeech.studies.control_adherence.motions import Values

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHOWN_S = 24.0
"""As long as the paper's clips."""

_BAND = "#e9e4da"
_SPEEDS_SHOWN = 0.985


@dataclass(frozen=True, eq=False)
class Panel:
    """One control's curves.

    Attributes:
        title: What was asked for.
        unit: ``cm`` or ``cm/s``.
        stages: Stage -> its values over time, in that unit.
        free: The same without control, of the last stage.
        wanted: (from s, to s, lowest, highest) ranges that were asked for, in that unit.
    """

    title: str
    unit: str
    stages: Mapping[str, Values]
    free: Values
    wanted: Sequence[tuple[float, float, float, float]]


@chart_style()
def plot_adherence(panels: Sequence[Panel], fps: float, title: str, path: Path) -> None:
    """Draw a panel per control.

    Args:
        panels: Two in a row.
        fps: Of the curves.
        title: Of the whole.
        path: Image file to write; its ending chooses the format.
    """
    rows = -(-len(panels) // 2)
    figure = new_figure(792, 65 + 148 * rows, "constrained")
    axes = figure.subplots(rows, 2, squeeze=False, sharex=True)
    for axis, panel in zip(axes.flat, panels, strict=False):
        _draw(axis, panel, fps)
    for axis in list(axes.flat)[len(panels) :]:
        axis.set_visible(False)
    for axis in axes[-1]:
        axis.set_xlabel("s")
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=5, frameon=False
    )
    figure.suptitle(one_line(title), x=0.01, ha="left", fontsize=12)
    save_picture(figure, path)


def _draw(axis: Axes, panel: Panel, fps: float) -> None:
    frames = min(len(panel.free), round(SHOWN_S * fps))
    times_s = np.arange(frames) / fps
    values = np.concatenate([panel.free[:frames], *(v[:frames] for v in panel.stages.values())])
    limits = [edge for *_, least, most in panel.wanted for edge in (least, most)]
    shown = [edge for edge in limits if np.isfinite(edge)]
    speed = panel.unit.endswith("/s")
    # Seams are leaps of a single frame: all of their height would flatten the rest.
    high = max([*shown, np.quantile(values, _SPEEDS_SHOWN) if speed else values.max()])
    low = 0.0 if speed else min([*shown, values.min()])
    margin = 0.06 * max(high - low, 1e-6)
    low, high = low - (0 if speed else margin), high + margin
    for i, (from_s, to_s, least, most) in enumerate(panel.wanted):
        to_s = min(to_s, frames / fps)
        label = "asked for" if i == 0 else None
        bottom, top = (float(np.clip(end, low, high)) for end in (least, most))
        axis.fill_between([from_s, to_s], bottom, top, color=_BAND, linewidth=0, label=label)
        for threshold in (least, most):
            if np.isfinite(threshold):
                axis.plot(
                    [from_s, to_s], [threshold] * 2, color=colour("text"), linewidth=0.9, ls="--"
                )
    axis.plot(
        times_s, panel.free[:frames], color=colour("muted"), linewidth=0.9, label="without control"
    )
    for (stage, curve), ink in zip(panel.stages.items(), SERIES, strict=False):
        axis.plot(times_s, curve[:frames], color=colour(ink), linewidth=1.3, label=one_line(stage))
    axis.set_title(one_line(panel.title))
    axis.set_ylabel(panel.unit)
    axis.set_xlim(0, frames / fps)
    axis.set_ylim(low, high)
