"""Stick figures of the corpus report."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import EVALUATION_FPS
from cospeech.reporting.figure import PART_COLOURS, Figure, figure_of
from cospeech.reporting.framing import facing
from cospeech.reporting.joint_names import LEG, says

FIGURES = 8
"""Figures along a window."""

WINDOW_WIDTH = 1120
"""Pixels of a drawn window."""

ARMS = ("right_arm", "left_arm")

_MOST_HEIGHT = 150
_POSE_HEIGHT = 290


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


def draw_figure(
    figure: Figure, points: NDArray[np.float64], scale: float, shown: Sequence[str]
) -> list[str]:
    """SVG elements of one figure.

    Args:
        figure: Its bones.
        points: ``(P, 2)`` what they index, pixels of the picture.
        scale: Pixels per metre.
        shown: Which of `PARTS`, from back to front.
    """
    strokes: dict[tuple[str, float], list[str]] = {}
    for limb in figure.limbs:
        (x1, y1), (x2, y2) = points[limb.upper], points[limb.lower]
        width = float(np.clip(round(110 * limb.radius, 1), 0.9, 4))
        line = f"M{x1:.1f} {y1:.1f}L{x2:.1f} {y2:.1f}"
        strokes.setdefault((limb.part, width), []).append(line)
    elements = []
    for part in shown:
        elements += [
            f'<path class="limb" stroke="{PART_COLOURS[part]}" stroke-width="{width}"'
            f' d="{"".join(lines)}"/>'
            for (own, width), lines in strokes.items()
            if own == part
        ]
        for ball in figure.balls:
            if ball.part == part:
                x, y = points[ball.point]
                radius = max(ball.radius * scale, 2.5)
                elements.append(
                    f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}"'
                    f' fill="{PART_COLOURS[part]}"/>'
                )
    return elements


def draw_pose(store: Store, span: Span) -> str:
    """The middle frame of a span as one SVG: every bone, from the front and the side."""
    motion = clip(store, span)
    motion = motion.slice(len(motion) // 2, len(motion) // 2 + 1)
    figure = figure_of(motion)
    parts, x = [], 0.0
    flats = views(motion, legs=True)
    tallest = max(float(flat[..., 1].max()) for flat in flats.values())
    scale = _POSE_HEIGHT / tallest if tallest > 0 else 1.0
    for name, flat in flats.items():
        points = figure.points(flat[0]) * np.array([scale, -scale])
        left, right = points[:, 0].min() - 30, points[:, 0].max() + 30
        points += np.array([x - left, _POSE_HEIGHT + 24])
        parts += draw_figure(figure, points, scale, ("legs", "body", *ARMS))
        parts.append(
            f'<text x="{x + (right - left) / 2:.0f}" y="{_POSE_HEIGHT + 46}"'
            f' text-anchor="middle">{name}</text>'
        )
        x += right - left
    return (
        f'<svg viewBox="0 0 {x:.0f} {_POSE_HEIGHT + 52}" role="img" class="figures"'
        f' style="width:{x:.0f}px">{"".join(parts)}</svg>'
    )
