"""What the paper saw (section 8), held against numbers."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cospeech.metrics.resampling import combined
from cospeech.studies.multi_adversary_figures.measured import Number, SystemStatistics
from cospeech.studies.multi_adversary_figures.paper import FINDINGS, Finding, Under

AGREES, PARTLY = "holds", "holds as far as run"
UNCLEAR, DISAGREES = "unclear", "does not hold"


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
