"""All the numbers of several systems on the same speech, real motion first."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cospeech.metrics.gesture_statistics import movement, wrists
from cospeech.metrics.gesture_statistics.phase_structure import (
    PhaseCounts,
    PhaseStructure,
    count_phases,
    phase_distances,
    phase_structure,
)
from cospeech.metrics.gesture_statistics.resampling import (
    Array,
    Estimate,
    Resampling,
    mean_estimate,
)

REAL = "real"
"""Name of the system that is the recordings themselves."""

RESAMPLES = 400
_HALVES = 20


@dataclass(frozen=True, eq=False)
class Setting:
    """What all systems of a comparison share.

    Attributes:
        roles: What each joint is, J names (`cospeech.motion.gesture_joints`).
        bones: (parent, child) indices.
        mean_pose: ``(J, 3)`` mean of the training part, metres.
        window_recordings: ``(N,)`` which recording each window is of.
        range_windows: Indices of the windows whose range is measured (the paper: 50).
        phase_classes: Names of the phases in `SystemMotion.phases`; empty without.
        fps: Frames per second of all motion.
        seam_frames: Frames per window of motion that was made window by window.
    """

    roles: tuple[str, ...]
    bones: tuple[tuple[int, int], ...]
    mean_pose: NDArray[np.floating]
    window_recordings: NDArray[np.integer]
    range_windows: NDArray[np.integer]
    phase_classes: tuple[str, ...] = ()
    fps: float = 20.0
    seam_frames: int = 100

    @cached_property
    def wrists(self) -> tuple[int, int]:
        """Indices of the left and the right wrist."""
        return self.roles.index("left_wrist"), self.roles.index("right_wrist")

    @cached_property
    def finger_bones(self) -> tuple[tuple[int, int], ...]:
        """(wrist, finger tip) indices; empty without fingers."""
        return tuple(bone for bone in self.bones if self.roles[bone[1]].endswith("_tip"))


@dataclass(frozen=True, eq=False)
class SystemMotion:
    """What one system, trained with one seed, made for the held-out speech.

    Attributes:
        name: E.g. ``"full"``; `REAL` for the recordings themselves.
        windows: ``(N, T, J, 3)`` windows, metres, the same speech in all systems.
        recordings: ``(T, J, 3)`` of each whole recording.
        phases: ``(T,)`` phase of each step of each recording, by one classifier for all systems;
            None without one.
        seed: Of the training.
        fgd: Fréchet gesture distance in the common evaluation space; None where unknown.
        fgd_interval: Its 95 % interval over recordings.
    """

    name: str
    windows: NDArray[np.floating]
    recordings: Sequence[NDArray[np.floating]]
    phases: Sequence[NDArray[np.integer]] | None = None
    seed: int | None = None
    fgd: float | None = None
    fgd_interval: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class SystemStatistics:
    """What was measured of one system, over its training seeds.

    Attributes:
        name: Of the system.
        seeds: Training seeds, in the order of the rest.
        estimates: Statistic -> mean over seeds, SI units; keys are those of `STATISTICS`. For
            `REAL`, the distances to real are between random halves of its recordings.
        by_seed: Statistic -> value of each seed.
        intervals: Statistic -> 95 % interval over recordings; None where there is none.
        velocity: ``(T - 1,)`` median wrist velocity per step, m/s, mean over seeds.
        velocity_band: ``(2, T - 1)`` 95 % interval of it; None without draws.
        ranges: ``(S, n)`` metres, range of each window by seed.
        scatter: ``(n, J, 3)`` metres, two minutes at 4 per second, of the first seed.
        phases: Phase structure over all seeds; None without a classifier.
        bones: ``(B, 2)`` mean length in metres and coefficient of variation.
    """

    name: str
    seeds: tuple[int | None, ...]
    estimates: dict[str, Estimate]
    by_seed: dict[str, tuple[Estimate, ...]]
    intervals: dict[str, tuple[float, float] | None]
    velocity: Array
    velocity_band: Array | None
    ranges: Array
    scatter: Array
    phases: PhaseStructure | None
    bones: Array


@dataclass(frozen=True)
class Statistic:
    """How a number is read.

    Attributes:
        key: Key in `SystemStatistics.estimates`.
        title: What it is called.
        unit: Unit shown.
        factor: From the SI value to the unit shown.
        meaning: How it is measured, in a sentence.
        to_real: A distance to real motion, whose interval is reflected.
    """

    key: str
    title: str
    unit: str
    factor: float
    meaning: str
    to_real: bool = False


STATISTICS: tuple[Statistic, ...] = (
    Statistic(
        "velocity",
        "wrist velocity",
        "cm/s",
        100.0,
        "|Δx| + |Δy| + |Δz| per second, mean of both wrists, median over windows at each step, mean"
        " over steps",
    ),
    Statistic(
        "velocity_area",
        "area to real's velocity curve",
        "cm",
        100.0,
        "area between the system's curve and real's over the window",
        to_real=True,
    ),
    Statistic(
        "range",
        "wrist range",
        "cm",
        100.0,
        "largest distance of a wrist from its place in the training data's mean pose, mean over"
        " windows",
    ),
    Statistic("range_ratio", "range / real", "", 1.0, "the system's mean range over real's"),
    Statistic(
        "range_spread", "spread of ranges", "cm", 100.0, "standard deviation of range over windows"
    ),
    Statistic(
        "held",
        "time held",
        "%",
        100.0,
        f"steps in which both wrists are slower than {100 * movement.HOLD_SPEED:g} cm/s",
    ),
    Statistic(
        "jitter",
        "jitter",
        "%",
        100.0,
        f"share of the wrists' velocity power above {movement.JITTER_FREQUENCY:g} Hz",
    ),
    Statistic("jerk", "wrist jerk", "m/s³", 1.0, "mean size of the third derivative of position"),
    Statistic(
        "diversity",
        "distance between windows",
        "cm",
        100.0,
        "mean over pairs of windows of the root mean square joint distance",
    ),
    Statistic(
        "variety",
        "variety of windows",
        "",
        1.0,
        "share of the pose variance that differs between windows: 0 where all repeat one motion,"
        " whatever its size",
    ),
    Statistic(
        "repeated",
        "repeated windows",
        "%",
        100.0,
        "windows with another closer than half the median nearest distance of real windows",
    ),
    Statistic(
        "bone_variation",
        "bone length variation",
        "%",
        100.0,
        "standard deviation over time by mean length, mean over bones and recordings",
    ),
    Statistic(
        "finger_distance", "finger tips to wrist", "cm", 100.0, "mean distance over finger tips"
    ),
    Statistic(
        "seam",
        "seam jump",
        "×",
        1.0,
        "median step of the joints across window borders, over the median step elsewhere",
    ),
    Statistic(
        "phase_shares",
        "phase shares, JS distance",
        "",
        1.0,
        "Jensen-Shannon distance of the phases' shares of time",
        to_real=True,
    ),
    Statistic(
        "phase_transitions",
        "phase transitions, JS distance",
        "",
        1.0,
        "Jensen-Shannon distance of which phase follows which",
        to_real=True,
    ),
    Statistic(
        "phase_durations",
        "phase durations, JS distance",
        "",
        1.0,
        "Jensen-Shannon distance of how long a phase lasts, mean over phases",
        to_real=True,
    ),
    Statistic(
        "fgd",
        "FGD",
        "",
        1.0,
        "Fréchet gesture distance over whole recordings, in the common evaluation space",
        to_real=True,
    ),
)
"""In the order of the table."""


def measure_systems(
    setting: Setting, systems: Sequence[SystemMotion], seed: int = 0, resamples: int = RESAMPLES
) -> list[SystemStatistics]:
    """Measure systems on the same windows and recordings.

    Args:
        setting: What they share.
        systems: Real motion first; several of one name are one system with several training seeds.
        seed: Of the resampling.
        resamples: Draws of recordings.

    Returns:
        One entry per name, in the order of first appearance.

    Raises:
        ValueError: The first system isn't `REAL`, or they don't have the same windows.
    """
    if not systems or systems[0].name != REAL:
        raise ValueError(f"the first system must be {REAL!r}")
    shape = systems[0].windows.shape
    for system in systems:
        if system.windows.shape != shape or len(setting.window_recordings) != shape[0]:
            raise ValueError(
                f"{system.name}: windows of shape {system.windows.shape}; real has {shape}, of"
                f" {len(setting.window_recordings)} known recordings"
            )
    ruler = _Ruler(setting, systems[0], seed, resamples)
    names = dict.fromkeys(system.name for system in systems)
    return [ruler.measure([s for s in systems if s.name == name]) for name in names]


@dataclass(eq=False)
class _Measured:
    """One system of one training seed."""

    estimates: dict[str, Estimate]
    curve: Array
    curve_draws: Array
    ranges: Array
    counts: list[PhaseCounts]
    bones: Array


@dataclass(eq=False)
class _Ruler:
    setting: Setting
    real: SystemMotion
    seed: int
    resamples: int
    windows: Resampling = field(init=False)
    reaches: Resampling = field(init=False)
    takes: Resampling = field(init=False)

    def __post_init__(self) -> None:
        setting = self.setting
        groups = np.asarray(setting.window_recordings)
        self.windows = Resampling(groups, self.resamples, self.seed)
        self.reaches = Resampling(groups[setting.range_windows], self.resamples, self.seed)
        self.takes = Resampling(np.arange(len(self.real.recordings)), self.resamples, self.seed)
        self._velocities = wrists.wrist_velocities(self.real.windows, setting.wrists, setting.fps)
        self._reference = self.windows.curves(lambda i: wrists.median_curve(self._velocities[i]))
        self._near = 0.5 * float(np.median(movement.WindowDistances(self.real.windows).nearest))
        self._counts = self._count(self.real)
        self._real_range = self._range_of(self._ranges(self.real))

    def measure(self, members: Sequence[SystemMotion]) -> SystemStatistics:
        measured = [self._measure(member) for member in members]
        keys = [s.key for s in STATISTICS if s.key in measured[0].estimates]
        by_seed = {key: tuple(m.estimates[key] for m in measured) for key in keys}
        estimates = {key: mean_estimate(values) for key, values in by_seed.items()}
        reflected = {statistic.key: statistic.to_real for statistic in STATISTICS}
        intervals = {
            key: estimate.interval(reflected=reflected[key]) for key, estimate in estimates.items()
        }
        if len(members) == 1 and "fgd" in estimates:
            intervals["fgd"] = members[0].fgd_interval
        draws = np.mean([m.curve_draws for m in measured], axis=0)
        counts = [count for m in measured for count in m.counts]
        return SystemStatistics(
            name=members[0].name,
            seeds=tuple(member.seed for member in members),
            estimates=estimates,
            by_seed=by_seed,
            intervals=intervals,
            velocity=np.mean([m.curve for m in measured], axis=0),
            velocity_band=np.quantile(draws, [0.025, 0.975], axis=0) if len(draws) else None,
            ranges=np.array([m.ranges for m in measured]),
            scatter=wrists.scattered_positions(members[0].recordings, self.setting.fps),
            phases=phase_structure(counts, self.setting.fps) if counts else None,
            bones=np.mean([m.bones for m in measured], axis=0),
        )

    def _measure(self, system: SystemMotion) -> _Measured:
        setting = self.setting
        velocities = wrists.wrist_velocities(system.windows, setting.wrists, setting.fps)
        curve, draws = self.windows.curves(lambda i: wrists.median_curve(velocities[i]))
        values = {"velocity": Estimate(float(curve.mean()), draws.mean(axis=-1))}
        ranges = self._ranges(system)
        values["range"] = self._range_of(ranges)
        values["range_ratio"] = values["range"].combined(self._real_range, np.divide)
        values["range_spread"] = self.reaches.estimate(lambda i: float(ranges[i].std()))
        values |= self._window_estimates(system)
        values |= self._recording_estimates(system)
        counts = self._count(system)
        if system is self.real:
            values |= self._floors()
        else:
            values["velocity_area"] = self._area(curve, draws)
            values |= self._phase_estimates(counts)
        if system.fgd is not None:
            values["fgd"] = Estimate(system.fgd, np.zeros(0))
        lengths = np.concatenate(
            [movement.bone_lengths(r, setting.bones) for r in system.recordings]
        ).mean(axis=0)
        variation = np.mean(
            [movement.bone_variation(r, setting.bones) for r in system.recordings], axis=0
        )
        bones = np.stack([lengths, variation], axis=-1)
        return _Measured(values, curve, draws, ranges, counts, bones)

    def _ranges(self, system: SystemMotion) -> Array:
        setting = self.setting
        chosen = system.windows[np.asarray(setting.range_windows)]
        return wrists.farthest_reaches(chosen, setting.wrists, setting.mean_pose)

    def _range_of(self, ranges: Array) -> Estimate:
        return self.reaches.mean(ranges)

    def _area(self, curve: Array, draws: Array) -> Estimate:
        fps = self.setting.fps
        reference, reference_draws = self._reference
        areas = [
            wrists.area_between(own, real, fps)
            for own, real in zip(draws, reference_draws, strict=True)
        ]
        return Estimate(wrists.area_between(curve, reference, fps), np.array(areas))

    def _window_estimates(self, system: SystemMotion) -> dict[str, Estimate]:
        windows, wrist_joints, fps = system.windows, self.setting.wrists, self.setting.fps
        power = movement.velocity_power(windows, wrist_joints, fps)
        distances = movement.WindowDistances(windows)
        return {
            "held": self.windows.mean(movement.held_share(windows, wrist_joints, fps)),
            "jitter": self.windows.estimate(lambda i: _share_of(*power[i].sum(axis=0))),
            "jerk": self.windows.mean(movement.mean_jerk(windows, wrist_joints, fps)),
            "diversity": self.windows.estimate(distances.mean),
            "variety": self.windows.estimate(distances.variety),
            "repeated": self.windows.mean(distances.nearest <= self._near),
        }

    def _recording_estimates(self, system: SystemMotion) -> dict[str, Estimate]:
        setting = self.setting
        variation = [movement.bone_variation(r, setting.bones) for r in system.recordings]
        found = {"bone_variation": self.takes.mean(np.mean(variation, axis=1))}
        if setting.finger_bones:
            fingers = [
                movement.bone_lengths(r, setting.finger_bones).mean() for r in system.recordings
            ]
            found["finger_distance"] = self.takes.mean(fingers)
        steps = [movement.border_steps(r, setting.seam_frames) for r in system.recordings]
        if any(len(at_border) for at_border, _ in steps):
            found["seam"] = self.takes.estimate(lambda i: _seam([steps[k] for k in i]))
        return found

    def _count(self, system: SystemMotion) -> list[PhaseCounts]:
        classes = len(self.setting.phase_classes)
        return [count_phases(p, classes, self.setting.fps) for p in system.phases or ()]

    def _phase_estimates(self, counts: list[PhaseCounts]) -> dict[str, Estimate]:
        if not counts or not self._counts:
            return {}
        return {
            key: self.takes.estimate(
                lambda i, key=key: self._phase_distance(key, [counts[k] for k in i], i)
            )
            for key in _PHASE_DISTANCES
        }

    def _phase_distance(
        self, key: str, counts: Sequence[PhaseCounts], real: NDArray[np.int64]
    ) -> float:
        fps = self.setting.fps
        reference = phase_structure([self._counts[i] for i in real], fps)
        return _PHASE_DISTANCES[key](phase_structure(counts, fps), reference)

    def _floors(self) -> dict[str, Estimate]:
        """Distances between random halves of the real recordings."""
        rng = np.random.default_rng(self.seed)
        groups = np.asarray(self.setting.window_recordings)
        labels = np.unique(groups)
        found: dict[str, list[float]] = {}
        for _ in range(_HALVES):
            if len(labels) > 1:
                half = np.isin(groups, rng.permutation(labels)[: len(labels) // 2])
                curves = [wrists.median_curve(self._velocities[part]) for part in (half, ~half)]
                area = wrists.area_between(*curves, self.setting.fps)
                found.setdefault("velocity_area", []).append(area)
            order = rng.permutation(len(self._counts))
            if len(order) > 1:
                first, second = order[: len(order) // 2], order[len(order) // 2 :]
                for key in _PHASE_DISTANCES:
                    distance = self._phase_distance(key, [self._counts[i] for i in first], second)
                    found.setdefault(key, []).append(distance)
        return {
            key: Estimate(float(np.mean(values)), np.zeros(0)) for key, values in found.items()
        }


def _share_of(part: float, whole: float) -> float:
    return float(part / whole) if whole > 0 else float("nan")


def _seam(steps: Sequence[tuple[Array, Array]]) -> float:
    at_border, inside = (np.concatenate(parts) for parts in zip(*steps, strict=True))
    if not len(at_border) or not len(inside):
        return float("nan")
    return _share_of(float(np.median(at_border)), float(np.median(inside)))


_PHASE_DISTANCES: dict[str, Callable[[PhaseStructure, PhaseStructure], float]] = {
    "phase_shares": lambda own, real: phase_distances(own, real).shares,
    "phase_transitions": lambda own, real: phase_distances(own, real).transitions,
    "phase_durations": lambda own, real: float(phase_distances(own, real).durations.mean()),
}
