"""The numbers of the study: table 2, and whether each control does what it should."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cospeech.matching.control import database_mask, parse_criterion
from cospeech.matching.control.frames import DatabaseFrames
from cospeech.matching.search import MatchingSearch
from cospeech.metrics.resampling import Estimate, Resampling, combined
from cospeech.studies.control_adherence.motions import CHANGING, FREE, Made, Values
from cospeech.studies.control_adherence.tested_controls import (
    CHANGING_QUANTITIES,
    TESTED_CONTROLS,
    TestedControl,
)

RESAMPLES = 1000


@dataclass(frozen=True)
class Spread:
    """A quantity over all frames of all recordings.

    Attributes:
        mean: m or m/s.
        deviation: Standard deviation over frames (docs/facts/motion_matching.md, section 10,
            decision 17).
        share: Share of the frames beyond the threshold.
        within: Mean without the first frame of each window, whose speed is a leap from the window
            before.
    """

    mean: float
    deviation: float
    share: float
    within: float


@dataclass(frozen=True)
class Windows:
    """What a criterion leaves of the windows that a recording's motion is taken from.

    Attributes:
        mean: Windows, over recordings; where motion is taken from one speaker, that speaker's.
        fewest: Of all recordings.
        of: Windows without it, over recordings.
    """

    mean: float
    fewest: int
    of: float


@dataclass(frozen=True)
class Shift:
    """How far a control moves a mean.

    Attributes:
        value: In the way that was asked for, m or m/s: negative is the wrong way.
        interval: 95 % over recordings; None for fewer than five.
    """

    value: float
    interval: tuple[float, float] | None

    @property
    def verdict(self) -> str:
        """Whether the quantity moves as it should."""
        if self.interval is None:
            return "yes, too few recordings to be sure" if self.value > 0 else "no"
        if self.interval[0] > 0:
            return "yes"
        return "no" if self.interval[1] < 0 else "unclear"


@dataclass(frozen=True)
class Adherence:
    """One control at one stage of the method.

    Attributes:
        tested: The control.
        stage: The stage.
        threshold: m or m/s; the mean over recordings where speakers have their own.
        windows: What the control leaves.
        real: The recordings.
        free: Motion without control.
        controlled: Motion with it.
        shift: From the one to the other.
    """

    tested: TestedControl
    stage: str
    threshold: float
    windows: Windows
    real: Spread
    free: Spread
    controlled: Spread
    shift: Shift

    @property
    def verdict(self) -> str:
        """Whether the control does what it should."""
        return self.shift.verdict if self.windows.mean else "no windows"


@dataclass(frozen=True)
class Change:
    """A quantity of motion that shall be low in the first half and high in the second.

    Attributes:
        quantity: Which.
        stage: Stage of the method.
        halves: Mean in each half, m or m/s.
        free_halves: The same without control.
        shift: How much further the second half is above the first than without control.
    """

    quantity: str
    stage: str
    halves: tuple[float, float]
    free_halves: tuple[float, float]
    shift: Shift


def measure_adherence(made: Made, search: MatchingSearch, seed: int) -> list[Adherence]:
    """One entry per control and stage, in the order of the paper's table."""
    draws = Resampling(np.arange(len(made.names)), RESAMPLES, seed)
    found = []
    for tested in TESTED_CONTROLS:
        q = tested.quantity
        limits = thresholds(made, search, q, tested.percent)
        windows = count_windows(tested.where, search, made)
        for stage in made.stages:
            free, controlled = (made.motions[name][stage][q] for name in (FREE, tested.name))
            shift = _shift(draws, tested.way, _mean(draws, controlled), _mean(draws, free))
            found.append(
                Adherence(
                    tested,
                    stage,
                    float(np.mean(limits)),
                    windows,
                    real=_spread(made.real[q], tested.way, limits, search.step),
                    free=_spread(free, tested.way, limits, search.step),
                    controlled=_spread(controlled, tested.way, limits, search.step),
                    shift=shift,
                )
            )
    return found


def measure_change(made: Made, seed: int) -> list[Change]:
    """One entry per quantity and stage."""
    draws = Resampling(np.arange(len(made.names)), RESAMPLES, seed)
    found = []
    for q in CHANGING_QUANTITIES:
        for stage in made.stages:
            rises, halves = [], []
            for name in (CHANGING, FREE):
                values = made.motions[name][stage][q]
                first = _mean(draws, [part[: len(part) // 2] for part in values])
                second = _mean(draws, [part[len(part) // 2 :] for part in values])
                rises.append(combined(np.subtract, second, first))
                halves.append((first.value, second.value))
            found.append(Change(q, stage, halves[0], halves[1], _shift(draws, 1, *rises)))
    return found


def thresholds(made: Made, search: MatchingSearch, quantity: str, percent: float) -> list[float]:
    """What a percentile is for each recording, m or m/s."""
    return [
        float(
            DatabaseFrames(search.database, search.step, closed).quantity_percentile(
                quantity, percent
            )
        )
        for closed in made.closed
    ]


def count_windows(where: str, search: MatchingSearch, made: Made) -> Windows:
    """What a criterion leaves."""
    criterion, everything = parse_criterion(where), search.eligible()
    counts, all_counts = [], []
    for closed in made.closed:
        mask = database_mask(criterion, search.database, search.step, closed)
        used = np.ones(len(search.database), dtype=np.bool_)
        if closed is not None:
            used[closed] = False
        counts.append(int(search.eligible(mask)[used].sum()))
        all_counts.append(int(everything[used].sum()))
    return Windows(float(np.mean(counts)), min(counts), float(np.mean(all_counts)))


def _spread(series: Sequence[Values], way: int, limits: Sequence[float], step: int) -> Spread:
    values = np.concatenate(series)
    inside = np.concatenate([np.arange(len(part)) % step > 0 for part in series])
    beyond = [way * part >= way * limit for part, limit in zip(series, limits, strict=True)]
    return Spread(
        mean=float(values.mean()),
        deviation=float(values.std()),
        share=float(np.concatenate(beyond).mean()),
        within=float(values[inside].mean()),
    )


def _mean(draws: Resampling, series: Sequence[Values]) -> Estimate:
    """The mean over all frames of the drawn recordings."""
    sums = np.array([part.sum() for part in series])
    counts = np.array([len(part) for part in series])
    return draws.estimate(lambda chosen: float(sums[chosen].sum() / counts[chosen].sum()))


def _shift(draws: Resampling, way: int, controlled: Estimate, free: Estimate) -> Shift:
    difference = combined(lambda a, b: way * (a - b), controlled, free)
    return Shift(difference.value, difference.interval() if draws.draws else None)
