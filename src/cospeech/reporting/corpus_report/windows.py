"""Windows of a store drawn on a time line: figures, words, gesture phases, sound."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.motion.motion import Motion
from cospeech.motion.phases import PHASES
from cospeech.motion.upper_body import EVALUATION_FPS
from cospeech.reporting.corpus_report.figures import (
    ARMS,
    FIGURES,
    WINDOW_WIDTH,
    clip,
    draw_figure,
    views,
)
from cospeech.reporting.corpus_report.statistics import WINDOW_FRAMES, window_starts
from cospeech.reporting.figure import figure_of
from cospeech.reporting.joint_names import wrists
from cospeech.reporting.markup import escaped
from cospeech.speech.speech import SAMPLE_RATE

_WIDTH, _LEFT, _RIGHT = WINDOW_WIDTH, 46, 8
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


def draw_window(store: Store, span: Span, scale: float) -> str:
    """A window as one SVG: eight figures from the front and the side over a time line.

    A figure stands at its moment; its wrists trail the way since the figure before it.

    Args:
        store: The corpus.
        span: The window.
        scale: From `figure_scale`, the same for every window of a skeleton, so that sizes compare.
    """
    motion = clip(store, span)
    seconds = (span.stop - span.start) / EVALUATION_FPS
    parts: list[str] = []
    y = 8.0
    for name, flat in views(motion, legs=False).items():
        height = min(scale * float(np.percentile(flat[..., 1], 99.5)) + 24, _MOST_ROW)
        figures = "".join(_figures(motion, flat, scale, height - 16))
        parts += [
            _lane_name(name, y + height / 2),
            f'<svg y="{y:.1f}" width="{_WIDTH}" height="{height:.1f}">{figures}</svg>',
        ]
        y += height + 10
    for name, height, draw in (
        ("words", 22, _words),
        ("phase", 16, _phases),
        ("sound", 44, _sound),
    ):
        drawn = draw(store, span, y, height)
        if drawn:
            parts += [_lane_name(name, y + height / 2 + 4), *drawn]
            y += height + 5
    start = span.start / EVALUATION_FPS
    for tick in np.arange(np.ceil(start * 2 - 1e-6), (start + seconds) * 2 + 1e-6) / 2:
        tick = abs(tick)  # minus zero
        x = _x_at(tick - start, seconds)
        parts.append(
            f'<path class="axis" d="M{x:.1f} {y:.1f}v4"/><text x="{x:.1f}" y="{y + 15:.1f}"'
            f' text-anchor="middle">{tick:g}</text>'
        )
    parts.append(_lane_name("s", y + 15))
    return (
        f'<svg viewBox="0 0 {_WIDTH} {y + 20:.0f}" role="img" class="window">{"".join(parts)}</svg>'
    )


def _figures(motion: Motion, flat: NDArray[np.float64], scale: float, floor: float) -> list[str]:
    figure = figure_of(motion)
    points = figure.points(flat) * np.array([scale, -scale])
    moments = (np.arange(FIGURES) + 0.5) / FIGURES
    frames = np.minimum((moments * len(motion)).astype(np.int64), len(motion) - 1)
    hands = wrists(motion.skeleton)
    parts = []
    for moment, frame, before in zip(moments, frames, [0, *frames[:-1]], strict=True):
        place = np.array([_x_at(moment, 1.0), floor])
        for side, joint in hands.items():
            way = points[before : frame + 1, joint] + place
            line = "L".join(f"{x:.1f} {y:.1f}" for x, y in way)
            parts.append(f'<path class="trail {side}" d="M{line}"/>')
        parts += draw_figure(figure, points[frame] + place, scale, ("body", *ARMS))
    return parts


def _x_at(time: float, seconds: float) -> float:
    return _LEFT + time / seconds * (_WIDTH - _LEFT - _RIGHT)


def _lane_name(name: str, y: float) -> str:
    return f'<text class="lane" x="0" y="{y:.0f}">{name}</text>'


def _words(store: Store, span: Span, y: float, height: float) -> list[str]:
    if not store.recordings[span.recording].has_words:
        return [f'<text x="{_LEFT}" y="{y + 15:.0f}">no transcript</text>']
    start, seconds = span.start / EVALUATION_FPS, (span.stop - span.start) / EVALUATION_FPS
    words = store.words(span.recording)
    inside = words[(words[:, 0] < start + seconds) & (words[:, 1] > start)]
    if not len(inside):
        return [f'<text x="{_LEFT}" y="{y + 15:.0f}">no word</text>']
    parts = []
    for begin, end, word in inside:
        left = _x_at(max(begin - start, 0.0), seconds)
        right = _x_at(min(end - start, seconds), seconds)
        text = store.vocabulary[int(word)]
        size = min(13.0, max((right - left - 4) / (0.6 * len(text)), 7.0))
        fitting = int((right - left - 2) / (0.6 * size))
        shown = text if len(text) <= fitting else text[: max(fitting - 1, 0)] + "…"
        parts.append(
            f"<g><title>{escaped(text)}: {begin:.2f} to {end:.2f} s</title>"
            f'<rect class="word" x="{left:.1f}" y="{y:.1f}" width="{max(right - left, 1):.1f}"'
            f' height="{height}" rx="3"/><text class="said" x="{(left + right) / 2:.1f}"'
            f' y="{y + height / 2 + 4.5:.1f}" font-size="{size:.1f}" text-anchor="middle">'
            f"{escaped(shown)}</text></g>"
        )
    return parts


def _phases(store: Store, span: Span, y: float, height: float) -> list[str]:
    phases = store.phases(span.recording)
    if phases is None:
        return []
    motion_fps = store.recordings[span.recording].fps
    ratio = motion_fps / EVALUATION_FPS
    first, stop = round(span.start * ratio), round(span.stop * ratio)
    labels = phases[first:stop]
    seconds = (span.stop - span.start) / EVALUATION_FPS
    edges = [0, *(np.flatnonzero(np.diff(labels)) + 1), len(labels)]
    parts = []
    for begin, end in itertools.pairwise(edges):
        name = PHASES[int(labels[begin])] if begin < len(labels) else "none"
        if name == "none":
            continue
        left, right = (_x_at(min(f / motion_fps, seconds), seconds) for f in (begin, end))
        shown = name.replace("_", " ")
        label = (
            f'<text x="{(left + right) / 2:.1f}" y="{y + height / 2 + 3.5:.1f}"'
            f' text-anchor="middle" class="said" font-size="10.5">{shown}</text>'
            if right - left > 6.2 * len(shown)
            else ""
        )
        parts.append(
            f'<g><title>{shown}</title><rect class="phase {name}" x="{left:.1f}" y="{y:.1f}"'
            f' width="{right - left:.1f}" height="{height}" rx="3"/>{label}</g>'
        )
    return parts or [f'<text x="{_LEFT}" y="{y + 12:.0f}">none</text>']


def _sound(store: Store, span: Span, y: float, height: float) -> list[str]:
    if not store.recordings[span.recording].has_audio:
        return [f'<text x="{_LEFT}" y="{y + height / 2 + 4:.0f}">no audio</text>']
    start, seconds = span.start / EVALUATION_FPS, (span.stop - span.start) / EVALUATION_FPS
    first, count = round(start * SAMPLE_RATE), round(seconds * SAMPLE_RATE)
    samples = store.read(span.recording, "audio", first, first + count)[:, 0].astype(np.float64)
    columns = int((_WIDTH - _LEFT - _RIGHT) / _COLUMN_PX)
    edges = np.minimum(np.arange(columns + 1) * count // columns, len(samples))
    filled = edges[:-1][np.diff(edges) > 0]
    if not len(filled):
        return [f'<text x="{_LEFT}" y="{y + height / 2 + 4:.0f}">no audio here</text>']
    tops = np.maximum.reduceat(samples, filled) / 32767
    bottoms = np.minimum.reduceat(samples, filled) / 32767
    xs = _LEFT + (np.arange(len(filled)) + 0.5) * _COLUMN_PX
    # drawn at least this loud, so that quiet speech is seen and noise is not taken for speech
    loudest = max(0.1, float(tops.max()), float(-bottoms.min()))
    middle, half = y + height / 2, height / 2 / loudest
    upper = [f"{x:.0f} {middle - half * top:.1f}" for x, top in zip(xs, tops, strict=True)]
    lower = [f"{x:.0f} {middle - half * low:.1f}" for x, low in zip(xs, bottoms, strict=True)]
    return [
        f'<path class="axis" d="M{_LEFT} {middle:.1f}H{_WIDTH - _RIGHT}"/>'
        f'<path class="wave" d="M{"L".join([*upper, *reversed(lower)])}Z"/>'
    ]
