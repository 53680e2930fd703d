"""The page: velocity, range, scatter, phases and every number, real motion beside each system."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

from cospeech.files import write_text
from cospeech.metrics.phase_structure import PhaseStructure
from cospeech.reporting.markup import escaped, html_facts, html_page, html_sections
from cospeech.studies.multi_adversary_figures.curves import range_chart, velocity_chart
from cospeech.studies.multi_adversary_figures.findings import Verdict
from cospeech.studies.multi_adversary_figures.measured import Setting, SystemStatistics
from cospeech.studies.multi_adversary_figures.phase_charts import (
    duration_chart,
    share_chart,
    transition_matrices,
)
from cospeech.studies.multi_adversary_figures.scatter import scatter_panels
from cospeech.studies.multi_adversary_figures.styles import title_of
from cospeech.studies.multi_adversary_figures.tables import (
    bones_table,
    findings_table,
    numbers_table,
    tally,
)

PAPER = "Ferstl, Neff and McDonnell 2020"

_SHEET = files("cospeech.studies.multi_adversary_figures") / "figures.css"


def write_page(
    path: Path,
    corpus: str,
    split: str,
    setting: Setting,
    systems: Sequence[SystemStatistics],
    verdicts: Sequence[Verdict],
    facts: Sequence[tuple[str, str]] = (),
    annotated: PhaseStructure | None = None,
) -> None:
    """Write the page, one HTML file that needs no other.

    Args:
        path: The file; replaced only when the new one is complete.
        corpus: Its name.
        split: Which part of it.
        setting: What the systems share.
        systems: From `measure_systems`, real first.
        verdicts: From `judge`.
        facts: Name and value of everything a reader must know to do it again.
        annotated: Phases as people annotated them, beside those that the classifier found.
    """
    windows = len(setting.window_recordings)
    several = any(len(system.seeds) > 1 for system in systems)
    counts = sorted({len(system.seeds) for system in systems[1:]})
    seeds = " to ".join(map(str, dict.fromkeys((counts[0], counts[-1]))))
    name = escaped(corpus)
    sections = [
        (
            "findings",
            "What the paper saw, and what is seen here",
            f'<p class="tally">{tally(verdicts)}</p>{findings_table(verdicts)}',
            "Intervals are 95 % over held-out recordings, resampled whole; systems are compared on"
            " the same draws. <b>Unclear</b>: the interval of the deciding difference holds 0, or"
            " training seeds differ.",
        ),
        (
            "velocity",
            "Wrist velocity at each predicted step",
            velocity_chart(systems),
            "|Δx| + |Δy| + |Δz| per step (equation 6), mean of both wrists, median over"
            f" {windows} windows (equation 7)"
            f"{'; the mean of its training seeds' if several else ''}. Band: 95 % of real's curve"
            " over resampled recordings.",
        ),
        (
            "range",
            "Range of the wrists",
            range_chart(systems),
            f"A point is one of the same {len(setting.range_windows)} windows: the largest"
            " Euclidean distance of either wrist from its place in the mean pose of the training"
            " part. Box: quartiles; whiskers: extremes; dashed: real's median."
            f"{' Each training seed has a strip of points.' if several else ''}",
        ),
        (
            "positions",
            "Positions over two minutes",
            scatter_panels(systems, setting),
            "Seen from the front, four poses per second of the first two minutes of the same"
            " held-out speech, around the training part's mean pose; the grid is 25 cm. The"
            " speaker's left is at the reader's right.",
        ),
        ("phases", "Gesture phases", *_phases(setting.phase_classes, systems, annotated)),
        (
            "numbers",
            "All numbers",
            f"{numbers_table(systems)}<details><summary>bone by bone: mean length, and variation"
            f" over time</summary>{bones_table(systems, setting)}</details>",
            f"Small lines: 95 % interval over held-out recordings{_OF_SEEDS if several else ''}."
            " Real's own column of a distance to real, in italics, is the distance between random"
            " halves of its recordings: a distance of that size is hardly one.",
        ),
        ("facts", "How it was made", html_facts((escaped(k), escaped(v)) for k, v in facts), ""),
    ]
    body = [
        f"<h1>How the systems gesture: {name}</h1>",
        f'<p class="muted">The evaluation of {PAPER}, section 8, on the {escaped(split)} part:'
        f" {len(systems) - 1} systems beside real motion, {windows} windows,"
        f" {'one training seed' if counts == [1] else f'{seeds} training seeds'} each</p>",
        *html_sections(
            [
                (key, heading, f"<section>{content}</section><p class='muted'>{note}</p>")
                for key, heading, content, note in sections
            ]
        ),
    ]
    write_text(path, html_page(f"{name}: gestures", body, _SHEET))


_OF_SEEDS = " of the mean over training seeds, and the value of each seed"


def _phases(
    classes: Sequence[str], systems: Sequence[SystemStatistics], annotated: PhaseStructure | None
) -> tuple[str, str]:
    rows = [(title_of(s.name), s.phases) for s in systems if s.phases is not None]
    if not rows:
        return "No phase classifier was given.", ""
    if annotated is not None:
        rows.insert(1, ("real, as annotated", annotated))
    return (
        f"<h3>Share of time</h3>{share_chart(rows, classes)}"
        f"<h3>How long they last</h3>{duration_chart(rows, classes)}"
        f"<h3>What follows what</h3>{transition_matrices(rows, classes)}",
        "One classifier labels real and generated motion alike, as in the paper, so that its errors"
        " are on both sides. Transitions: of the times that the row's phase ends, how many per cent"
        " go on with the column's.",
    )
