"""Histograms and other small pictures of the corpus report, as inline SVG."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.motion.upper_body import UPPER_BODY
from cospeech.reporting.chart import ticks
from cospeech.reporting.corpus_report.totals import HandSpace
from cospeech.reporting.figure import PART_COLOURS
from cospeech.reporting.markup import escaped

_WIDTH, _HEIGHT = 360, 178
_LEFT, _RIGHT, _TOP, _BOTTOM = 14, 14, 16, 40
_BARS = 30
_APART = 18
_BINS = (1, 2, 5)


@dataclass(frozen=True)
class Series:
    """One distribution of a histogram.

    Attributes:
        name: Shown when the pointer rests on a bar.
        style: CSS class of the bars.
        counts: ``(len(edges) + 1,)``; first and last are what lies outside the edges.
    """

    name: str
    style: str
    counts: NDArray[np.int64] | NDArray[np.float64]


def round_edges(low: float, high: float, bars: int = _BARS) -> NDArray[np.float64]:
    """Edges of about ``bars`` bins of round width from ``low`` to ``high``."""
    span = high - low
    if not span > 0:
        span = abs(high) or 1.0
        low, high = (low - span / 2, high + span / 2) if high else (0.0, 1.0)
    rough = span / bars
    power = 10.0 ** np.floor(np.log10(rough))
    width = next(m * power for m in (*_BINS, 10) if m * power >= rough * 0.999)
    first, last = np.floor(low / width + 1e-9), np.ceil(high / width - 1e-9)
    edges = np.arange(first, max(last, first + 1) + 1) * width
    # rounding must not leave the outermost numbers outside
    edges[0], edges[-1] = min(edges[0], low), max(edges[-1], high)
    return edges


def counts_in(values: NDArray[np.float64], edges: NDArray[np.float64]) -> NDArray[np.int64]:
    """``(len(edges) + 1,)`` counts of finite values; the last edge belongs to the last bin."""
    values = values[np.isfinite(values)]
    bins = np.searchsorted(edges, values, side="right")
    bins[values == edges[-1]] = len(edges) - 1
    return np.bincount(bins, minlength=len(edges) + 1)


def histogram(
    series: Sequence[Series],
    edges: NDArray[np.float64],
    unit: str,
    noun: str,
    median: float | None = None,
    marks: Sequence[tuple[float, str]] = (),
    logarithmic: bool = False,
) -> str:
    """An SVG histogram.

    What lies outside the edges is one bar at either end, marked ``<`` or ``>``.

    Args:
        series: One, or two that are drawn over one another.
        edges: Ascending, evenly spaced, or by an even factor on a logarithmic axis.
        unit: Under the axis.
        noun: What is counted, in a plural that ends in s.
        median: Drawn as a line.
        marks: Value and text of each number that stands apart, drawn as a triangle.
        logarithmic: Equal factors take equal room.
    """
    outside = [any(s.counts[0] > 0 for s in series), any(s.counts[-1] > 0 for s in series)]
    places = np.log10(edges) if logarithmic else edges
    bars = len(edges) - 1
    slot = (_WIDTH - _LEFT - _RIGHT) / (bars + 1.6 * sum(outside))
    origin = _LEFT + 1.6 * slot * outside[0]
    floor, room = _HEIGHT - _BOTTOM, _HEIGHT - _BOTTOM - _TOP
    tallest = max(float(s.counts.max()) for s in series) or 1.0
    starts = [_LEFT, *(origin + i * slot for i in range(bars)), _WIDTH - _RIGHT - slot]
    ranges = [f"{low:g} to {high:g}" for low, high in itertools.pairwise(edges)]
    texts = [f"under {edges[0]:g}", *ranges, f"over {edges[-1]:g}"]

    def x_at(value: float) -> float:
        place = math.log10(max(value, 1e-30)) if logarithmic else value
        x = origin + (place - places[0]) / (places[-1] - places[0]) * bars * slot
        return float(np.clip(x, _LEFT + 0.5 * slot, _WIDTH - _RIGHT - 0.5 * slot))

    parts = [f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" class="histogram">']
    for s in series:
        tops = floor - room * s.counts / tallest
        for x, text, top, count in zip(starts, texts, tops, s.counts, strict=True):
            if count > 0:
                parts.append(
                    f'<rect class="{s.style}" x="{x + 0.4:.1f}" y="{min(top, floor - 0.7):.1f}"'
                    f' width="{max(slot - 0.8, 0.6):.1f}" height="{max(floor - top, 0.7):.1f}">'
                    f"<title>{escaped(f'{s.name}{text} {unit}: {round(count):,} {noun}')}"
                    "</title></rect>"
                )
        if len(series) > 1:
            steps = "".join(f"V{top:.1f}h{slot:.1f}" for top in tops[1:-1])
            parts.append(f'<path class="outline {s.style}" d="M{origin:.1f} {floor}{steps}"/>')
    parts.append(
        f'<path class="axis" d="M{_LEFT} {floor}H{_WIDTH - _RIGHT}"/>'
        f'<text x="{_WIDTH / 2}" y="{_HEIGHT - 4}" text-anchor="middle">{escaped(unit)}</text>'
        f'<text x="{_WIDTH - _RIGHT}" y="{_TOP - 5}" text-anchor="end">tallest bar:'
        f" {round(tallest):,} {escaped(noun if round(tallest) != 1 else noun[:-1])}</text>"
    )
    if logarithmic:
        powers = range(math.ceil(places[0] - 1e-6), math.floor(places[-1] + 1e-6) + 1)
        labels = [(x_at(10.0**power), f"{10.0**power:g}") for power in powers]
    else:
        labels = [(x_at(t), f"{t:g}") for t in ticks(float(edges[0]), float(edges[-1]), 5)]
    ends = [(_LEFT + 0.5 * slot, "&lt;")] * outside[0]
    ends += [(_WIDTH - _RIGHT - 0.5 * slot, "&gt;")] * outside[1]
    labels = [t for t in labels if all(abs(t[0] - x) > _APART for x, _ in ends)] + ends
    parts += [
        f'<text x="{x:.1f}" y="{floor + 19}" text-anchor="middle">{text}</text>'
        for x, text in labels
    ]
    if median is not None:
        parts.append(f'<path class="median" d="M{x_at(median):.1f} {_TOP - 2}V{floor}"/>')
    parts += [
        f'<path class="mark" d="M{x_at(value):.1f} {floor + 1}l-4 7h8z"><title>'
        f"{escaped(text)}</title></path>"
        for value, text in marks
    ]
    return "".join(parts) + "</svg>"


def range_bar(middle: float, end: float, most: float, style: str) -> str:
    """An SVG bar from 0 to ``end`` on a scale to ``most``, with a dot at ``middle``."""
    scale = 190 / most if most > 0 else 0.0
    return (
        '<svg viewBox="0 0 200 12" class="range">'
        f'<rect class="{style}" x="4" y="4" width="{end * scale:.1f}" height="4" rx="2"/>'
        f'<circle class="{style}" cx="{4 + middle * scale:.1f}" cy="6" r="3.5"/></svg>'
    )


def share_bars(shares: Sequence[tuple[str, float, str]]) -> str:
    """Horizontal SVG bars, one per (name, share 0..1, text at the right)."""
    row, left, right = 22, 150, 120
    most = max((share for _, share, _ in shares), default=0.0) or 1.0
    room = 620 - left - right
    parts = [f'<svg viewBox="0 0 620 {row * len(shares) + 4}" role="img" class="shares">']
    for i, (name, share, text) in enumerate(shares):
        y = row * i + 3
        length = room * share / most
        parts.append(
            f'<text x="{left - 8}" y="{y + 13}" text-anchor="end">{escaped(name)}</text>'
            f'<rect class="bar" x="{left}" y="{y + 3}" width="{max(length, 0.5):.1f}" height="13"'
            f' rx="2"/><text x="{left + length + 7:.1f}" y="{y + 13}">{escaped(text)}</text>'
        )
    return "".join(parts) + "</svg>"


def hand_space(hands: HandSpace) -> str:
    """Where the wrists are, seen from the front, around the mean pose; the grid is 25 cm."""
    counts = hands.counts
    used = np.argwhere(counts.sum(axis=0) > 0)
    if not hands.frames or not len(used):
        return ""
    pose = hands.pose_sum / (hands.pose_frames or 1)
    corners = np.concatenate(
        [used * hands.cell + hands.origin, (used + 1) * hands.cell + hands.origin, pose[:, :2]]
    )
    (left, low), (right, high) = corners.min(axis=0) - 0.06, corners.max(axis=0) + 0.06
    scale = 300.0
    width, height = (right - left) * scale, (high - low) * scale

    def at(x: float, y: float) -> str:
        return f"{(x - left) * scale:.1f} {(high - y) * scale:.1f}"

    parts = [
        f'<svg viewBox="0 0 {width:.0f} {height:.0f}" role="img" class="hands"'
        f' style="width:{width:.0f}px">'
    ]
    for x in np.arange(np.ceil(left / 0.25), right / 0.25) * 0.25:
        parts.append(f'<path class="grid" d="M{at(x, low)}L{at(x, high)}"/>')
    for y in np.arange(np.ceil(low / 0.25), high / 0.25) * 0.25:
        parts.append(f'<path class="grid" d="M{at(left, y)}L{at(right, y)}"/>')
    side_px = hands.cell * scale
    for side, style in enumerate(("left", "right")):
        # the square root shows the rare cells beside the resting place
        strengths = (
            np.sqrt(counts[side] / counts[side].max()) if counts[side].any() else counts[side]
        )
        for level in range(1, 11):
            cells = np.argwhere(np.ceil(strengths * 10) == level)
            squares = "".join(
                f"M{at(x * hands.cell + hands.origin[0], (y + 1) * hands.cell + hands.origin[1])}"
                f"h{side_px:.1f}v{side_px:.1f}h-{side_px:.1f}z"
                for x, y in cells
            )
            if squares:
                parts.append(f'<path class="{style}" opacity="{0.08 * level:.2f}" d="{squares}"/>')
    bones = "".join(
        f"M{at(*pose[parent, :2])}L{at(*pose[child, :2])}" for parent, child in UPPER_BODY.bones
    )
    parts.append(f'<path class="pose" d="{bones}"/>')
    for joint, side_name in (("left_wrist", "left_arm"), ("right_wrist", "right_arm")):
        place = at(*pose[UPPER_BODY.index[joint], :2]).split()
        parts.append(
            f'<circle cx="{place[0]}" cy="{place[1]}" r="5" fill="{PART_COLOURS[side_name]}"'
            ' class="joint"/>'
        )
    return "".join(parts) + "</svg>"
