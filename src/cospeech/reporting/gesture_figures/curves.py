"""The two charts of the paper's figure 11: velocity per step, range per window."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from cospeech.metrics.gesture_statistics.systems import REAL, SystemStatistics
from cospeech.reporting.chart import ticks
from cospeech.reporting.gesture_figures.looks import Look, centred_text, title_of
from cospeech.reporting.markup import escaped

_WIDTH, _HEIGHT = 1080, 420
_LEFT, _RIGHT, _TOP, _BOTTOM = 62, 286, 22, 46
_LABEL_APART = 21
_SAMPLE = 34
_TICK_ROOM = 30
_MARK_EVERY = 14
_GOLDEN = 0.6180339887
_STRIP_GAP = 0.22
_CM = 100.0


def velocity_chart(systems: Sequence[SystemStatistics], looks: dict[str, Look], fps: float) -> str:
    """Median wrist velocity at each step, every system in one SVG chart.

    Lines differ in dash and marker too, and each ends at its name. The band is the 95 % interval
    of real's curve.

    Args:
        systems: Real first.
        looks: By name.
        fps: Steps per second.
    """
    curves = {system.name: _CM * system.velocity for system in systems}
    steps = len(systems[0].velocity)
    band = systems[0].velocity_band
    tops = [curve.max() for curve in curves.values()] + ([] if band is None else [_CM * band.max()])
    high = 1.04 * max(1e-6, float(max(tops)))
    right, floor = _WIDTH - _RIGHT, _HEIGHT - _BOTTOM

    def x_at(step: float) -> float:
        return _LEFT + (step - 1) / max(1, steps - 1) * (right - _LEFT)

    def y_at(value: float) -> float:
        return floor - value / high * (floor - _TOP)

    parts = [f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" class="plot">']
    parts += _axes(high, right, floor, fps, steps)
    parts += [
        f'<text x="{x_at(step):.1f}" y="{floor + 18}" text-anchor="middle">{step}</text>'
        for step in [1, *range(10, steps + 1, 10)]
    ]
    if band is not None:
        xs = [x_at(step) for step in range(1, steps + 1)]
        edge = [f"{x:.1f},{y_at(_CM * y):.1f}" for x, y in zip(xs, band[1], strict=True)]
        edge += [f"{x:.1f},{y_at(_CM * y):.1f}" for x, y in zip(xs, band[0], strict=True)][::-1]
        parts.append(f'<polygon class="band" points="{" ".join(edge)}"/>')
    for place, system in reversed(list(enumerate(systems))):
        parts.append(_line(system, looks[system.name], place, curves[system.name], x_at, y_at))
    ends = {name: y_at(float(curve[-1])) for name, curve in curves.items()}
    parts += _names(ends, looks, right, _TOP + 8, floor)
    return "".join(parts) + "</svg>"


def _axes(high: float, right: float, floor: float, fps: float, steps: int) -> list[str]:
    parts = []
    for tick in ticks(0.0, high):
        y = floor - tick / high * (floor - _TOP)
        parts.append(f'<path class="grid" d="M{_LEFT} {y:.1f}H{right}"/>')
        parts.append(f'<text x="{_LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{tick:g}</text>')
    for tick in ticks(0.0, high / fps, 5):
        y = floor - tick * fps / high * (floor - _TOP)
        parts.append(f'<path class="tick" d="M{right} {y:.1f}h4"/>')
        parts.append(f'<text x="{right + 7}" y="{y + 4:.1f}">{tick:g}</text>')
    middle = (floor + _TOP) / 2
    return [
        *parts,
        f'<path class="axis" d="M{_LEFT} {floor}H{right}V{_TOP}"/>',
        f'<text x="{(_LEFT + right) / 2}" y="{_HEIGHT - 8}" text-anchor="middle">predicted step'
        f" ({fps:g} per second, {steps} of them)</text>",
        f'<text transform="translate(16 {middle}) rotate(-90)" text-anchor="middle">median wrist'
        " velocity, cm/s</text>",
        f'<text x="{right + 7}" y="{_TOP - 3}">cm per frame</text>',
    ]


def _line(
    system: SystemStatistics,
    look: Look,
    place: int,
    curve: NDArray[np.float64],
    x_at: Callable[[float], float],
    y_at: Callable[[float], float],
) -> str:
    points = [(x_at(step + 1), y_at(float(value))) for step, value in enumerate(curve)]
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    bold = " bold" if system.name == REAL else ""
    first = (3 + 5 * place) % _MARK_EVERY
    marks = "".join(look.mark(*point) for point in points[first::_MARK_EVERY])
    title = f"<title>{escaped(title_of(system.name))}</title>"
    line = (
        f'<polyline class="line {look.style}{bold}" points="{path}"{_dash(look)}>{title}</polyline>'
    )
    return line + (f'<path class="marker {look.style}" d="{marks}"/>' if marks else "")


def _dash(look: Look) -> str:
    return f' stroke-dasharray="{look.dash}"' if look.dash else ""


def _names(
    ends: dict[str, float], looks: dict[str, Look], right: float, top: float, floor: float
) -> list[str]:
    """Names at the right, each near its line's end, none over another."""
    order = sorted(ends, key=lambda name: ends[name])
    apart = min(_LABEL_APART, (floor - top) / max(1, len(order) - 1))
    places: list[float] = []
    for name in order:
        low = places[-1] + apart if places else top
        places.append(max(ends[name], low))
    overflow = places[-1] - floor
    for i in range(len(places) - 1, -1, -1):
        limit = floor if i == len(places) - 1 else places[i + 1] - apart
        places[i] = min(places[i], limit) if overflow > 0 else places[i]
    parts = []
    for name, y in zip(order, places, strict=True):
        look, x = looks[name], right + 66
        bold = " bold" if name == REAL else ""
        parts.append(
            f'<path class="lead" d="M{right + _TICK_ROOM} {ends[name]:.1f}L{x - 4} {y:.1f}"/>'
            f'<path class="line {look.style}{bold}" d="M{x} {y:.1f}h{_SAMPLE}"{_dash(look)}/>'
        )
        if look.marker:
            parts.append(f'<path class="marker {look.style}" d="{look.mark(x + _SAMPLE / 2, y)}"/>')
        parts.append(
            f'<text class="name" x="{x + _SAMPLE + 8}" y="{y + 4:.1f}">'
            f"{escaped(title_of(name))}</text>"
        )
    return parts


def range_chart(systems: Sequence[SystemStatistics], looks: dict[str, Look]) -> str:
    """Range of each window as a point, quartiles as a box, one column per system, in SVG.

    Training seeds have their points side by side, and one box together. The dashed line is the
    median of real motion.
    """
    values = {system.name: _CM * system.ranges for system in systems}
    lowest = min(float(v.min()) for v in values.values())
    highest = max(float(v.max()) for v in values.values())
    margin = 0.05 * max(highest - lowest, 1.0)
    low, high = max(0.0, lowest - margin), highest + margin
    low = 0.0 if low < 0.4 * high else low
    right, height, bottom = 1064, 420, 56
    floor, slot = height - bottom, (right - _LEFT) / len(systems)

    def y_at(value: float) -> float:
        return floor - (value - low) / (high - low) * (floor - _TOP)

    parts = [f'<svg viewBox="0 0 1080 {height}" role="img" class="plot">']
    for tick in ticks(low, high):
        y = y_at(tick)
        parts.append(f'<path class="grid" d="M{_LEFT} {y:.1f}H{right}"/>')
        parts.append(f'<text x="{_LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{tick:g}</text>')
    middle = y_at(float(np.median(values[systems[0].name])))
    parts.append(f'<path class="median" d="M{_LEFT} {middle:.1f}H{right}"/>')
    for i, system in enumerate(systems):
        centre = _LEFT + slot * (i + 0.5)
        parts += _column(values[system.name], looks[system.name], centre, slot, y_at)
        parts.append(
            centred_text(centre, floor + 20, title_of(system.name), max(8, int(slot / 7.5)), "name")
        )
    parts.append(
        f'<path class="axis" d="M{_LEFT} {floor}H{right}"/>'
        f'<text transform="translate(16 {(floor + _TOP) / 2}) rotate(-90)" text-anchor="middle">'
        "largest distance from the mean pose, cm</text></svg>"
    )
    return "".join(parts)


def _column(
    values: NDArray[np.float64],
    look: Look,
    centre: float,
    slot: float,
    y_at: Callable[[float], float],
) -> list[str]:
    box = min(44.0, 0.34 * slot)
    left = centre - 0.06 * slot - box
    first, middle, last = np.quantile(values, [0.25, 0.5, 0.75]).tolist()
    low, high = values.min(), values.max()
    whiskers = f"M{left + box / 2:.1f} {y_at(low):.1f}V{y_at(first):.1f}M{left + box / 2:.1f} "
    whiskers += f"{y_at(last):.1f}V{y_at(high):.1f}"
    marker = look.marker or "M{x} {y}m-3.2 0a3.2 3.2 0 1 0 6.4 0a3.2 3.2 0 1 0 -6.4 0z"
    # the golden ratio spreads neighbours in rank evenly over the column, without a draw
    seeds, count = values.shape
    offsets = (np.arange(count) * _GOLDEN) % 1.0
    strip = min(60.0 * seeds, 0.44 * slot) / (seeds - _STRIP_GAP)
    points = "".join(
        marker.format(
            x=f"{centre + 0.02 * slot + strip * (seed + (1 - _STRIP_GAP) * offset):.1f}",
            y=f"{y_at(value):.1f}",
        )
        for seed in range(seeds)
        for offset, value in zip(offsets, np.sort(values[seed]), strict=True)
    )
    text = f"median {middle:.1f} cm, quartiles {first:.1f} and {last:.1f} cm"
    return [
        f'<path class="whisker {look.style}" d="{whiskers}"/>',
        f'<rect class="box {look.style}" x="{left:.1f}" y="{y_at(last):.1f}" width="{box:.1f}"'
        f' height="{max(1.0, y_at(first) - y_at(last)):.1f}"><title>{text}</title></rect>',
        f'<path class="middle {look.style}" d="M{left:.1f} {y_at(middle):.1f}h{box:.1f}"/>',
        f'<path class="point {look.style}" d="{points}"/>',
    ]
