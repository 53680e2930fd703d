"""Recordings whose numbers stand apart from the rest of their corpus."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FENCE = 3.0
"""Inter-quartile ranges beyond the quartiles at which a number stands apart (Tukey's far out)."""

FEWEST = 8
"""Recordings below which quartiles say nothing."""

SILENCE_DB = -60.0
EXCESS_S = 0.5
CLIPPED_SHARE = 0.001


@dataclass(frozen=True)
class Measure:
    """A per-recording number, and how it is read.

    Attributes:
        key: One of `MEASURES`.
        title: What it is called on the page.
        unit: Unit shown.
        factor: From the stored number to that unit.
        logarithmic: Judged by ratios.
        slack: Inter-quartile range at the least, in shown units (or natural-log units), so that
            a corpus of near-equal recordings has no one stand out by a hair.
    """

    key: str
    title: str
    unit: str
    factor: float
    logarithmic: bool
    slack: float

    def shown(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values in the unit shown."""
        return values * self.factor


@dataclass(frozen=True)
class Fences:
    """Where the middle half of a measure lies and from where on a number stands apart.

    Attributes:
        quartiles: First and third, in shown units.
        bounds: Lowest and highest value that does not stand apart.
    """

    quartiles: tuple[float, float]
    bounds: tuple[float, float]


@dataclass(frozen=True)
class Unusual:
    """One number of one recording that stands apart.

    Attributes:
        recording: Index.
        measure: What was measured.
        value: In the measure's unit.
        fences: What is usual; None where a fixed bound was broken.
        note: The fixed bound in words; empty otherwise.
        distance: How far out, in inter-quartile ranges; infinite for fixed bounds.
    """

    recording: int
    measure: Measure
    value: float
    fences: Fences | None
    note: str
    distance: float


def measures(dimensions: int) -> list[Measure]:
    """The measures of a corpus of 3-D motion or 2-D keypoints."""
    unit, factor = ("cm/s", 100.0) if dimensions == 3 else ("px/s", 1.0)
    return [
        Measure("seconds", "length", "s", 1.0, True, 0.2),
        Measure("words_per_minute", "words per minute", "", 1.0, False, 10.0),
        Measure("left_wrist", "left wrist, mean speed", unit, factor, True, 0.2),
        Measure("right_wrist", "right wrist, mean speed", unit, factor, True, 0.2),
        Measure("still", "both wrists still", "%", 100.0, False, 5.0),
        Measure("bone_variation", "bones' lengths vary by", "%", 100.0, False, 0.5),
        Measure("level", "audio level", "dBFS", 1.0, False, 1.0),
        Measure("clipped", "samples at full scale", "%", 100.0, False, 0.01),
        Measure("excess_audio", "audio longer than motion", "s", 1.0, False, 0.05),
    ]


def fences(measure: Measure, values: NDArray[np.float64]) -> Fences | None:
    """What is usual of a measure; None for fewer than eight recordings.

    Args:
        measure: Tells whether differences or ratios count.
        values: In shown units; NaN is left out, and so is zero where ratios count.
    """
    levels = _levels(measure, values)
    levels = levels[np.isfinite(levels)]
    if len(levels) < FEWEST:
        return None
    low, high = np.percentile(levels, [25, 75])
    reach = FENCE * max(high - low, measure.slack)
    ends = np.array([low, high, low - reach, high + reach])
    first, third, least, most = np.exp(ends) if measure.logarithmic else ends
    return Fences((float(first), float(third)), (float(least), float(most)))


def unusual(values: Mapping[str, NDArray[np.float64]], dimensions: int) -> list[Unusual]:
    """Numbers that stand apart, broken fixed bounds first, then the farthest out.

    Fixed bounds: a transcript without words, audio below -60 dBFS, a thousandth of the samples at
    full scale, audio and motion that differ by half a second, wrists that never move.

    Args:
        values: The per-recording numbers of the corpus' statistics.
        dimensions: 3, or 2 for keypoints.
    """
    found: list[Unusual] = []
    for measure in measures(dimensions):
        shown = measure.shown(values[measure.key])
        notes = _broken_bounds(measure.key, values[measure.key])
        found += [
            Unusual(i, measure, float(shown[i]), None, note, np.inf) for i, note in notes.items()
        ]
        usual = fences(measure, shown)
        if usual is None:
            continue
        levels = _levels(measure, shown)
        ends = np.array([*usual.quartiles])
        first, third = np.log(ends) if measure.logarithmic else ends
        width = max(third - first, measure.slack)
        distance = np.maximum(first - levels, levels - third) / width
        for i in np.flatnonzero(distance > FENCE):
            if i not in notes:
                found.append(
                    Unusual(int(i), measure, float(shown[i]), usual, "", float(distance[i]))
                )
    return sorted(found, key=lambda one: (-one.distance, one.recording))


def short(value: float) -> str:
    """Three digits or so, for a table."""
    if abs(value) >= 100:
        return f"{value:,.0f}"
    return f"{value:.1f}" if abs(value) >= 10 else f"{value:.2f}"


def _levels(measure: Measure, values: NDArray[np.float64]) -> NDArray[np.float64]:
    if not measure.logarithmic:
        return values
    return np.log(np.where(values > 0, values, np.nan))


def _broken_bounds(key: str, values: NDArray[np.float64]) -> dict[int, str]:
    tests = {
        "words_per_minute": (values == 0, "the transcript has no words"),
        "left_wrist": (values == 0, "never moves"),
        "right_wrist": (values == 0, "never moves"),
        "level": (values < SILENCE_DB, "silent: below -60 dBFS"),
        "clipped": (values > CLIPPED_SHARE, "clipped: more than 0.1 % of the samples"),
        "excess_audio": (np.abs(values) > EXCESS_S, "audio and motion differ by over 0.5 s"),
    }
    if key not in tests:
        return {}
    broken, note = tests[key]
    return {int(i): note for i in np.flatnonzero(broken)}
