"""What is measured of a system: sums per take, and numbers of them with their intervals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import CospeechError
from cospeech.metrics.resampling import Estimate, Resampling, combined
from cospeech.motion.upper_body import EVALUATION_FPS
from cospeech.reporting.tables import summarise
from cospeech.studies.caused_gestures.answers import (
    faster_than_between,
    met,
    peak_times,
    ranks_at_lags,
    step_times,
    within,
    wrist_speeds,
)
from cospeech.studies.caused_gestures.concepts import (
    ConceptShapes,
    matched,
    places,
    votes,
    wrist_steps,
)
from cospeech.studies.caused_gestures.poses import (
    PoseSpace,
    first_and_last_quarter,
    pose_variance,
)
from cospeech.studies.caused_gestures.strokes import KINDS, Take

Array = NDArray[np.float64]
Totals = Mapping[str, Array]
"""Sums over takes by name."""

LAGS_S = tuple(round(frame / EVALUATION_FPS, 4) for frame in range(-15, 16))
"""Seconds by which motion is taken to follow the recorded strokes."""

LONG_S = 30.0
"""Seconds of gesturing from which a take is long enough to drift in."""

RESAMPLES = 400

_POSES_FPS = 2
"""Training poses per second that the pose space is of; neighbours are alike."""


@dataclass(frozen=True, eq=False)
class Setting:
    """What all systems are measured by.

    Attributes:
        takes: Of the judged part.
        shapes: What recorded strokes of the training part look like.
        space: The training part's poses.
        resampling: Draws of takes.
    """

    takes: Sequence[Take]
    shapes: ConceptShapes
    space: PoseSpace
    resampling: Resampling


def make_setting(training: Sequence[Take], takes: Sequence[Take], seed: int) -> Setting:
    """From recorded takes of the training part, and those of the judged part.

    Args:
        training: Teach shapes and poses.
        takes: Are judged; none of them teaches.
        seed: Of the draws.

    Raises:
        CospeechError: No word causes a stroke in the training part.
    """
    strokes = [stroke for take in training for stroke in take.of_kind("words")]
    if not strokes:
        raise CospeechError(
            "no word of the training part causes a gesture, so none can be recognised",
            "use a longer corpus: data.minutes",
        )
    steps = [
        wrist_steps(take.positions, EVALUATION_FPS, stroke.start_s, stroke.end_s)
        for take in training
        for stroke in take.of_kind("words")
    ]
    every = round(EVALUATION_FPS / _POSES_FPS)
    return Setting(
        takes,
        ConceptShapes.of(steps, strokes),
        PoseSpace.of(np.concatenate([take.positions[::every] for take in training])),
        Resampling(np.arange(len(takes)), RESAMPLES, seed),
    )


@dataclass(frozen=True)
class SystemMotion:
    """What a system moves for the speech of the judged takes.

    Attributes:
        name: Of the system.
        seed: Of its training; None where nothing was trained.
        positions: Of each take ``(T, 10, 3)`` at the evaluation rate, as long as it.
    """

    name: str
    seed: int | None
    positions: Sequence[NDArray[np.float32]]


@dataclass(frozen=True, eq=False)
class Number:
    """A number of a system.

    Attributes:
        mean: Over its seeds, with draws of takes.
        by_seed: Of each; empty where nothing was trained, and for differences.
    """

    mean: Estimate
    by_seed: tuple[float, ...]

    def minus(self, other: Number) -> Number:
        """The difference to another system's, take by take; seeds have no partners."""
        return Number(combined(np.subtract, self.mean, other.mean), ())

    @property
    def value(self) -> float:
        """Of the mean; NaN where there was nothing to measure."""
        return self.mean.value

    @property
    def interval(self) -> tuple[float, float] | None:
        """95 % over takes, of the mean; None for too few takes."""
        return self.mean.interval()

    @property
    def seeds_interval(self) -> tuple[float, float] | None:
        """95 % of the mean over seeds, by Student's t; None for one seed."""
        summary = summarise(self.by_seed)
        return None if summary is None else summary.ci95


@dataclass(frozen=True, eq=False)
class SystemNumbers:
    """A system in numbers.

    Attributes:
        name: Of the system.
        seeds: Of its trainings; empty where nothing was trained.
        numbers: By the keys of `STATISTICS`.
        counts: How many ``takes``, ``long`` takes, ``words`` (strokes that they cause), ``known``
            ones of these (whose concept the training part has) and ``beats`` the numbers are of.
        profile: ``(len(LAGS_S),)`` rank of the wrists' speed at the beats, over the lag.
    """

    name: str
    seeds: tuple[int, ...]
    numbers: dict[str, Number]
    counts: dict[str, int]
    profile: Array


def _over(part: str, whole: str) -> Callable[[Totals], float]:
    def share(totals: Totals) -> float:
        return float(totals[part] / totals[whole]) if totals[whole] > 0 else float("nan")

    return share


def _lift(part: str, chance: str, whole: str) -> Callable[[Totals], float]:
    def lift(totals: Totals) -> float:
        room = float(totals[whole] - totals[chance])
        return float(totals[part] - totals[chance]) / room if room > 0 else float("nan")

    return lift


def _lag(totals: Totals) -> float:
    profile = _profile(totals)
    usable = np.isfinite(profile).all() and np.ptp(profile) > 1e-9
    return LAGS_S[int(profile.argmax())] if usable else float("nan")


def _profile(totals: Totals) -> Array:
    ranks, counts = totals["beat_ranks"], totals["beat_ranks_of"]
    profile: Array = np.divide(ranks, counts, out=np.full(len(ranks), np.nan), where=counts > 0)
    return profile


def _drift(totals: Totals) -> float:
    first, last = (_over(f"{quarter}_quarter", "long")(totals) for quarter in ("first", "last"))
    return last - first


def _spread(totals: Totals) -> float:
    return float(np.sqrt(_over("variance", "recorded_variance")(totals)))


STATISTICS: dict[str, Callable[[Totals], float]] = {
    "concept_share": _over("votes", "words"),
    "concept_share_by_luck": _over("votes_by_luck", "words"),
    "concept_lift": _lift("votes", "votes_by_luck", "words"),
    "concept_place": _over("places", "words"),
    "concept_place_by_luck": _over("places_by_luck", "words"),
    "words_answered": _over("words_faster", "words_compared"),
    "beats_answered": _over("beats_faster", "beats_compared"),
    "beats_met": _over("met", "beats"),
    "beats_met_by_chance": _over("met_by_chance", "beats"),
    "beats_lift": _lift("met", "met_by_chance", "beats"),
    "beats_lag_s": _lag,
    "first_quarter": _over("first_quarter", "long"),
    "last_quarter": _over("last_quarter", "long"),
    "drift": _drift,
    "speed": _over("speed", "recorded_speed"),
    "spread": _spread,
}
"""Name -> what it is of sums over takes."""


def measure_system(members: Sequence[SystemMotion], setting: Setting) -> SystemNumbers:
    """A system from its motion by every seed.

    Args:
        members: Of one name.
        setting: What is measured by.
    """
    sums = [_sums(member.positions, setting) for member in members]
    seeds = tuple(member.seed for member in members if member.seed is not None)
    draws = [setting.resampling.rows(partial(_values, own)) for own in sums]
    numbers = {}
    for column, key in enumerate(STATISTICS):
        each = [Estimate.of(rows[:, column]) for rows in draws]
        mean = combined(lambda *values: np.mean(values, axis=0), *each)
        numbers[key] = Number(mean, tuple(one.value for one in each) if seeds else ())
    everything = np.arange(len(setting.takes))
    first = _totals(sums[0], everything)
    return SystemNumbers(
        name=members[0].name,
        seeds=seeds,
        numbers=numbers,
        counts={
            "takes": len(setting.takes),
            "long": int(first["long"]),
            "words": int(first["words_compared"]),
            "known": int(first["words"]),
            "beats": int(first["beats"]),
        },
        profile=np.mean([_profile(_totals(own, everything)) for own in sums], axis=0),
    )


def _values(sums: Mapping[str, Array], chosen: NDArray[np.int64]) -> list[float]:
    totals = _totals(sums, chosen)
    return [statistic(totals) for statistic in STATISTICS.values()]


def _totals(sums: Mapping[str, Array], chosen: NDArray[np.int64]) -> Totals:
    return {key: values[chosen].sum(axis=0) for key, values in sums.items()}


def _sums(positions: Sequence[NDArray[np.float32]], setting: Setting) -> dict[str, Array]:
    """Name -> sums of each take."""
    rows = [
        _take_sums(take, motion, setting)
        for take, motion in zip(setting.takes, positions, strict=True)
    ]
    return {key: np.array([row[key] for row in rows], dtype=np.float64) for key in rows[0]}


def _take_sums(
    take: Take, positions: NDArray[np.float32], setting: Setting
) -> dict[str, float | Array]:
    fps, gesturing_s = EVALUATION_FPS, take.gesturing_s
    speeds = wrist_speeds(positions, fps)
    beats = take.of_kind("beats")
    ranks = ranks_at_lags(speeds, fps, beats, gesturing_s, LAGS_S)
    beats_met, by_chance = met(
        [stroke.middle_s for stroke in beats], peak_times(speeds, fps, gesturing_s), gesturing_s
    )
    sums: dict[str, float | Array] = {
        **_concept_sums(take, positions, setting.shapes),
        "beats": len(beats),
        "beat_ranks": np.nansum(ranks, axis=0),
        "beat_ranks_of": np.isfinite(ranks).sum(axis=0).astype(np.float64),
        "met": beats_met,
        "met_by_chance": by_chance,
    }
    for kind in KINDS:
        faster = faster_than_between(speeds, fps, take.of_kind(kind), take.strokes, gesturing_s)
        sums[f"{kind}_faster"] = float(np.nansum(faster))
        sums[f"{kind}_compared"] = float(np.isfinite(faster).sum())
    inside = within(step_times(len(speeds), fps), *gesturing_s)
    poses = np.flatnonzero(inside)
    is_long = gesturing_s[1] - gesturing_s[0] >= LONG_S
    quarters = (0.0, 0.0)
    if is_long:
        quarters = first_and_last_quarter(setting.space.distances(positions[poses]))
    return {
        **sums,
        "long": float(is_long),
        "first_quarter": quarters[0],
        "last_quarter": quarters[1],
        "speed": float(speeds[inside].sum()),
        "recorded_speed": float(wrist_speeds(take.positions, fps)[inside].sum()),
        "variance": pose_variance(positions[poses]),
        "recorded_variance": pose_variance(take.positions[poses]),
    }


def _concept_sums(
    take: Take, positions: NDArray[np.float32], shapes: ConceptShapes
) -> dict[str, float | Array]:
    """Of strokes of concepts that the training part knows."""
    strokes = [stroke for stroke in take.of_kind("words") if stroke.concept in shapes.concepts]
    found: dict[str, float | Array] = dict.fromkeys(
        ("votes", "votes_by_luck", "places", "places_by_luck"), 0.0
    )
    if strokes:
        steps = [
            wrist_steps(positions, EVALUATION_FPS, stroke.start_s, stroke.end_s)
            for stroke in strokes
        ]
        concepts = np.array([shapes.concepts.index(stroke.concept) for stroke in strokes])
        likeness = shapes.likeness(steps)
        found["votes"], found["votes_by_luck"] = matched(votes(likeness), concepts)
        found["places"], found["places_by_luck"] = matched(places(likeness), concepts)
    return {**found, "words": float(len(strokes))}
