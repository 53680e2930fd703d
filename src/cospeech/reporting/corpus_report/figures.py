"""Stick figures of the corpus report."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import EVALUATION_FPS
from cospeech.reporting.charts import chart_style, colour, draw_path, inline_svg, pixel_axes
from cospeech.reporting.figure import PART_COLOURS, Figure, figure_of
from cospeech.reporting.framing import facing
from cospeech.reporting.joint_names import LEG, says

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FIGURES = 8
"""Figures along a window."""

WINDOW_WIDTH = 1120
"""Pixels of a drawn window."""

ARMS = ("right_arm", "left_arm")

_MOST_HEIGHT = 150
_POSE_HEIGHT = 290
_APART = 30


def figure_scale(store: Store, spans: Sequence[Span]) -> float:
    """Pixels per metre (or keypoint pixel) at which the figures of all windows fit their places."""
    sizes = []
    for span in spans:
        flats = list(views(clip(store, span), legs=False).values())
        # a frame that jumps must not shrink all others
        reach = max(float(np.percentile(np.abs(flat[..., 0]), 99.5)) for flat in flats)
        sizes.append((reach, float(np.percentile(flats[0][..., 1], 99.5))))
    # and neither must a window whose unit is wrong
    usual = np.median(sizes, axis=0)
    reach, height = np.minimum(np.max(sizes, axis=0), 1.5 * usual)
    place = 0.94 * WINDOW_WIDTH / FIGURES
    fitting = [
        room / size for room, size in ((place / 2, reach), (_MOST_HEIGHT, height)) if size > 0
    ]
    return float(min(fitting, default=1.0))


def clip(store: Store, span: Span) -> Motion:
    """The motion of a span at its native rate: whole frames that begin in it."""
    motion = store.motion(span.recording)
    ratio = motion.fps / EVALUATION_FPS
    first = min(round(span.start * ratio), len(motion) - 1)
    return motion.slice(first, max(first + 1, round(span.stop * ratio)))


def views(motion: Motion, legs: bool) -> dict[str, NDArray[np.float64]]:
    """Each view as ``(T, J, 2)``, right and up: travel removed, in the middle of its place.

    The lowest joint drawn is at height 0 and the root at one place all the time; the clip's reach
    to both sides of 0 is equal. 3-D motion is turned to face the reader (mean heading of the clip);
    the side view is seen from the speaker's right.

    Args:
        motion: The clip.
        legs: Whether legs are drawn, and so count for the lowest joint.
    """
    positions = motion.positions.astype(np.float64)
    positions = positions - positions[:, :1] * np.array([1.0, 0.0, 1.0])[: motion.dimensions]
    drawn = [i for i, joint in enumerate(motion.skeleton.joints) if legs or not says(joint, LEG)]
    positions[..., 1] -= np.percentile(positions[:, drawn, 1].min(axis=1), 2)
    x, y = positions[..., 0], positions[..., 1]
    across = {"front": x}
    if motion.dimensions == 3:
        yaw, z = facing(motion), positions[..., 2]
        across["front"] = x * np.cos(yaw) - z * np.sin(yaw)
        across["side"] = x * np.sin(yaw) + z * np.cos(yaw)
    return {
        name: np.stack([right - np.percentile(right[:, drawn], [0.5, 99.5]).mean(), y], axis=-1)
        for name, right in across.items()
    }


def draw_figures(
    axes: Axes, figure: Figure, points: NDArray[np.float64], scale: float, shown: Sequence[str]
) -> None:
    """Draw figures of one skeleton.

    Args:
        axes: In pixels of a page.
        figure: Their bones.
        points: ``(F, P, 2)`` what those index, pixels.
        scale: Pixels per metre.
        shown: Which of `PARTS`, from back to front.
    """
    strokes: dict[tuple[str, float], list[list[int]]] = {}
    for limb in figure.limbs:
        width = float(np.clip(round(110 * limb.radius, 1), 0.9, 4))
        strokes.setdefault((limb.part, width), []).append([limb.upper, limb.lower])
    for part in shown:
        ink = PART_COLOURS[part]
        for (own, width), bones in strokes.items():
            if own == part:
                ends, stroke = points[:, bones].reshape(-1, 2, 2), {"ec": ink, "lw": width}
                draw_path(axes, ends, fill=False, capstyle="round", **stroke)
        for ball in figure.balls:
            if ball.part == part:
                size = 2 * max(ball.radius * scale, 2.5)
                axes.plot(*points[:, ball.point].T, "o", c=ink, ms=size, mew=0, zorder=1)


@chart_style()
def draw_pose(store: Store, span: Span) -> str:
    """The middle frame of a span in HTML: every bone, from the front and the side."""
    motion = clip(store, span)
    motion = motion.slice(len(motion) // 2, len(motion) // 2 + 1)
    figure = figure_of(motion)
    flats = views(motion, legs=True)
    tallest = max(float(flat[..., 1].max()) for flat in flats.values())
    scale = _POSE_HEIGHT / tallest if tallest > 0 else 1.0
    poses = [figure.points(flat[0]) * scale for flat in flats.values()]
    lefts = np.array([pose[:, 0].min() - _APART for pose in poses])
    widths = [pose[:, 0].max() + _APART for pose in poses] - lefts
    starts = np.cumsum([0.0, *widths])
    picture, axes = pixel_axes(starts[-1], _POSE_HEIGHT + 52)
    places = np.stack([starts[:-1] - lefts, np.full(len(poses), 28.0)], axis=-1)
    points = np.stack(poses) + places[:, None]
    draw_figures(axes, figure, points, scale, ("legs", "body", *ARMS))
    for name, start, width in zip(flats, starts, widths, strict=False):
        axes.text(start + width / 2, 6, name, ha="center", color=colour("muted"))
    return f'<div style="width: {starts[-1]:.0f}px">{inline_svg(picture, "figures")}</div>'
