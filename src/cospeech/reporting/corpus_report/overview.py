"""Totals of the corpus report: what there is, split by split, and what was dropped."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from cospeech.corpus.store import Store
from cospeech.motion.upper_body import EVALUATION_FPS
from cospeech.reporting.corpus_report.charts import flagged, length_bar
from cospeech.reporting.corpus_report.statistics import WINDOW_FRAMES, WINDOW_STRIDE
from cospeech.reporting.corpus_report.totals import CorpusStatistics, SplitTotals
from cospeech.reporting.markup import escaped, html_table
from cospeech.reporting.tables import MISSING

_MOST_REASONS = 200


def tiles(store: Store, statistics: CorpusStatistics) -> str:
    """The corpus in seven numbers."""
    total = statistics.total
    hours = f"{total.hours:.1f} h" if total.hours >= 2 else f"{total.hours * 60:.1f} min"
    pace = total.words_per_minute
    known = int((statistics.word_counts > 0).sum())
    numbers = [
        (hours, "of motion"),
        (f"{total.recordings:,}", "recordings"),
        (f"{total.speakers:,}", "speakers"),
        (
            f"{total.words:,}" if np.isfinite(pace) else MISSING,
            f"words ({known:,} types)" if np.isfinite(pace) else "no transcript",
        ),
        (f"{pace:.0f}" if np.isfinite(pace) else MISSING, "words/min"),
        (f"{total.windows:,}", "windows"),
        (f"{len(store.manifest.get('skipped', [])):,}", "left out"),
    ]
    return (
        '<div class="tiles">'
        + "".join(f"<div><b>{value}</b><span>{label}</span></div>" for value, label in numbers)
        + "</div>"
    )


def splits_section(store: Store, statistics: CorpusStatistics) -> str:
    """A row per split, and who is in two of them."""
    hours = statistics.total.hours >= 2
    heads = ["split", "recordings", "speakers", "hours" if hours else "minutes"]
    heads += ["words", "words/min", "windows"]
    rows = [_split_cells(split, hours) for split in (*statistics.splits, statistics.total)]
    grid = store.window_grid
    windows = (
        f"Windows: {WINDOW_FRAMES} frames at {EVALUATION_FPS:g} frames/s, one every"
        f" {WINDOW_STRIDE} frames."
        if grid is None
        else f"Windows: as published, {grid['frames']:g} frames at {grid['fps']:g} frames/s,"
        f" candidates every {grid['stride']:g} frames."
    )
    speakers = _speakers_by_split(store)
    shared = {
        f"{a} and {b}": len(speakers[a] & speakers[b])
        for a, b in itertools.combinations(speakers, 2)
        if speakers[a] & speakers[b]
    }
    overlap = (
        "Speakers in both "
        + "; ".join(f"{escaped(pair)}: {count:,}" for pair, count in shared.items())
        + "."
        if shared
        else "No speaker is in two splits."
    )
    table = html_table(heads, rows, range(1, len(heads)), "total")
    return f'<section>{table}</section><p class="muted">{windows} {overlap}</p>'


def _split_cells(split: SplitTotals, hours: bool) -> list[str]:
    pace = split.words_per_minute
    spoken = np.isfinite(pace)
    return [
        escaped(split.name),
        f"{split.recordings:,}",
        f"{split.speakers:,}",
        f"{split.hours:.2f}" if hours else f"{split.hours * 60:.1f}",
        f"{split.words:,}" if spoken else MISSING,
        f"{pace:.0f}" if spoken else MISSING,
        f"{split.windows:,}",
    ]


def _speakers_by_split(store: Store) -> dict[str, set[str]]:
    names = [recording.speaker for recording in store.recordings]
    return {
        split: {names[span.recording] for span in spans} for split, spans in store.splits.items()
    }


def dropped_section(store: Store, total: SplitTotals) -> str:
    """Recordings and windows kept and left out, by reason."""
    skipped: list[dict[str, Any]] = store.manifest["skipped"]
    windows: dict[str, int] = store.manifest["dropped_windows"]
    parts = []
    kinds = Counter((one["is_fault"], one["kind"]) for one in skipped)
    lines = [("kept", total.recordings, False)]
    for (fault, kind), count in sorted(kinds.items(), key=lambda item: (item[0][0], -item[1])):
        lines.append((f"fault: {kind}" if fault else kind, count, fault))
    parts.append(_share_table("recordings", lines))
    if skipped:
        items = "".join(
            f"<li><code>{escaped(one['id'])}</code>: {escaped(one['reason'])}</li>"
            for one in sorted(skipped, key=lambda one: not one["is_fault"])[:_MOST_REASONS]
        )
        more = len(skipped) - _MOST_REASONS
        rest = f"<p>and {more:,} more, in the store's manifest.json</p>" if more > 0 else ""
        parts.append(
            f"<details><summary>each of the {len(skipped):,} with its reason</summary>"
            f"<ul>{items}</ul>{rest}</details>"
        )
    if windows:
        reasons = Counter(windows).most_common()
        lines = [("kept", total.windows, False), *((why, count, False) for why, count in reasons)]
        parts.append(_share_table("candidate windows", lines))
    if not skipped and not windows:
        return "<section>Nothing was dropped.</section>"
    return f"<section>{''.join(parts)}</section>"


def _share_table(noun: str, lines: Sequence[tuple[str, int, bool]]) -> str:
    whole = sum(count for _, count, _ in lines) or 1
    rows = [
        (
            escaped(name),
            flagged(f"{count:,}", fault),
            f"{100 * count / whole:.1f} %",
            length_bar(count / whole),
        )
        for name, count, fault in lines
    ]
    return html_table([noun, "", "", ""], rows, (1, 2), "shares")
