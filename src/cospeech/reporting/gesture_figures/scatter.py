"""Where the arms were over two minutes (the paper's figure 1), one small picture per system."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cospeech.metrics.gesture_statistics.systems import Setting, SystemStatistics
from cospeech.reporting.gesture_figures.looks import title_of
from cospeech.reporting.markup import escaped

_SCALE = 190.0
_GRID = 0.25
_LARGEST = 2.0
_LAYERS = 12
_JOINTS = (
    ("left_elbow", "left elbow"),
    ("right_elbow", "right elbow"),
    ("left_wrist", "left wrist"),
    ("right_wrist", "right wrist"),
)


def scatter_panels(systems: Sequence[SystemStatistics], setting: Setting) -> str:
    """Front views of wrists and elbows around the training data's mean pose, as SVG in HTML.

    All have one scale, and a grid of 25 cm. A panel is at most twice as wide and high as real's
    positions; what lies beyond is counted under its name.

    Args:
        systems: Real first.
        setting: Roles, bones and mean pose.
    """
    index = {role: i for i, role in enumerate(setting.roles)}
    joints = [index[role] for role, _ in _JOINTS]
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
        f'<span><svg viewBox="0 0 14 14" class="key"><path class="dot {_style(role)}"'
        f' d="M7 7h0"/></svg>{name}</span>'
        for role, name in _JOINTS
    )
    return f'<p class="keys">{legend}</p><div class="scatters">{"".join(panels)}</div>'


def _style(role: str) -> str:
    return role.replace("_", " ")


def _panel(
    points: np.ndarray, pose: np.ndarray, setting: Setting, low: np.ndarray, high: np.ndarray
) -> str:
    width, height = _SCALE * (high - low)

    def at(place: np.ndarray) -> str:
        return f"{_SCALE * (place[0] - low[0]):.1f} {_SCALE * (high[1] - place[1]):.1f}"

    parts = [f'<svg viewBox="0 0 {width:.0f} {height:.0f}" role="img" class="scatter">']
    for axis in (0, 1):
        for value in np.arange(np.ceil(low[axis] / _GRID), high[axis] / _GRID) * _GRID:
            ends = np.array([low, high])
            ends[:, axis] = value
            parts.append(f'<path class="grid" d="M{at(ends[0])}L{at(ends[1])}"/>')
    bones = "".join(
        f"M{at(pose[parent])}L{at(pose[child])}"
        for parent, child in setting.bones
        if not setting.roles[child].endswith("_tip")
    )
    parts.append(f'<path class="pose" d="{bones}"/>')
    for i, (role, _) in enumerate(_JOINTS):
        inside = points[((points[:, i] >= low) & (points[:, i] <= high)).all(-1), i]
        # dots of one path don't darken one another where they overlap; those of several do
        for layer in range(_LAYERS):
            dots = "".join(f"M{at(place)}h0" for place in inside[layer::_LAYERS])
            parts.append(f'<path class="dot {_style(role)}" d="{dots}"/>' if dots else "")
    return "".join(parts) + "</svg>"
