"""What the paper saw (section 8), held against numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cospeech.metrics.gesture_statistics.systems import REAL, SystemStatistics

FULL = "full"
"""Name of the complete model."""

PAPER_SYSTEMS = (REAL, FULL, "no_motion", "no_minibatch", "no_displacement", "mse_only")
"""The systems of figure 11; others follow them."""

AGREES, PARTLY = "holds", "holds as far as run"
UNCLEAR, DISAGREES = "unclear", "does not hold"


@dataclass(frozen=True)
class Comparison:
    """One number of one system is under that of another, or under a multiple of it.

    Attributes:
        statistic: Key of the statistic.
        smaller: Name of the system.
        larger: Name of the other.
        factor: Of the larger side.
    """

    statistic: str
    smaller: str
    larger: str
    factor: float = 1.0


@dataclass(frozen=True)
class Finding:
    """A statement of the paper and the comparisons that all have to hold.

    Attributes:
        section: Of the paper.
        claim: In words.
        comparisons: Of two systems each.
    """

    section: str
    claim: str
    comparisons: tuple[Comparison, ...]


def _each(
    statistic: str, smaller: Sequence[str], larger: Sequence[str], factor: float = 1.0
) -> tuple[Comparison, ...]:
    return tuple(Comparison(statistic, s, g, factor) for s in smaller for g in larger)


_DAMPED = ("no_displacement", "mse_only")

FINDINGS: tuple[Finding, ...] = (
    Finding(
        "8.2",
        "without the minibatch discriminator, motion is faster than real",
        _each("velocity", [REAL], ["no_minibatch"]),
    ),
    Finding(
        "8.2",
        "the full model and the one without the motion discriminator are as fast as real"
        " (here: within a quarter)",
        (
            *_each("velocity", [FULL, "no_motion"], [REAL], 1.25),
            *_each("velocity", [REAL], [FULL, "no_motion"], 1.25),
        ),
    ),
    Finding(
        "8.2",
        "without the displacement discriminator, and with the mean squared error alone, motion is"
        " far slower than real (here: under half)",
        _each("velocity", _DAMPED, [REAL], 0.5),
    ),
    Finding(
        "8.2",
        "the mean squared error alone gives slow, damped motion: slower and with windows less far"
        " apart than the full model and those without the motion or the minibatch discriminator",
        (
            *_each("velocity", ["mse_only"], [FULL, "no_motion", "no_minibatch"]),
            *_each("diversity", ["mse_only"], [FULL, "no_motion", "no_minibatch"]),
        ),
    ),
    Finding(
        "8.2",
        "the full model's velocity curve is nearest to real's",
        _each("velocity_area", [FULL], ["no_minibatch", *_DAMPED]),
    ),
    Finding(
        "8.2",
        "the full model's ranges are nearest to real's, though not as wide",
        (
            *_each("range", [FULL], [REAL]),
            *_each("range_gap", [FULL], ["no_motion", "no_minibatch", *_DAMPED]),
        ),
    ),
    Finding(
        "8.2",
        "without the displacement discriminator, and with the mean squared error alone, gestures"
        " are closer to the body than real's and than the full model's; without the motion"
        " discriminator, closer than real's",
        (
            *_each("range", _DAMPED, [REAL, FULL]),
            *_each("range", ["no_motion"], [REAL]),
        ),
    ),
    Finding(
        "8.2",
        "without the displacement discriminator, and with the mean squared error alone, ranges"
        " vary about as much as real's (here: from half to twice)",
        (
            *_each("range_spread", _DAMPED, [REAL], 2.0),
            *_each("range_spread", [REAL], _DAMPED, 2.0),
        ),
    ),
    Finding(
        "8.2",
        "without the minibatch discriminator, ranges are almost constant (here: they vary less than"
        " half as much as real's and the full model's)",
        _each("range_spread", ["no_minibatch"], [REAL, FULL], 0.5),
    ),
    Finding(
        "8.1.2",
        "without the motion discriminator, joints leave the skeleton: bones stretch more",
        _each("bone_variation", [FULL], ["no_motion"]),
    ),
    Finding(
        "8.1.3",
        "without the minibatch discriminator, motion repeats itself",
        _each("variety", ["no_minibatch"], [FULL, REAL]),
    ),
    Finding(
        "8.1.4",
        "without the displacement discriminator, motion stays damped: windows are less far apart",
        _each("diversity", ["no_displacement"], [FULL]),
    ),
    Finding(
        "8.1.4",
        "without phase and displacement discriminators motion jitters, and with the displacement"
        " discriminator less",
        _each("jitter", [REAL, "no_phase"], ["no_phase_no_displacement"]),
    ),
    Finding(
        "8.1.6",
        "the continuity penalty makes jumps between windows smaller",
        _each("window_jump_size", [FULL], ["no_continuity"]),
    ),
    Finding(
        "8.1.6",
        "the finger penalty keeps finger tips near the hand",
        _each("finger_distance", [FULL], ["no_fingers"]),
    ),
    Finding(
        "8.1.1",
        "without the phase discriminator there are no clear holds: hands are held less",
        _each("held", ["no_phase"], [FULL, REAL]),
    ),
    Finding(
        "8.1.1",
        "the phase discriminator brings the phases' order and shares nearer to real's (ours: the"
        " paper shows no phases of generated motion)",
        (
            *_each("phase_shares", [FULL], ["no_phase"]),
            *_each("phase_transitions", [FULL], ["no_phase"]),
        ),
    ),
)
"""In the paper's words as far as they can be measured; thresholds marked "here" are ours."""


@dataclass(frozen=True)
class Comparand:
    """A comparison with its numbers.

    Attributes:
        comparison: What is compared.
        smaller: Value of the side that should be smaller.
        larger: Value of the other side, without the factor.
        holds: Whether it is so.
        clear: Whether the 95 % interval of the difference, on the same recordings, leaves out 0;
            None where nothing could be resampled.
        seeds: How many training seeds agree, of how many. Seeds of the same number are compared;
            without any, each with the other system's mean.
    """

    comparison: Comparison
    smaller: float
    larger: float
    holds: bool
    clear: bool | None
    seeds: tuple[int, int]


@dataclass(frozen=True)
class Verdict:
    """What became of a finding here.

    Attributes:
        finding: The finding.
        parts: Its comparisons between systems that are there.
        missing: Systems it names that are not there.
        answer: ``"holds"``, or ``"holds as far as run"`` where systems are missing; ``"does not
            hold"``; ``"unclear"`` where a comparison that decides is within the interval or has
            none, or seeds differ; None where nothing can be compared.
    """

    finding: Finding
    parts: tuple[Comparand, ...]
    missing: tuple[str, ...]
    answer: str | None


def judge(statistics: Sequence[SystemStatistics]) -> list[Verdict]:
    """Hold every finding against measured systems.

    Args:
        statistics: From `cospeech.metrics.gesture_statistics.measuring.measure_systems`.

    Returns:
        One verdict per entry of `FINDINGS`.
    """
    systems = {system.name: system for system in statistics}
    return [_judge(finding, systems) for finding in FINDINGS]


def _judge(finding: Finding, systems: dict[str, SystemStatistics]) -> Verdict:
    named = dict.fromkeys(n for c in finding.comparisons for n in (c.smaller, c.larger))
    missing = tuple(name for name in named if name not in systems)
    parts = tuple(
        _compare(comparison, systems[comparison.smaller], systems[comparison.larger])
        for comparison in finding.comparisons
        if _is_known(comparison.statistic, systems.get(comparison.smaller))
        and _is_known(comparison.statistic, systems.get(comparison.larger))
    )
    answer = _answer(parts)
    return Verdict(finding, parts, missing, PARTLY if answer == AGREES and missing else answer)


def _is_known(statistic: str, system: SystemStatistics | None) -> bool:
    if system is None or statistic not in system.estimates:
        return False
    return bool(np.isfinite(system.estimates[statistic].value))


def _compare(
    comparison: Comparison, smaller: SystemStatistics, larger: SystemStatistics
) -> Comparand:
    key, factor = comparison.statistic, comparison.factor
    small, large = smaller.estimates[key], larger.estimates[key]
    margin = large.combined(small, lambda b, a: factor * np.asarray(b) - np.asarray(a))
    interval = margin.interval()
    pairs = _seed_pairs(smaller, larger, key)
    agreeing = sum(small_value < factor * large_value for small_value, large_value in pairs)
    return Comparand(
        comparison,
        small.value,
        large.value,
        margin.value > 0,
        None if interval is None else interval[0] > 0 or interval[1] < 0,
        (agreeing, len(pairs)),
    )


def _seed_pairs(
    smaller: SystemStatistics, larger: SystemStatistics, key: str
) -> list[tuple[float, float]]:
    """Values of both systems seed by seed."""
    small, large = (
        dict(zip(system.seeds, (e.value for e in system.by_seed[key]), strict=True))
        for system in (smaller, larger)
    )
    if common := [seed for seed in small if seed in large]:
        return [(small[seed], large[seed]) for seed in common]
    if len(small) >= len(large):
        return [(value, larger.estimates[key].value) for value in small.values()]
    return [(smaller.estimates[key].value, value) for value in large.values()]


def _answer(parts: Sequence[Comparand]) -> str | None:
    if not parts:
        return None
    if any(part.clear and not part.holds and part.seeds[0] == 0 for part in parts):
        return DISAGREES
    if all(part.clear and part.holds and part.seeds[0] == part.seeds[1] for part in parts):
        return AGREES
    return UNCLEAR


PAPER_ORDERS: dict[str, str] = {
    "velocity": "no minibatch > real ≈ full ≈ no motion ≫ no displacement ≈ MSE only",
    "velocity_area": "full and no motion nearest",
    "range": "real > full > no displacement and MSE only; no motion below real",
    "range_gap": "full nearest",
    "range_spread": "no minibatch almost none; no displacement and MSE only as real",
    "held": "no clear holds without phase",
    "jitter": "without phase and displacement most",
    "diversity": "no displacement and MSE only damped",
    "variety": "no minibatch repeats",
    "repeated": "no minibatch repeats",
    "bone_variation": "no motion leaves the skeleton",
    "finger_distance": "too far without the finger penalty",
    "window_jump_size": "larger without the continuity penalty",
    "phase_shares": "further without phase",
    "phase_transitions": "further without phase",
}
"""Statistic -> what the paper's figures and text say of it; it prints no numbers."""
