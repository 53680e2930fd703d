"""When hands stop or turn: the beats of a motion, in seconds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks

from cospeech.motion.motion import Motion

Times = NDArray[np.float64]
"""``(n,)`` moments in seconds, ascending."""


@dataclass(frozen=True)
class MotionBeats:
    """Finds the moments in which the wrists come to a stop or turn.

    The speed of both hands is ``v = sqrt(mean over joints of |velocity|^2)``, of steps from frame
    to frame (at ``(i + 1/2) / fps``), smoothed by a Gaussian *as vectors*: jitter cancels before it
    can look like speed, and a hand that turns still passes through 0. A beat is a local minimum of
    ``max(v, rest_speed)`` with a prominence of at least ``prominence``: on both sides, the hands
    get that much faster before they get slower than they were in the minimum.

    Where hands stay under ``rest_speed``, the beat is the moment in which they got there: a stroke
    that ends in a hold is one beat, at the hold's beginning, and leaving the hold is none. Hands
    that rest from the start have no beat there, since nobody saw them arrive. A dip that stays
    above is placed by the parabola through ``v^2`` of the lowest step and its neighbours, which is
    exact for a hand that turns under a constant acceleration: at 15 fps, turns are found to a few
    milliseconds where the frame alone would be 33 ms off.

    Time and speed are in seconds and metres, so the frame rate changes only how much is seen.

    Attributes:
        joints: Names of the joints whose speed it is.
        smoothing_s: Standard deviation of the Gaussian, seconds. 0 for none.
        prominence: Metres per second.
        rest_speed: Metres per second under which hands are at rest.
    """

    joints: tuple[str, ...] = ("left_wrist", "right_wrist")
    smoothing_s: float = 0.05
    prominence: float = 0.1
    rest_speed: float = 0.05

    def speed(self, motion: Motion) -> tuple[Times, NDArray[np.float64]]:
        """The speed that beats are looked for in.

        Args:
            motion: Any skeleton with `joints`, relative to the body, metres.

        Returns:
            Times ``(T - 1,)`` in seconds and speeds ``(T - 1,)`` in metres per second.

        Raises:
            ValueError: A joint is missing, or a coordinate is NaN or infinite.
        """
        missing = [joint for joint in self.joints if joint not in motion.skeleton.joints]
        if missing:
            raise ValueError(
                f"beats of {', '.join(missing)}: skeleton {motion.skeleton.name} has no such joint"
            )
        chosen = [motion.skeleton.index[joint] for joint in self.joints]
        positions = motion.positions[:, chosen].astype(np.float64)
        if not np.isfinite(positions).all():
            raise ValueError("beats of a motion with NaN or infinite coordinates")
        velocities = np.diff(positions, axis=0) * motion.fps
        if self.smoothing_s > 0 and len(velocities):
            velocities = gaussian_filter1d(
                velocities, self.smoothing_s * motion.fps, axis=0, mode="nearest"
            )
        times: Times = (np.arange(len(velocities)) + 0.5) / motion.fps
        speed: Times = np.sqrt(np.square(velocities).sum(-1).mean(-1))
        return times, speed

    def __call__(self, motion: Motion) -> Times:
        """Beats of a motion; arguments and errors as for `speed`."""
        times, speed = self.speed(motion)
        if len(speed) < 3:
            return np.zeros(0)
        floored = np.maximum(speed, self.rest_speed)
        # A rest that lasts to the end is a beat too, so something has to follow it.
        closed = np.append(floored, floored.max())
        _, found = find_peaks(-closed, prominence=self.prominence, plateau_size=1)
        beats = [
            _crossing(times, speed, first, self.rest_speed)
            if speed[first] <= self.rest_speed
            else _vertex(times, np.square(speed), first)
            for first in found["left_edges"].tolist()
            if first < len(speed) - 1 or speed[first] <= self.rest_speed
        ]
        return np.array(beats, dtype=np.float64)


def _crossing(times: Times, speed: NDArray[np.float64], step: int, level: float) -> float:
    """When the speed got down to ``level``, between ``step`` and the step before it."""
    before, after = speed[step - 1], speed[step]
    share = (before - level) / (before - after)
    return float(times[step - 1] + share * (times[step] - times[step - 1]))


def _vertex(times: Times, squares: NDArray[np.float64], step: int) -> float:
    """The lowest point of the parabola through a local minimum and its neighbours."""
    before, here, after = squares[step - 1 : step + 2]
    curvature = before - 2 * here + after
    offset = 0.5 * (before - after) / curvature if curvature > 0 else 0.0
    return float(times[step] + offset * (times[1] - times[0]))
