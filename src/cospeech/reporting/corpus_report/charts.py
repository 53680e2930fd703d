"""Histograms, bars and the map of the hands of the corpus report."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.motion.upper_body import UPPER_BODY
from cospeech.reporting.charts import (
    chart_style,
    colour,
    draw_bones,
    draw_path,
    front_view,
    inline_svg,
    new_axes,
    titled,
)
from cospeech.reporting.corpus_report.totals import HandSpace
from cospeech.reporting.figure import PART_COLOURS

_BARS = 30
_BINS = (1, 2, 5)
_APART = 0.05
_OUTSIDE = 1.6
_ROUNDING = 1e-6
_PX_PER_M = 300.0
_ARMS = {"left": PART_COLOURS["left_arm"], "right": PART_COLOURS["right_arm"]}


@dataclass(frozen=True)
class Series:
    """One distribution of a histogram.

    Attributes:
        name: Shown when the pointer rests on a bar.
        colour: Of the bars, ``#rrggbb``.
        counts: ``(len(edges) + 1,)``; first and last are what lies outside the edges.
    """

    name: str
    colour: str
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


@chart_style()
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
    from matplotlib.ticker import MaxNLocator

    # the axis counts bins, so that what is outside has its place beside the first and the last
    bins = len(edges) - 1
    places = np.log10(edges) if logarithmic else edges
    starts = np.array([-_OUTSIDE, *range(bins), bins + _OUTSIDE - 1])
    outside = np.array([any(s.counts[end] > 0 for s in series) for end in (0, -1)])
    left, right = np.where(outside, [-_OUTSIDE, bins + _OUTSIDE], [0, bins])

    def place_of(values: NDArray[np.float64]) -> NDArray[np.float64]:
        levels = np.log10(np.maximum(values, 1e-30)) if logarithmic else values
        return (levels - places[0]) / (places[-1] - places[0]) * bins

    def bar_of(value: float) -> float:
        return float(np.clip(place_of(np.array(value)), left + 0.5, right - 0.5))

    figure, axes = new_axes(360, 178, left=14, right=14, top=16, bottom=40)
    tallest = max(float(s.counts.max()) for s in series) or 1.0
    ranges = [f"{low:g} to {high:g}" for low, high in itertools.pairwise(edges)]
    texts = [f"under {edges[0]:g}", *ranges, f"over {edges[-1]:g}"]
    for s in series:
        several = len(series) > 1
        held = np.flatnonzero(s.counts)
        # a single recording beside thousands is still seen
        heights = np.maximum(s.counts[held], 0.006 * tallest)
        bars = axes.bar(
            starts[held] + 0.03,
            heights,
            width=0.94,
            align="edge",
            color=s.colour,
            alpha=0.22 if several else None,
        )
        for bar, i in zip(bars, held, strict=True):
            titled(bar, f"{s.name}{texts[i]} {unit}: {round(s.counts[i]):,} {noun}")
        if several:
            axes.stairs(s.counts[1:-1], range(bins + 1), color=s.colour, linewidth=1.4)
    first, last = np.ceil(places[0] - _ROUNDING), np.floor(places[-1] + _ROUNDING)
    ticks: NDArray[np.float64] = (
        10.0 ** np.arange(first, last + 1)
        if logarithmic
        else np.asarray(MaxNLocator(5, steps=[1, 2, 5, 10]).tick_values(edges[0], edges[-1]))
    )
    spots = [start + 0.5 for start in starts[[0, -1]][outside]]
    labels = [sign for sign, has in zip("<>", outside, strict=True) if has]
    for tick, spot in zip(ticks, place_of(ticks), strict=True):
        inside = -_ROUNDING <= spot <= bins + _ROUNDING
        if inside and all(abs(spot - other) > _APART * bins for other in spots[: sum(outside)]):
            spots.append(spot)
            labels.append(f"{tick:g}")
    axes.set_xticks(spots, labels)
    axes.set_yticks([])
    axes.set(xlim=(left, right), ylim=(0, 1.02 * tallest))
    axes.set_xlabel(unit)
    counted = noun if round(tallest) != 1 else noun[:-1]
    text = f"tallest bar: {round(tallest):,} {counted}"
    axes.set_title(text, loc="right", fontsize=11.5, color=colour("muted"), pad=3)
    if median is not None:
        line = axes.axvline(bar_of(median), ls=(0, (3, 3)), lw=1)
        line.set(color=colour("text"), alpha=0.75)
    for value, text in marks:
        (mark,) = axes.plot(bar_of(value), -0.03 * tallest, "^", c=colour("accent"), ms=7)
        titled(mark, text)
    return inline_svg(figure, "histogram")


def flagged(text: str, flag: bool) -> str:
    """Text of a cell, coloured where it stands out."""
    return f'<span class="flag">{text}</span>' if flag else text


def length_bar(share: float) -> str:
    """A bar of HTML as long as a share, 0 to 1, of its place."""
    return f'<i class="length" style="width: {100 * share:.1f}%"></i>'


def range_bar(middle: float, end: float, most: float, style: str) -> str:
    """A bar of HTML from 0 to ``end`` on a scale to ``most``, with a dot at ``middle``."""
    scale = 100 / most if most > 0 else 0.0
    return (
        f'<span class="range"><i class="{style}" style="width: {end * scale:.1f}%"></i>'
        f'<b class="{style}" style="left: {middle * scale:.1f}%"></b></span>'
    )


@chart_style()
def hand_space(hands: HandSpace) -> str:
    """Where the wrists are, seen from the front, around the mean pose; the grid is 25 cm."""
    counts = hands.counts
    used = np.argwhere(counts.sum(axis=0) > 0)
    if not hands.frames or not len(used):
        return ""
    pose = hands.pose_sum[:, :2] / (hands.pose_frames or 1)
    corners = np.concatenate(
        [used * hands.cell + hands.origin, (used + 1) * hands.cell + hands.origin, pose]
    )
    figure, axes = front_view(corners.min(axis=0) - 0.06, corners.max(axis=0) + 0.06, _PX_PER_M)
    square = hands.cell * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    for own, ink in zip(counts, _ARMS.values(), strict=True):
        # the square root shows the rare cells beside the resting place
        levels = np.ceil(10 * np.sqrt(own / (own.max() or 1)))
        for level in range(1, 11):
            cells = np.argwhere(levels == level) * hands.cell + hands.origin
            draw_path(axes, cells[:, None] + square, facecolor=ink, alpha=0.08 * level, linewidth=0)
    draw_bones(axes, pose, UPPER_BODY.bones, color=colour("text"), linewidth=3)
    for side, ink in _ARMS.items():
        place = pose[UPPER_BODY.index[f"{side}_wrist"]]
        axes.plot(*place, "o", color=ink, markersize=10, markeredgecolor=colour("text"), mew=1.5)
    width_px = 72 * figure.get_figwidth()
    return f'<div style="width: {width_px:.0f}px">{inline_svg(figure, "hands")}</div>'
