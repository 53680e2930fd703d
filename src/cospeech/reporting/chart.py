"""Line charts as inline SVG."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from cospeech.reporting.markup import escaped

SERIES_COLOURS: tuple[str, ...] = (
    "#3f8efc", "#f0883e", "#3f9d5b", "#d1495b", "#8e6fc1", "#c29a2c", "#2a9d9d", "#d86fa8",
    "#7a8797", "#8c5e3c",
)  # fmt: skip
"""One per group; they repeat after ten."""

_WIDTH, _HEIGHT = 720, 300
_LEFT, _RIGHT, _TOP, _BOTTOM = 58, 14, 14, 38
_LOG_RATIO = 30
_FARTHEST = 1e100


@dataclass(frozen=True)
class Line:
    """A line of a chart.

    Attributes:
        name: Shown when the pointer rests on it.
        colour: CSS colour.
        points: (x, y) in order of x; points that are not finite, or beyond 1e100, are left out.
    """

    name: str
    colour: str
    points: Sequence[tuple[float, float]]


def line_chart(lines: Sequence[Line], x_title: str, y_title: str) -> str:
    """An SVG element with axes and lines.

    The vertical axis is logarithmic, and says so, where positive values span more than a factor
    of 30.

    Args:
        lines: At least one with a finite point.
        x_title: Under the horizontal axis.
        y_title: Beside the vertical axis.

    Returns:
        ``<svg>...</svg>`` that needs no other file; empty when there is nothing to draw.
    """
    finite = [
        [(x, y) for x, y in line.points if abs(x) < _FARTHEST and abs(y) < _FARTHEST]
        for line in lines
    ]
    points = [point for line in finite for point in line]
    if not points:
        return ""
    xs, ys = [x for x, _ in points], [y for _, y in points]
    logarithmic = min(ys) > 1 / _FARTHEST and max(ys) / min(ys) > _LOG_RATIO
    low, high = (math.log10(min(ys)), math.log10(max(ys))) if logarithmic else (min(ys), max(ys))
    if not logarithmic:
        # lines may start at zero when it is near: a tall axis that hides it exaggerates
        low = 0.0 if 0 < low < 0.4 * high else low
    if high - low < 1e-12:
        half = max(0.5, 0.1 * abs(high))
        low, high = low - half, high + half
    x_low, x_high = min(xs), max(xs)
    x_span = (x_high - x_low) or 1.0

    def x_at(x: float) -> float:
        return _LEFT + (x - x_low) / x_span * (_WIDTH - _LEFT - _RIGHT)

    def y_at(y: float) -> float:
        level = math.log10(y) if logarithmic else y
        return _TOP + (high - level) / (high - low) * (_HEIGHT - _TOP - _BOTTOM)

    parts = [f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" class="chart">']
    for tick in _log_ticks(low, high) if logarithmic else ticks(low, high):
        y = y_at(tick)
        parts.append(
            f'<line class="grid" x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'
        )
        parts.append(f'<text x="{_LEFT - 7}" y="{y + 4:.1f}" text-anchor="end">{tick:g}</text>')
    for tick in ticks(x_low, x_high):
        parts.append(
            f'<text x="{x_at(tick):.1f}" y="{_HEIGHT - _BOTTOM + 16}" text-anchor="middle">'
            f"{tick:g}</text>"
        )
    for line, own in zip(lines, finite, strict=True):
        name = escaped(line.name)
        if len(own) == 1:
            x, y = own[0]
            mark = f'<circle cx="{x_at(x):.1f}" cy="{y_at(y):.1f}" r="3" fill="{line.colour}">'
            parts.append(f"{mark}<title>{name}</title></circle>")
        elif own:
            path = " ".join(f"{x_at(x):.1f},{y_at(y):.1f}" for x, y in own)
            parts.append(
                f'<polyline points="{path}" fill="none" stroke="{line.colour}" stroke-width="1.7"'
                f' stroke-linejoin="round"><title>{name}</title></polyline>'
            )
    middle = _TOP + (_HEIGHT - _TOP - _BOTTOM) / 2
    scale = ", logarithmic" if logarithmic else ""
    parts.append(
        f'<text x="{(_LEFT + _WIDTH - _RIGHT) / 2}" y="{_HEIGHT - 5}" text-anchor="middle">'
        f"{escaped(x_title)}</text>"
        f'<text transform="translate(13 {middle}) rotate(-90)" text-anchor="middle">'
        f"{escaped(y_title)}{scale}</text></svg>"
    )
    return "".join(parts)


def ticks(low: float, high: float, count: int = 6) -> list[float]:
    """Round numbers within a range, about ``count`` of them."""
    span = high - low
    if span <= 0:
        return [low]
    rough = span / count
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= rough * 0.999)
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [round(i * step, 12) for i in range(first, last + 1)]


def _log_ticks(low: float, high: float) -> list[float]:
    """1, 2 and 5 times powers of ten between two exponents."""
    powers = range(math.floor(low), math.ceil(high) + 1)
    ticks = [m * 10.0**power for power in powers for m in (1, 2, 5)]
    return [tick for tick in ticks if low - 1e-9 <= math.log10(tick) <= high + 1e-9]
