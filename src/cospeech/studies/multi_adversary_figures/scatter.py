"""Where the arms were over two minutes (the paper's figure 1), one small picture per system."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cospeech.reporting.charts import (
    chart_style,
    colour,
    draw_bones,
    draw_path,
    front_view,
    inline_svg,
)
from cospeech.reporting.markup import escaped
from cospeech.studies.multi_adversary_figures.measured import Setting, SystemStatistics
from cospeech.studies.multi_adversary_figures.styles import title_of

_PX_PER_M = 190.0
_LARGEST = 2.0
_LAYERS = 12
_JOINTS = (
    ("left_elbow", "left elbow", "#9a6b2f"),
    ("right_elbow", "right elbow", "#3d8a86"),
    ("left_wrist", "left wrist", "#e8741c"),
    ("right_wrist", "right wrist", "#2f7fe8"),
)

Array = NDArray[np.float64]


def scatter_panels(systems: Sequence[SystemStatistics], setting: Setting) -> str:
    """Front views of wrists and elbows around the training data's mean pose, as SVG in HTML.

    All have one scale, and a grid of 25 cm. A panel is at most twice as wide and high as real's
    positions; what lies beyond is counted under its name.

    Args:
        systems: Real first.
        setting: Roles, bones and mean pose.
    """
    index = {role: i for i, role in enumerate(setting.roles)}
    joints = [index[role] for role, _, _ in _JOINTS]
    pose = np.asarray(setting.mean_pose, dtype=np.float64)[:, :2]
    real = systems[0].scatter[:, joints, :2]
    everything = np.concatenate([system.scatter[:, joints, :2] for system in systems])
    low, high = real.min(axis=(0, 1)), real.max(axis=(0, 1))
    room = (_LARGEST - 1) / 2 * (high - low)
    low = np.maximum(low - room, np.minimum(everything.min(axis=(0, 1)), low))
    high = np.minimum(high + room, np.maximum(everything.max(axis=(0, 1)), high))
    low, high = np.minimum(low, pose.min(axis=0)) - 0.04, np.maximum(high, pose.max(axis=0)) + 0.04
    panels = []
    for system in systems:
        points = system.scatter[:, joints, :2]
        outside = int(((points < low) | (points > high)).any(-1).any(-1).sum())
        note = f"{len(points)} poses" + (f", {outside} of them beyond" if outside else "")
        picture = _panel(points, pose, setting, low, high)
        panels.append(
            f"<figure><figcaption><b>{escaped(title_of(system.name))}</b>"
            f"<small>{note}</small></figcaption>{picture}</figure>"
        )
    legend = "".join(
        f'<span><i class="swatch" style="background: {ink}"></i>{name}</span>'
        for _, name, ink in _JOINTS
    )
    return f'<p class="keys">{legend}</p><div class="scatters">{"".join(panels)}</div>'


@chart_style()
def _panel(points: Array, pose: Array, setting: Setting, low: Array, high: Array) -> str:
    figure, axes = front_view(low, high, _PX_PER_M)
    bones = [bone for bone in setting.bones if not setting.roles[bone[1]].endswith("_tip")]
    draw_bones(axes, pose, bones, color=colour("muted"), linewidth=2, zorder=0.5)
    for i, (_, _, ink) in enumerate(_JOINTS):
        inside = points[((points[:, i] >= low) & (points[:, i] <= high)).all(-1), i]
        wrist = i >= 2
        # dots of one path don't darken one another where they overlap; those of several do
        for layer in range(_LAYERS):
            draw_path(
                axes,
                np.repeat(inside[layer::_LAYERS, None], 2, axis=1),
                edgecolor=ink,
                fill=False,
                alpha=0.36 if wrist else 0.42,
                linewidth=3.2 if wrist else 2.2,
                capstyle="round" if wrist else "projecting",
            )
    return inline_svg(figure, "scatter")
