"""Windows of a store drawn on a time line: figures, words, gesture phases, sound."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.motion.motion import Motion
from cospeech.motion.phases import PHASE_INDEX, PHASES
from cospeech.motion.upper_body import EVALUATION_FPS
from cospeech.reporting.charts import (
    chart_style,
    colour,
    inline_svg,
    phase_colours,
    pixel_axes,
    titled,
)
from cospeech.reporting.corpus_report.figures import (
    ARMS,
    FIGURES,
    WINDOW_WIDTH,
    clip,
    draw_figures,
    views,
)
from cospeech.reporting.corpus_report.statistics import WINDOW_FRAMES, window_starts
from cospeech.reporting.figure import PART_COLOURS, figure_of
from cospeech.reporting.joint_names import wrists
from cospeech.reporting.markup import one_line
from cospeech.speech.speech import SAMPLE_RATE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LEFT, _GAP = 46, 8
_ALONG = WINDOW_WIDTH - _LEFT - _GAP
_WORDS, _PHASES, _SOUND, _TICKS = 22, 16, 44, 20
_FLOOR = 16
_COLUMN_PX = 2.0
_MOST_ROW = 260


def choose_windows(store: Store, count: int, seed: int) -> list[tuple[str, Span]]:
    """Split and span of windows drawn at random, every window of the corpus equally likely.

    Spans too short for a window count as one each, so that a corpus of fragments shows something.

    Args:
        store: The corpus.
        count: How many, at most.
        seed: Seed of the draw.
    """
    spans = [(name, span) for name, spans in store.splits.items() for span in spans]
    grid = store.window_grid
    frames = WINDOW_FRAMES if grid is None else int(grid["frames"])
    numbers = np.array([len(window_starts(store, span)) for _, span in spans], dtype=np.int64)
    if not numbers.sum():
        numbers = np.array([int(span.stop > span.start) for _, span in spans], dtype=np.int64)
    ends = np.cumsum(numbers)
    total = int(ends[-1]) if len(ends) else 0
    rng = np.random.default_rng(seed)
    chosen = []
    for place in np.sort(rng.choice(total, size=min(count, total), replace=False)):
        which = int(np.searchsorted(ends, place, side="right"))
        name, span = spans[which]
        starts = window_starts(store, span)
        if len(starts):
            start = int(starts[place - (ends[which] - numbers[which])])
            span = Span(span.recording, start, start + frames)
        chosen.append((name, span))
    return chosen


@chart_style()
def draw_window(store: Store, span: Span, scale: float) -> str:
    """A window as one SVG: eight figures from the front and the side over a time line.

    A figure stands at its moment; its wrists trail the way since the figure before it.

    Args:
        store: The corpus.
        span: The window.
        scale: From `figure_scale`, the same for every window of a skeleton, so that sizes compare.
    """
    motion = clip(store, span)
    lanes: list[tuple[str, float, Callable[[Axes, float], None]]] = []
    for name, flat in views(motion, legs=False).items():
        height = min(scale * float(np.percentile(flat[..., 1], 99.5)) + 24, _MOST_ROW)
        lanes.append((name, height, partial(_draw_figures, motion, flat, scale, height)))
    lanes.append(("words", _WORDS, partial(_draw_words, store, span)))
    if store.recordings[span.recording].has_phases:
        lanes.append(("phase", _PHASES, partial(_draw_phases, store, span)))
    lanes.append(("sound", _SOUND, partial(_draw_sound, store, span)))
    y = _TICKS + sum(height + _GAP for _, height, _ in lanes)
    figure, axes = pixel_axes(WINDOW_WIDTH, y + _GAP)
    for name, height, draw in lanes:
        y -= height
        _say(axes, name, y + height / 2, x=0)
        draw(axes, y)
        y -= _GAP
    _say(axes, "s", _TICKS / 2, x=0)
    first, last = _seconds(span)
    for half_seconds in range(math.ceil(first * 2 - 1e-6), math.floor(last * 2 + 1e-6) + 1):
        x = float(_x_at(span, half_seconds / 2))
        _say(axes, f"{half_seconds / 2:g}", _TICKS / 2, x, ha="center")
    return inline_svg(figure, "window")


def _seconds(span: Span) -> tuple[float, float]:
    return span.start / EVALUATION_FPS, span.stop / EVALUATION_FPS


def _x_at(span: Span, times: ArrayLike) -> NDArray[np.float64]:
    first, last = _seconds(span)
    return _LEFT + (np.asarray(times) - first) / (last - first) * _ALONG


def _say(axes: Axes, text: str, y: float, x: float = _LEFT, **style: Any) -> None:
    axes.text(x, y, text, **{"va": "center", "color": colour("muted"), **style})


def _draw_figures(
    motion: Motion, flat: NDArray[np.float64], scale: float, height: float, axes: Axes, y: float
) -> None:
    figure = figure_of(motion)
    points = figure.points(flat) * scale + np.array([0, y + _FLOOR])
    moments = (np.arange(FIGURES) + 0.5) / FIGURES
    frames = np.minimum((moments * len(motion)).astype(np.int64), len(motion) - 1)
    places = np.stack([_LEFT + moments * _ALONG, np.zeros(FIGURES)], axis=-1)
    # what leaps out of the lane must not be drawn over the others
    corners = (0, y), (WINDOW_WIDTH, y + height)
    for side, joint in wrists(motion.skeleton).items():
        for place, frame, before in zip(places, frames, [0, *frames[:-1]], strict=True):
            way = (points[before : frame + 1, joint] + place).clip(*corners)
            ink = PART_COLOURS[f"{side}_arm"]
            axes.plot(*way.T, color=ink, linewidth=1.3, alpha=0.6, zorder=1)
    placed = (points[frames] + places[:, None]).clip(*corners)
    draw_figures(axes, figure, placed, scale, ("body", *ARMS))


def _draw_block(
    axes: Axes, corner: tuple[float, float], size: tuple[float, float], title: str, **style: Any
) -> None:
    from matplotlib.patches import Rectangle

    block = Rectangle(corner, *size, **style)
    titled(block, title)
    axes.add_artist(block)


def _draw_words(store: Store, span: Span, axes: Axes, y: float) -> None:
    middle = y + _WORDS / 2
    if not store.recordings[span.recording].has_words:
        _say(axes, "no transcript", middle)
        return
    first, last = _seconds(span)
    words = store.words(span.recording)
    inside = words[(words[:, 0] < last) & (words[:, 1] > first)]
    if not len(inside):
        _say(axes, "no word", middle)
    colours = {"facecolor": colour("word"), "edgecolor": colour("line")}
    for begin, end, word in inside:
        left, right = _x_at(span, np.clip([begin, end], first, last))
        text = one_line(store.vocabulary[int(word)])
        title = f"{text}: {begin:.2f} to {end:.2f} s"
        _draw_block(axes, (left, y), (max(right - left, 1), _WORDS), title, **colours)
        size = min(13.0, max((right - left - 4) / (0.6 * len(text)), 7.0))
        fitting = int((right - left - 2) / (0.6 * size))
        shown = text if len(text) <= fitting else text[: max(fitting - 1, 0)] + "…"
        style = {"ha": "center", "color": colour("text"), "fontsize": size}
        _say(axes, shown, middle, (left + right) / 2, **style)


def _draw_phases(store: Store, span: Span, axes: Axes, y: float) -> None:
    phases = store.phases(span.recording)
    assert phases is not None
    ratio = store.recordings[span.recording].fps / EVALUATION_FPS
    first, stop = round(span.start * ratio), round(span.stop * ratio)
    labels = phases[first:stop]
    starts = np.flatnonzero(np.diff(labels, prepend=-1))
    edges = _LEFT + np.append(starts, len(labels)) / max(1, stop - first) * _ALONG
    middle = y + _PHASES / 2
    if (labels == PHASE_INDEX["none"]).all():
        _say(axes, "none", middle)
    for start, (left, right) in zip(starts, itertools.pairwise(edges), strict=True):
        phase = PHASES[int(labels[start])]
        name, (fill, ink) = phase.replace("_", " "), phase_colours(phase)
        if phase != "none":
            _draw_block(axes, (left, y), (right - left, _PHASES), name, facecolor=fill)
            if right - left > 6.2 * len(name):
                _say(axes, name, middle, (left + right) / 2, ha="center", color=ink, fontsize=10.5)


def _draw_sound(store: Store, span: Span, axes: Axes, y: float) -> None:
    middle = y + _SOUND / 2
    if not store.recordings[span.recording].has_audio:
        _say(axes, "no audio", middle)
        return
    start, stop = _seconds(span)
    first, count = round(start * SAMPLE_RATE), round((stop - start) * SAMPLE_RATE)
    samples = store.read(span.recording, "audio", first, first + count)[:, 0].astype(np.float64)
    columns = int(_ALONG / _COLUMN_PX)
    edges = np.minimum(np.arange(columns + 1) * count // columns, len(samples))
    filled = edges[:-1][np.diff(edges) > 0]
    if not len(filled):
        _say(axes, "no audio here", middle)
        return
    tops = np.maximum.reduceat(samples, filled) / 32767
    bottoms = np.minimum.reduceat(samples, filled) / 32767
    # drawn at least this loud, so that quiet speech is seen and noise is not taken for speech
    half = _SOUND / 2 / max(0.1, float(tops.max()), float(-bottoms.min()))
    xs = _LEFT + (np.arange(len(filled)) + 0.5) * _COLUMN_PX
    axes.plot((_LEFT, _LEFT + _ALONG), (middle, middle), color=colour("line"), linewidth=1)
    axes.fill_between(
        xs, middle + half * bottoms, middle + half * tops, color=colour("bar"), linewidth=0
    )
