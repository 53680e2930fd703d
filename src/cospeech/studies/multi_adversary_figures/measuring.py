"""Measuring systems side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.metrics import movement
from cospeech.metrics.phase_structure import (
    PhaseCounts,
    PhaseDistances,
    count_phases,
    phase_distances,
    phase_structure,
)
from cospeech.metrics.resampling import Array, Estimate, Resampling, combined
from cospeech.studies.multi_adversary_figures.measured import (
    FPS,
    REAL,
    Number,
    Setting,
    SystemMotion,
    SystemStatistics,
)
from cospeech.studies.multi_adversary_figures.paper import STATISTICS

RESAMPLES = 400
_HALVES = 20
_SCATTERED_S, _SCATTERED_PER_S = 120.0, 4.0
_PHASE_DISTANCES = ("phase_shares", "phase_transitions", "phase_durations")


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
    """One system of one training seed; the curve on all windows, and then on every draw."""

    estimates: dict[str, Estimate]
    curve: Array
    ranges: Array
    counts: list[PhaseCounts]
    bones: Array


class _Ruler:
    """Measures one system after another against the same real motion, on the same draws."""

    def __init__(self, setting: Setting, real: SystemMotion, seed: int, resamples: int) -> None:
        self.setting = setting
        groups = np.asarray(setting.window_recordings)
        self.windows = Resampling(groups, resamples, seed)
        self.reaches = Resampling(groups[setting.range_windows], resamples, seed)
        self.takes = Resampling(np.arange(len(real.recordings)), resamples, seed)
        self._near = 0.5 * float(np.median(movement.WindowDistances(real.windows).nearest))
        self.real = self._alone(real)
        self.real.estimates.update(self._floors(real, seed))

    def measure(self, members: Sequence[SystemMotion]) -> SystemStatistics:
        """One system from its motion by every training seed."""
        if members[0].name == REAL:
            measured = [self.real]
        else:
            measured = [self._alone(member) for member in members]
            for one in measured:
                one.estimates.update(self._against_real(one))
        seeds = tuple(member.seed for member in members)
        numbers = {}
        for key, statistic in STATISTICS.items():
            if key in measured[0].estimates:
                each = [one.estimates[key] for one in measured]
                mean = combined(lambda *values: np.mean(values, axis=0), *each)
                interval = mean.interval(reflected=statistic.to_real)
                if key == "fgd" and len(members) == 1:
                    interval = members[0].fgd_interval
                by_seed = dict(zip(seeds, (one.value for one in each), strict=True))
                numbers[key] = Number(mean, by_seed, interval)
        curve, *draws = np.mean([one.curve for one in measured], axis=0)
        counts = [count for one in measured for count in one.counts]
        return SystemStatistics(
            name=members[0].name,
            seeds=seeds,
            numbers=numbers,
            velocity=curve,
            velocity_band=np.quantile(draws, [0.025, 0.975], axis=0) if draws else None,
            ranges=np.array([one.ranges for one in measured]),
            scatter=scattered_positions(members[0].recordings),
            phases=phase_structure(counts, FPS) if counts else None,
            bones=np.mean([one.bones for one in measured], axis=0),
        )

    def _alone(self, system: SystemMotion) -> _Measured:
        """What can be said of a system without another."""
        setting, windows, wrists = self.setting, system.windows, self.setting.wrists
        velocities = movement.wrist_velocities(windows, wrists, FPS)
        curve = self.windows.rows(lambda i: movement.median_curve(velocities[i]))
        far = windows[np.asarray(setting.range_windows)]
        ranges = movement.farthest_reaches(far, wrists, setting.mean_pose)
        power = movement.velocity_power(windows, wrists, FPS)
        distances = movement.WindowDistances(windows)
        variation = [movement.bone_variation(r, setting.bones) for r in system.recordings]
        lengths = [movement.bone_lengths(r, setting.bones) for r in system.recordings]
        estimates = {
            "velocity": Estimate.of(curve.mean(axis=-1)),
            "range": self.reaches.mean(ranges),
            "range_spread": self.reaches.estimate(lambda i: float(ranges[i].std())),
            "held": self.windows.mean(movement.held_share(windows, wrists, FPS)),
            "jitter": self.windows.estimate(lambda i: _share_of(*power[i].sum(axis=0))),
            "jerk": self.windows.mean(movement.mean_jerk(windows, wrists, FPS)),
            "diversity": self.windows.estimate(distances.mean),
            "variety": self.windows.estimate(distances.variety),
            "repeated": self.windows.mean(distances.nearest <= self._near),
            "bone_variation": self.takes.mean(np.mean(variation, axis=1)),
            **self._jumps(system),
        }
        if setting.finger_bones:
            fingers = [movement.bone_lengths(r, setting.finger_bones) for r in system.recordings]
            estimates["finger_distance"] = self.takes.mean([each.mean() for each in fingers])
        if system.fgd is not None:
            estimates["fgd"] = Estimate(system.fgd, np.zeros(0))
        classes = len(setting.phase_classes)
        counts = [count_phases(labels, classes, FPS) for labels in system.phases or ()]
        bones = np.stack([np.concatenate(lengths).mean(axis=0), np.mean(variation, axis=0)], -1)
        return _Measured(estimates, curve, ranges, counts, bones)

    def _jumps(self, system: SystemMotion) -> dict[str, Estimate]:
        found = {}
        joined = [movement.border_steps(r, system.border_frames) for r in system.recordings]
        if any(len(at_border) for at_border, _ in joined):
            found["seam"] = self.takes.estimate(lambda i: movement.seam_jump(joined[k] for k in i))
        length = system.windows.shape[1]
        apart = [movement.border_steps(r, length) for r in system.side_by_side]
        if any(len(at_border) for at_border, _ in apart):
            sizes = [at_border for at_border, _ in apart]
            found["window_jump"] = self.takes.estimate(
                lambda i: movement.seam_jump(apart[k] for k in i)
            )
            found["window_jump_size"] = self.takes.estimate(
                lambda i: _median(np.concatenate([sizes[k] for k in i]))
            )
        return found

    def _against_real(self, own: _Measured) -> dict[str, Estimate]:
        """A system's distances to real motion."""
        ranges = own.estimates["range"], self.real.estimates["range"]
        areas = [
            movement.area_between(curve, real, FPS)
            for curve, real in zip(own.curve, self.real.curve, strict=True)
        ]
        found = {
            "velocity_area": Estimate.of(np.array(areas)),
            "range_ratio": combined(np.divide, *ranges),
            "range_gap": combined(lambda size, real: np.abs(size - real), *ranges),
        }
        if own.counts and self.real.counts:
            rows = self.takes.rows(lambda i: self._phase_distances(own.counts, i, i))
            found.update(zip(_PHASE_DISTANCES, map(Estimate.of, rows.T), strict=True))
        return found

    def _phase_distances(
        self, counts: Sequence[PhaseCounts], own: NDArray[np.int64], real: NDArray[np.int64]
    ) -> PhaseDistances:
        """How far the phases of chosen recordings are from those of chosen real ones."""
        reference = phase_structure([self.real.counts[i] for i in real], FPS)
        return phase_distances(phase_structure([counts[i] for i in own], FPS), reference)

    def _floors(self, real: SystemMotion, seed: int) -> dict[str, Estimate]:
        """Distances between random halves of the real recordings."""
        rng = np.random.default_rng(seed)
        velocities = movement.wrist_velocities(real.windows, self.setting.wrists, FPS)
        groups = np.asarray(self.setting.window_recordings)
        labels = np.unique(groups)
        areas, distances = [], []
        for _ in range(_HALVES):
            if len(labels) > 1:
                half = np.isin(groups, rng.permutation(labels)[: len(labels) // 2])
                one, other = (movement.median_curve(velocities[part]) for part in (half, ~half))
                areas.append(movement.area_between(one, other, FPS))
            order = rng.permutation(len(self.real.counts))
            if len(order) > 1:
                halves = order[: len(order) // 2], order[len(order) // 2 :]
                distances.append(self._phase_distances(self.real.counts, *halves))
        found = {"velocity_area": np.mean(areas)} if areas else {}
        if distances:
            found.update(zip(_PHASE_DISTANCES, np.mean(distances, axis=0), strict=True))
        return {key: Estimate(float(value), np.zeros(0)) for key, value in found.items()}


def scattered_positions(recordings: Sequence[NDArray[np.floating]]) -> Array:
    """Positions of the first two minutes, four per second (figure 1).

    Recordings follow one another until the time is full; each is sampled from its own start.

    Args:
        recordings: ``(T, J, 3)`` each, metres; at least one.

    Returns:
        ``(n, J, 3)``, n at most 480.
    """
    step = round(FPS / _SCATTERED_PER_S)
    together = np.concatenate([recording[::step] for recording in recordings], dtype=np.float64)
    return together[: round(_SCATTERED_S * _SCATTERED_PER_S)]


def _share_of(part: float, whole: float) -> float:
    return float(part / whole) if whole > 0 else float("nan")


def _median(values: Array) -> float:
    return float(np.median(values)) if len(values) else float("nan")
