"""What the paper saw (section 8), held against numbers."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cospeech.metrics.resampling import combined
from cospeech.studies.multi_adversary_figures.measured import REAL, Number, SystemStatistics

FULL = "full"
"""Name of the complete model."""

PAPER_SYSTEMS = (REAL, FULL, "no_motion", "no_minibatch", "no_displacement", "mse_only")
"""The systems of figure 11; others follow them."""

AGREES, PARTLY = "holds", "holds as far as run"
UNCLEAR, DISAGREES = "unclear", "does not hold"


@dataclass(frozen=True)
class Under:
    """A number of each of some systems is under that of each of others, or under a multiple of it.

    Attributes:
        statistic: Key of the statistic.
        smaller: Names of the systems.
        larger: Names of the others.
        factor: Of the larger side.
    """

    statistic: str
    smaller: Sequence[str]
    larger: Sequence[str]
    factor: float = 1.0


@dataclass(frozen=True)
class Finding:
    """A statement of the paper and the comparisons that all have to hold.

    Attributes:
        section: Of the paper.
        claim: In words.
        comparisons: What it says of systems.
    """

    section: str
    claim: str
    comparisons: tuple[Under, ...]


_DAMPED = ("no_displacement", "mse_only")

FINDINGS: tuple[Finding, ...] = (
    Finding(
        "8.2",
        "without the minibatch discriminator, motion is faster than real",
        (Under("velocity", [REAL], ["no_minibatch"]),),
    ),
    Finding(
        "8.2",
        "the full model and the one without the motion discriminator are as fast as real"
        " (here: within a quarter)",
        (
            Under("velocity", [FULL, "no_motion"], [REAL], 1.25),
            Under("velocity", [REAL], [FULL, "no_motion"], 1.25),
        ),
    ),
    Finding(
        "8.2",
        "without the displacement discriminator, and with the mean squared error alone, motion is"
        " far slower than real (here: under half)",
        (Under("velocity", _DAMPED, [REAL], 0.5),),
    ),
    Finding(
        "8.2",
        "the mean squared error alone gives slow, damped motion: slower and with windows less far"
        " apart than the full model and those without the motion or the minibatch discriminator",
        (
            Under("velocity", ["mse_only"], [FULL, "no_motion", "no_minibatch"]),
            Under("diversity", ["mse_only"], [FULL, "no_motion", "no_minibatch"]),
        ),
    ),
    Finding(
        "8.2",
        "the full model's velocity curve is nearest to real's",
        (Under("velocity_area", [FULL], ["no_minibatch", *_DAMPED]),),
    ),
    Finding(
        "8.2",
        "the full model's ranges are nearest to real's, though not as wide",
        (
            Under("range", [FULL], [REAL]),
            Under("range_gap", [FULL], ["no_motion", "no_minibatch", *_DAMPED]),
        ),
    ),
    Finding(
        "8.2",
        "without the displacement discriminator, and with the mean squared error alone, gestures"
        " are closer to the body than real's and than the full model's; without the motion"
        " discriminator, closer than real's",
        (
            Under("range", _DAMPED, [REAL, FULL]),
            Under("range", ["no_motion"], [REAL]),
        ),
    ),
    Finding(
        "8.2",
        "without the displacement discriminator, and with the mean squared error alone, ranges"
        " vary about as much as real's (here: from half to twice)",
        (
            Under("range_spread", _DAMPED, [REAL], 2.0),
            Under("range_spread", [REAL], _DAMPED, 2.0),
        ),
    ),
    Finding(
        "8.2",
        "without the minibatch discriminator, ranges are almost constant (here: they vary less than"
        " half as much as real's and the full model's)",
        (Under("range_spread", ["no_minibatch"], [REAL, FULL], 0.5),),
    ),
    Finding(
        "8.1.2",
        "without the motion discriminator, joints leave the skeleton: bones stretch more",
        (Under("bone_variation", [FULL], ["no_motion"]),),
    ),
    Finding(
        "8.1.3",
        "without the minibatch discriminator, motion repeats itself",
        (Under("variety", ["no_minibatch"], [FULL, REAL]),),
    ),
    Finding(
        "8.1.4",
        "without the displacement discriminator, motion stays damped: windows are less far apart",
        (Under("diversity", ["no_displacement"], [FULL]),),
    ),
    Finding(
        "8.1.4",
        "without phase and displacement discriminators motion jitters, and with the displacement"
        " discriminator less",
        (Under("jitter", [REAL, "no_phase"], ["no_phase_no_displacement"]),),
    ),
    Finding(
        "8.1.6",
        "the continuity penalty makes jumps between windows smaller",
        (Under("window_jump_size", [FULL], ["no_continuity"]),),
    ),
    Finding(
        "8.1.6",
        "the finger penalty keeps finger tips near the hand",
        (Under("finger_distance", [FULL], ["no_fingers"]),),
    ),
    Finding(
        "8.1.1",
        "without the phase discriminator there are no clear holds: hands are held less",
        (Under("held", ["no_phase"], [FULL, REAL]),),
    ),
    Finding(
        "8.1.1",
        "the phase discriminator brings the phases' order and shares nearer to real's (ours: the"
        " paper shows no phases of generated motion)",
        (
            Under("phase_shares", [FULL], ["no_phase"]),
            Under("phase_transitions", [FULL], ["no_phase"]),
        ),
    ),
)
"""In the paper's words as far as they can be measured; thresholds marked "here" are ours."""


@dataclass(frozen=True)
class Compared:
    """Two systems with their numbers.

    Attributes:
        statistic: Key of the statistic.
        smaller: Name and value of the system that should be smaller.
        larger: Those of the other, without the factor.
        factor: Of the larger side.
        holds: Whether it is so.
        clear: Whether the 95 % interval of the difference, on the same recordings, leaves out 0;
            None where nothing could be resampled.
        seeds_that_agree: How many training seeds, of how many. Seeds of the same number are
            compared; without any, each with the other system's mean.
    """

    statistic: str
    smaller: tuple[str, float]
    larger: tuple[str, float]
    factor: float
    holds: bool
    clear: bool | None
    seeds_that_agree: tuple[int, int]


@dataclass(frozen=True)
class Verdict:
    """What became of a finding here.

    Attributes:
        claim: The paper's, in words.
        section: Of the paper.
        answer: ``"holds"``, or ``"holds as far as run"`` where systems are missing; ``"does not
            hold"``; ``"unclear"`` where a comparison that decides is within the interval or has
            none, or seeds differ; None where nothing can be compared.
        not_run: Systems it names that are not there.
        comparisons: Those between systems that are there.
    """

    claim: str
    section: str
    answer: str | None
    not_run: tuple[str, ...]
    comparisons: tuple[Compared, ...]


def judge(statistics: Sequence[SystemStatistics]) -> list[Verdict]:
    """Hold every finding against measured systems.

    Args:
        statistics: From `measure_systems`.

    Returns:
        One verdict per entry of `FINDINGS`.
    """
    systems = {system.name: system for system in statistics}
    return [_judge(finding, systems) for finding in FINDINGS]


def _judge(finding: Finding, systems: dict[str, SystemStatistics]) -> Verdict:
    pairs = [
        (under, *pair)
        for under in finding.comparisons
        for pair in itertools.product(under.smaller, under.larger)
    ]
    missing = tuple(dict.fromkeys(n for _, *pair in pairs for n in pair if n not in systems))
    parts = tuple(
        _compare(under, systems[smaller], systems[larger])
        for under, smaller, larger in pairs
        if all(_is_known(under.statistic, systems.get(name)) for name in (smaller, larger))
    )
    answer = _answer(parts)
    if answer == AGREES and missing:
        answer = PARTLY
    return Verdict(finding.claim, finding.section, answer, missing, parts)


def _is_known(statistic: str, system: SystemStatistics | None) -> bool:
    if system is None or statistic not in system.numbers:
        return False
    return bool(np.isfinite(system.numbers[statistic].value))


def _compare(under: Under, smaller: SystemStatistics, larger: SystemStatistics) -> Compared:
    factor = under.factor
    small, large = (system.numbers[under.statistic] for system in (smaller, larger))
    margin = combined(lambda a, b: factor * b - a, small.mean, large.mean)
    interval = margin.interval()
    pairs = _seed_pairs(small, large)
    return Compared(
        under.statistic,
        (smaller.name, small.value),
        (larger.name, large.value),
        factor,
        holds=margin.value > 0,
        clear=None if interval is None else interval[0] > 0 or interval[1] < 0,
        seeds_that_agree=(sum(a < factor * b for a, b in pairs), len(pairs)),
    )


def _seed_pairs(small: Number, large: Number) -> list[tuple[float, float]]:
    """Values of both systems seed by seed."""
    if common := [seed for seed in small.by_seed if seed in large.by_seed]:
        return [(small.by_seed[seed], large.by_seed[seed]) for seed in common]
    if len(small.by_seed) >= len(large.by_seed):
        return [(value, large.value) for value in small.by_seed.values()]
    return [(small.value, value) for value in large.by_seed.values()]


def _answer(parts: Sequence[Compared]) -> str | None:
    if not parts:
        return None
    if any(p.clear and not p.holds and p.seeds_that_agree[0] == 0 for p in parts):
        return DISAGREES
    if all(p.clear and p.holds and len(set(p.seeds_that_agree)) == 1 for p in parts):
        return AGREES
    return UNCLEAR
