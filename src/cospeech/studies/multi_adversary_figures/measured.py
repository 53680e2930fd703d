"""Several systems on the same speech, real motion first: their motion, and what it measures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cospeech.metrics.phase_structure import PhaseStructure
from cospeech.metrics.resampling import Array, Estimate

FPS = 20.0
FRAMES = 100
"""Of a window, 5 s."""

REAL = "real"
"""Name of the system that is the recordings themselves."""


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
    """

    roles: tuple[str, ...]
    bones: tuple[tuple[int, int], ...]
    mean_pose: NDArray[np.floating]
    window_recordings: NDArray[np.integer]
    range_windows: NDArray[np.integer]
    phase_classes: tuple[str, ...] = ()

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
        side_by_side: The same recordings as windows put one after another, without anything that
            joins them; windows as long as those of ``windows``.
        border_frames: Frames from the start of one window to the next in ``recordings``.
        phases: ``(T,)`` phase of each step of each recording, by one classifier for all systems;
            None without one.
        seed: Of the training.
        fgd: Fréchet gesture distance in the common evaluation space; None where unknown.
        fgd_interval: Its 95 % interval over recordings.
    """

    name: str
    windows: NDArray[np.floating]
    recordings: Sequence[NDArray[np.floating]]
    side_by_side: Sequence[NDArray[np.floating]]
    border_frames: int = FRAMES
    phases: Sequence[NDArray[np.integer]] | None = None
    seed: int | None = None
    fgd: float | None = None
    fgd_interval: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Number:
    """A statistic of a system, SI units.

    Attributes:
        mean: Over training seeds.
        by_seed: Seed -> its value.
        interval: 95 % over recordings, of the mean; None where there is none.
    """

    mean: Estimate
    by_seed: dict[int | None, float]
    interval: tuple[float, float] | None

    @property
    def value(self) -> float:
        """Of the mean."""
        return self.mean.value


@dataclass(frozen=True, eq=False)
class SystemStatistics:
    """What was measured of one system, over its training seeds.

    Attributes:
        name: Of the system.
        seeds: Training seeds, in the order of the rest.
        numbers: By the key of a `Statistic`. For `REAL`, the distances to real are between random
            halves of its recordings.
        velocity: ``(T - 1,)`` median wrist velocity per step, m/s, mean over seeds.
        velocity_band: ``(2, T - 1)`` 95 % interval of it; None without draws.
        ranges: ``(S, n)`` metres, range of each window by seed.
        scatter: ``(n, J, 3)`` metres, two minutes at 4 per second, of the first seed.
        phases: Phase structure over all seeds; None without a classifier.
        bones: ``(B, 2)`` mean length in metres and coefficient of variation.
    """

    name: str
    seeds: tuple[int | None, ...]
    numbers: dict[str, Number]
    velocity: Array
    velocity_band: Array | None
    ranges: Array
    scatter: Array
    phases: PhaseStructure | None
    bones: Array
