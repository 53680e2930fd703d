"""Totals of the corpus report: what there is, split by split, and what was dropped."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from cospeech.corpus.store import Store
from cospeech.motion.upper_body import EVALUATION_FPS
from cospeech.reporting.corpus_report.charts import length_bar
from cospeech.reporting.corpus_report.statistics import WINDOW_FRAMES, WINDOW_STRIDE
from cospeech.reporting.corpus_report.totals import CorpusStatistics, SplitTotals
from cospeech.reporting.markup import escaped
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
    rows = [*statistics.splits, statistics.total]
    lines = [
        f"<tr{' class=reference' if split is statistics.total else ''}>"
        f"<td>{escaped(split.name)}</td>"
        + "".join(f'<td class="number">{cell}</td>' for cell in _split_cells(split, hours))
        + "</tr>"
        for split in rows
    ]
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
    cells = f"<th>{heads[0]}</th>" + "".join(f'<th class="number">{h}</th>' for h in heads[1:])
    return (
        f"<section><table><tr>{cells}</tr>{''.join(lines)}</table></section>"
        f'<p class="muted">{windows} {overlap}</p>'
    )


def _split_cells(split: SplitTotals, hours: bool) -> list[str]:
    pace = split.words_per_minute
    spoken = np.isfinite(pace)
    return [
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
    faults = Counter(one["kind"] for one in skipped if one["is_fault"])
    rules = Counter(one["kind"] for one in skipped if not one["is_fault"])
    lines = [("kept", total.recordings, "")]
    lines += [(kind, count, "") for kind, count in rules.most_common()]
    lines += [(f"fault: {kind}", count, "flag") for kind, count in faults.most_common()]
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
        lines = [("kept", total.windows, "")]
        lines += [
            (reason, count, "") for reason, count in sorted(windows.items(), key=lambda w: -w[1])
        ]
        parts.append(_share_table("candidate windows", lines))
    if not skipped and not windows:
        return "<section>Nothing was dropped.</section>"
    return f"<section>{''.join(parts)}</section>"


def _share_table(noun: str, lines: Sequence[tuple[str, int, str]]) -> str:
    whole = sum(count for _, count, _ in lines) or 1
    rows = "".join(
        f"<tr><td>{escaped(name)}</td>"
        f'<td class="number {style}">{count:,}</td>'
        f'<td class="number">{100 * count / whole:.1f} %</td>'
        f'<td class="bar">{length_bar(count / whole)}</td></tr>'
        for name, count, style in lines
    )
    return f"<table><tr><th>{noun}</th><th></th><th></th><th></th></tr>{rows}</table>"
