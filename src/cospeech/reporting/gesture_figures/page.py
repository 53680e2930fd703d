"""The page: velocity, range, scatter, phases and every number, real motion beside each system."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cospeech.files import write_text
from cospeech.metrics.gesture_statistics.findings import Verdict
from cospeech.metrics.gesture_statistics.phase_structure import PhaseStructure
from cospeech.metrics.gesture_statistics.systems import Setting, SystemStatistics
from cospeech.reporting.gesture_figures.curves import range_chart, velocity_chart
from cospeech.reporting.gesture_figures.phase_charts import (
    duration_chart,
    share_chart,
    transition_matrices,
)
from cospeech.reporting.gesture_figures.scatter import scatter_panels
from cospeech.reporting.gesture_figures.system_styles import system_styles, title_of
from cospeech.reporting.gesture_figures.texts import (
    bones_table,
    findings_table,
    numbers_table,
    tally,
)
from cospeech.reporting.markup import escaped, html_page

PAPER = "Ferstl, Neff and McDonnell 2020"


@dataclass(frozen=True, eq=False)
class GestureFigures:
    """What the page shows.

    Attributes:
        corpus: Its name.
        split: Which part of it.
        setting: What the systems share.
        systems: From `measure_systems`, real first.
        verdicts: From `judge`.
        facts: Name and value of everything a reader must know to do it again.
        annotated: Phases as people annotated them, beside those that the classifier found.
    """

    corpus: str
    split: str
    setting: Setting
    systems: Sequence[SystemStatistics]
    verdicts: Sequence[Verdict]
    facts: Sequence[tuple[str, str]] = ()
    annotated: PhaseStructure | None = None


def write_gesture_figures(figures: GestureFigures, path: str | Path) -> Path:
    """Write the page, one HTML file that needs no other.

    Args:
        figures: What it shows.
        path: The file; replaced only when the new one is complete.

    Returns:
        ``path``.
    """
    path = Path(path)
    sections = [
        ("findings", "What the paper saw, and what is seen here", _findings(figures)),
        ("velocity", "Wrist velocity at each predicted step", _velocity(figures)),
        ("range", "Range of the wrists", _range(figures)),
        ("positions", "Positions over two minutes", _scatter(figures)),
        ("phases", "Gesture phases", _phases(figures)),
        ("numbers", "All numbers", _numbers(figures)),
        ("facts", "How it was made", _made(figures)),
    ]
    links = "\n".join(f'<a href="#{key}">{key}</a>' for key, _, _ in sections)
    name = escaped(figures.corpus)
    body = [
        f"<h1>How the systems gesture: {name}</h1>",
        f'<p class="muted">{_subtitle(figures)}</p>',
        f"<nav>{links}</nav>",
        *(f'<h2 id="{key}">{title}</h2>{content}' for key, title, content in sections),
    ]
    write_text(path, html_page(f"{name}: gestures", body, "gesture_figures/gestures.css"))
    return path


def _subtitle(figures: GestureFigures) -> str:
    windows = len(figures.setting.window_recordings)
    trained = [system for system in figures.systems[1:] if system.seeds]
    counts = sorted({len(system.seeds) for system in trained})
    seeds = " to ".join(map(str, counts[:1] + counts[1:][-1:]))
    return (
        f"The evaluation of {PAPER}, section 8, on the {escaped(figures.split)} part:"
        f" {len(figures.systems) - 1} systems beside real motion, {windows} windows,"
        f" {'one training seed' if counts == [1] else f'{seeds} training seeds'} each"
    )


def _findings(figures: GestureFigures) -> str:
    note = (
        "Intervals are 95 % over held-out recordings, resampled whole; systems are compared on the"
        " same draws. <b>Unclear</b>: the interval of the deciding difference holds 0, or training"
        " seeds differ."
    )
    return (
        f'<section><p class="tally">{tally(figures.verdicts)}</p>'
        f"{findings_table(figures.verdicts)}</section><p class='muted'>{note}</p>"
    )


def _velocity(figures: GestureFigures) -> str:
    systems, setting = figures.systems, figures.setting
    chart = velocity_chart(systems, system_styles([s.name for s in systems]), setting.fps)
    windows = len(setting.window_recordings)
    several = "; the mean of its training seeds" if any(len(s.seeds) > 1 for s in systems) else ""
    return (
        f"<section>{chart}</section><p class='muted'>|Δx| + |Δy| + |Δz| per step (equation 6), mean"
        f" of both wrists, median over {windows} windows (equation 7){several}. Band: 95 % of"
        " real's curve over resampled recordings.</p>"
    )


def _range(figures: GestureFigures) -> str:
    systems = figures.systems
    chart = range_chart(systems, system_styles([s.name for s in systems]))
    count = len(figures.setting.range_windows)
    several = any(len(system.seeds) > 1 for system in systems)
    seeds = " Each training seed has a strip of points." if several else ""
    return (
        f"<section>{chart}</section><p class='muted'>A point is one of the same {count} windows:"
        " the largest Euclidean distance of either wrist from its place in the mean pose of the"
        " training part. Box: quartiles; whiskers: extremes; dashed: real's median."
        f"{seeds}</p>"
    )


def _scatter(figures: GestureFigures) -> str:
    return (
        f"<section>{scatter_panels(figures.systems, figures.setting)}</section>"
        "<p class='muted'>Seen from the front, four poses per second of the first two minutes of"
        " the same held-out speech, around the training part's mean pose; the grid is 25 cm. The"
        " speaker's left is at the reader's right.</p>"
    )


def _phases(figures: GestureFigures) -> str:
    classes = figures.setting.phase_classes
    rows = [(title_of(s.name), s.phases) for s in figures.systems if s.phases is not None]
    if not rows:
        return "<section>No phase classifier was given.</section>"
    with_people = list(rows)
    if figures.annotated is not None:
        with_people.insert(1, ("real, as annotated", figures.annotated))
    return (
        f"<section><h3>Share of time</h3>{share_chart(with_people, classes)}"
        f"<h3>How long they last</h3>{duration_chart(with_people, classes)}"
        f"<h3>What follows what</h3>{transition_matrices(with_people, classes)}</section>"
        "<p class='muted'>One classifier labels real and generated motion alike, as in the paper,"
        " so that its errors are on both sides. Transitions: of the times that the row's phase"
        " ends, how many per cent go on with the column's.</p>"
    )


def _numbers(figures: GestureFigures) -> str:
    systems, setting = figures.systems, figures.setting
    several = any(len(system.seeds) > 1 for system in systems)
    note = (
        "Small lines: 95 % interval over held-out recordings"
        + (" of the mean over training seeds, and the value of each seed" if several else "")
        + ". Real's own column of a distance to real, in italics, is the distance between random"
        " halves of its recordings: a distance of that size is hardly one."
    )
    return (
        f"<section>{numbers_table(systems, system_styles([s.name for s in systems]))}"
        "<details><summary>bone by bone: mean length, and variation over time</summary>"
        f"{bones_table(systems, setting.roles, setting.bones)}</details></section>"
        f"<p class='muted'>{note}</p>"
    )


def _made(figures: GestureFigures) -> str:
    rows = "".join(
        f"<dt>{escaped(key)}</dt><dd>{escaped(value)}</dd>" for key, value in figures.facts
    )
    return f'<section><dl class="facts">{rows}</dl></section>'
