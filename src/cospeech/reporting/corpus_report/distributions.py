"""Distributions over recordings, words, frames and blocks of sound, as pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.motion.phases import PHASES
from cospeech.reporting.charts import colour
from cospeech.reporting.corpus_report.charts import (
    Series,
    counts_in,
    hand_space,
    histogram,
    length_bar,
    round_edges,
)
from cospeech.reporting.corpus_report.figures import draw_pose
from cospeech.reporting.corpus_report.statistics import MOST_BLOCKS
from cospeech.reporting.corpus_report.streaming import StreamingHistogram
from cospeech.reporting.corpus_report.totals import CorpusStatistics
from cospeech.reporting.corpus_report.unusual import Measure, fences, measures, short
from cospeech.reporting.figure import PART_COLOURS
from cospeech.reporting.markup import html_table

_MOST_POSES = 3


def histograms_section(store: Store, statistics: CorpusStatistics) -> str:
    """Distributions over recordings, words, frames and blocks of sound."""
    by_key = {measure.key: measure for measure in measures(store.dimensions)}
    panels = [
        _per_recording(store, statistics, by_key["seconds"], "Length of the recordings"),
        _per_recording(store, statistics, by_key["words_per_minute"], "Words per minute"),
        _word_durations(statistics.word_seconds),
        _wrist_speeds(store, statistics),
        _per_recording(store, statistics, by_key["still"], "Time with both wrists still"),
        _levels(statistics.levels),
    ]
    return (
        f'<div class="grid3">{"".join(panels)}</div>'
        '<p class="muted">The dashed line is the median; triangles are recordings that stand apart'
        " (rest the pointer on one for its id). Wrist speed is measured over"
        f" {'1/15 s' if store.has_upper_body else 'about 1/15 s'}"
        f"{', relative to the body' if store.has_upper_body else ''}, in every frame; a wrist below"
        " 1 cm/s is still. Sound levels are root mean squares of blocks of a tenth of a second, at"
        f" most {MOST_BLOCKS} per recording, evenly spaced; 0 dBFS is a full-scale square wave.</p>"
    )


def _panel(title: str, facts: str, picture: str) -> str:
    return f'<div class="panel"><h3>{title}<small>{facts}</small></h3>{picture}</div>'


def _absent(title: str, why: str) -> str:
    return _panel(title, why, "")


def _per_recording(store: Store, statistics: CorpusStatistics, measure: Measure, title: str) -> str:
    factor, unit = 1.0, measure.unit
    values = measure.shown(statistics.measures[measure.key])
    known = np.flatnonzero(np.isfinite(values))
    if not len(known):
        why = {
            "words_per_minute": "no recording has a transcript",
            "still": "not known: no wrists, or pixels that have no length",
        }
        return _absent(title, why.get(measure.key, "no recording has it"))
    if measure.key == "seconds" and np.median(values) > 90:
        factor, unit = 1 / 60, "min"
    values = values * factor
    usual = fences(measure, values / factor)
    low, high = float(values[known].min()), float(values[known].max())
    marks = []
    if usual is not None:
        least, most = (bound * factor for bound in usual.bounds)
        apart = known[(values[known] < least) | (values[known] > most)]
        marks = [
            (float(values[i]), f"{store.recordings[int(i)].id}: {short(values[i])} {unit}".strip())
            for i in apart[:200]
        ]
        low, high = max(low, least), min(high, most)
    if measure.key in ("seconds", "words_per_minute") and low < 0.4 * high:
        low = 0.0
    edges = round_edges(low, high)
    first, middle, last = np.percentile(values[known], [5, 50, 95])
    after = f" {unit}" if unit else ""
    facts = (
        f"median {short(middle)}{after}<br>5 to 95 %: {short(first)} to {short(last)}{after};"
        f" {len(known):,} recordings"
    )
    series = [Series("", colour("bar"), counts_in(values, edges))]
    return _panel(
        title, facts, histogram(series, edges, unit or title.lower(), "recordings", middle, marks)
    )


def _word_durations(durations: StreamingHistogram) -> str:
    title = "Length of the words"
    if not durations.total:
        return _absent(title, "no recording has a transcript with words")
    first, middle, last = (float(durations.quantile(q)[0]) for q in (0.05, 0.5, 0.95))
    edges = round_edges(0.0, max(float(durations.quantile(0.995)[0]), 0.2))
    series = [Series("", colour("bar"), durations.rebinned(edges)[0])]
    facts = (
        f"median {middle:.2f} s<br>5 to 95 %: {first:.2f} to {last:.2f} s;"
        f" {durations.total:,} words"
    )
    return _panel(title, facts, histogram(series, edges, "s", "words", middle))


def _wrist_speeds(store: Store, statistics: CorpusStatistics) -> str:
    title, speeds = "Wrist speed", statistics.wrists
    if not speeds.total:
        return _absent(title, "not known: the skeleton names no left and right wrist")
    unit, factor = ("cm/s", 100.0) if store.dimensions == 3 else ("px/s", 1.0)
    means, lasts = speeds.mean * factor, speeds.quantile(0.95) * factor
    # four decades: from a hand at rest, trembling, to the fastest stroke
    fastest = float(speeds.quantile(0.999).max()) * factor
    top = math.ceil(math.log10(fastest)) if fastest > 0 else 0
    edges = np.logspace(top - 4, top, 41)
    counts = speeds.rebinned(edges / factor)
    series = [
        Series(f"{side}: ", PART_COLOURS[f"{side}_arm"], own)
        for side, own in zip(("left", "right"), counts, strict=True)
    ]
    facts = "<br>".join(
        f'<i class="swatch {side}"></i>{side}: mean {short(mean)}, 95 % {short(last)} {unit}'
        for side, mean, last in zip(("left", "right"), means, lasts, strict=True)
    )
    return _panel(title, facts, histogram(series, edges, unit, "frames", logarithmic=True))


def _levels(levels: StreamingHistogram) -> str:
    title = "Sound level"
    if not levels.total:
        return _absent(title, "the corpus has no audio")
    first, middle, last = (float(levels.quantile(q)[0]) for q in (0.05, 0.5, 0.95))
    edges = np.arange(-96.0, 1.0, 3.0)
    series = [Series("", colour("bar"), levels.rebinned(edges)[0])]
    facts = f"median {middle:.0f} dBFS<br>5 to 95 %: {first:.0f} to {last:.0f} dBFS"
    return _panel(title, facts, histogram(series, edges, "dBFS", "blocks", middle))


def body_section(store: Store, statistics: CorpusStatistics, spans: Sequence[Span]) -> str:
    """A map of wrist positions around the mean pose, and one frame of each skeleton drawn.

    Args:
        store: The corpus.
        statistics: Its numbers.
        spans: Windows whose middle frames may be drawn.
    """
    pictures, notes = [], []
    if statistics.hands is not None:
        pictures.append(hand_space(statistics.hands))
        far = statistics.hands.frames - statistics.hands.pose_frames
        if far:
            notes.append(
                f'<span class="flag">{far:,} frames have a joint over 2 m from the spine</span>;'
                " they are not in the mean pose."
            )
        notes.append(
            "The map: both wrists seen from the front, spine at the origin, every frame, stronger"
            " where more often (square root), around the mean pose; the grid is 25 cm."
        )
    shown: dict[int, Span] = {}
    for span in spans:
        shown.setdefault(store.recordings[span.recording].skeleton, span)
    pictures += [draw_pose(store, span) for span in list(shown.values())[:_MOST_POSES]]
    notes.append(
        "The figures: the middle frame of the first window drawn above, every bone. The speaker's"
        " left is orange, and at the reader's right in front views."
    )
    return (
        f'<section><div class="bodies">{"".join(pictures)}</div></section>'
        f'<p class="muted">{" ".join(notes)}</p>'
    )


def phases_section(store: Store, statistics: CorpusStatistics) -> str:
    """Shares of the gesture phases in the annotated frames."""
    frames = statistics.phase_frames
    if not frames.sum():
        return "<section>No recording has gesture phases.</section>"
    shares = frames / frames.sum()
    rows = [
        (name.replace("_", " "), f"{100 * share:.1f} %", length_bar(share / shares.max()))
        for name, share in zip(PHASES, shares, strict=True)
        if share
    ]
    return (
        f"<section>{html_table([], rows, (1,), 'dense shares')}</section><p class='muted'>Share of"
        f" {int(frames.sum()):,} frames of {statistics.phase_recordings:,} annotated recordings (of"
        f" {len(store.recordings):,}).</p>"
    )
