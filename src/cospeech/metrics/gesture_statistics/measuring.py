"""Measuring systems side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cospeech.metrics.gesture_statistics import movement, wrists
from cospeech.metrics.gesture_statistics.catalogue import STATISTICS
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
from cospeech.metrics.gesture_statistics.systems import (
    REAL,
    Setting,
    SystemMotion,
    SystemStatistics,
)

RESAMPLES = 400
_HALVES = 20


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


class _Ruler:
    """Measures one system after another against the same real motion, on the same draws."""

    def __init__(self, setting: Setting, real: SystemMotion, seed: int, resamples: int) -> None:
        self.setting, self.real, self.seed = setting, real, seed
        groups = np.asarray(setting.window_recordings)
        self.windows = Resampling(groups, resamples, seed)
        self.reaches = Resampling(groups[setting.range_windows], resamples, seed)
        self.takes = Resampling(np.arange(len(real.recordings)), resamples, seed)
        self._velocities = wrists.wrist_velocities(real.windows, setting.wrists, setting.fps)
        self._reference = self.windows.curves(lambda i: wrists.median_curve(self._velocities[i]))
        self._near = 0.5 * float(np.median(movement.WindowDistances(real.windows).nearest))
        self._counts = self._count(real)
        self._real_range = self.reaches.mean(self._ranges(real))

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
        values["range"] = self.reaches.mean(ranges)
        if system is not self.real:
            values["range_ratio"] = values["range"].combined(self._real_range, np.divide)
            values["range_gap"] = values["range"].combined(self._real_range, _distance)
        values["range_spread"] = self.reaches.estimate(lambda i: float(ranges[i].std()))
        values |= self._window_estimates(system)
        variation = [movement.bone_variation(r, setting.bones) for r in system.recordings]
        values["bone_variation"] = self.takes.mean(np.mean(variation, axis=1))
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
        bones = np.stack([lengths, np.mean(variation, axis=0)], axis=-1)
        return _Measured(values, curve, draws, ranges, counts, bones)

    def _ranges(self, system: SystemMotion) -> Array:
        setting = self.setting
        chosen = system.windows[np.asarray(setting.range_windows)]
        return wrists.farthest_reaches(chosen, setting.wrists, setting.mean_pose)

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
        setting, found = self.setting, dict[str, Estimate]()
        if setting.finger_bones:
            fingers = [
                movement.bone_lengths(r, setting.finger_bones).mean() for r in system.recordings
            ]
            found["finger_distance"] = self.takes.mean(fingers)
        found |= self._seam("seam", system.recordings, system.border_frames)
        if system.side_by_side is not None:
            window = system.windows.shape[1]
            found |= self._seam("window_jump", system.side_by_side, window)
            found |= self._seam("window_jump_size", system.side_by_side, window, _border_step)
        return found

    def _seam(
        self,
        key: str,
        recordings: Sequence[NDArray[np.floating]],
        window: int,
        measure: Callable[[Sequence[tuple[Array, Array]]], float] | None = None,
    ) -> dict[str, Estimate]:
        steps = [movement.border_steps(recording, window) for recording in recordings]
        if not any(len(at_border) for at_border, _ in steps):
            return {}
        measure = measure or _seam_jump
        return {key: self.takes.estimate(lambda i: measure([steps[k] for k in i]))}

    def _count(self, system: SystemMotion) -> list[PhaseCounts]:
        classes = len(self.setting.phase_classes)
        return [count_phases(p, classes, self.setting.fps) for p in system.phases or ()]

    def _phase_estimates(self, counts: list[PhaseCounts]) -> dict[str, Estimate]:
        if not counts or not self._counts:
            return {}

        def estimate(key: str) -> Estimate:
            return self.takes.estimate(
                lambda i: self._phase_distance(key, [counts[k] for k in i], i)
            )

        return {key: estimate(key) for key in _PHASE_DISTANCES}

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
                first, second = (
                    wrists.median_curve(self._velocities[part]) for part in (half, ~half)
                )
                area = wrists.area_between(first, second, self.setting.fps)
                found.setdefault("velocity_area", []).append(area)
            order = rng.permutation(len(self._counts))
            if len(order) > 1:
                one, other = order[: len(order) // 2], order[len(order) // 2 :]
                for key in _PHASE_DISTANCES:
                    distance = self._phase_distance(key, [self._counts[i] for i in one], other)
                    found.setdefault(key, []).append(distance)
        return {key: Estimate(float(np.mean(values)), np.zeros(0)) for key, values in found.items()}


def _distance(first: ArrayLike, second: ArrayLike) -> Array:
    return np.abs(np.asarray(first, dtype=np.float64) - np.asarray(second, dtype=np.float64))


def _share_of(part: float, whole: float) -> float:
    return float(part / whole) if whole > 0 else float("nan")


def _border_step(steps: Sequence[tuple[Array, Array]]) -> float:
    at_border = np.concatenate([border for border, _ in steps])
    return float(np.median(at_border)) if len(at_border) else float("nan")


def _seam_jump(steps: Sequence[tuple[Array, Array]]) -> float:
    at_border, inside = (np.concatenate(parts) for parts in zip(*steps, strict=True))
    if not len(at_border) or not len(inside):
        return float("nan")
    return _share_of(float(np.median(at_border)), float(np.median(inside)))


_PHASE_DISTANCES: dict[str, Callable[[PhaseStructure, PhaseStructure], float]] = {
    "phase_shares": lambda own, real: phase_distances(own, real).shares,
    "phase_transitions": lambda own, real: phase_distances(own, real).transitions,
    "phase_durations": lambda own, real: float(phase_distances(own, real).durations.mean()),
}
