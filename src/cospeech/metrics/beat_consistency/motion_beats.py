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

_ARRIVAL_S = 0.02


@dataclass(frozen=True)
class MotionBeats:
    """Finds the moments in which the wrists come to a stop or turn.

    The speed of both hands is ``v = sqrt(mean over joints of |velocity|^2)``, of steps from frame
    to frame (at ``(i + 1/2) / fps``), smoothed by a Gaussian *as vectors*: jitter cancels before it
    can look like speed, and a hand that turns still passes through 0. A beat is a local minimum of
    ``max(v, rest_speed)`` with a prominence of at least ``prominence``: on both sides, the hands
    get that much faster before they get slower than they were in the minimum.

    A dip is placed by the parabola through ``v^2`` of the lowest step and its neighbours, which is
    exact for a hand that turns under a constant acceleration: at 15 fps, turns are found to a few
    milliseconds where the frame alone would be up to 33 ms off. Where hands stay under
    ``rest_speed`` for more than a step, the beat is 20 ms after they got there, or in the middle of
    the rest if that is sooner: a stroke that ends in a hold is one beat, at the hold's beginning,
    and leaving the hold is none. Hands that rest from the start have no beat there, since nobody
    saw them arrive.

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

    def speed(self, motion: Motion) -> tuple[Times, Times]:
        """The speed that beats are looked for in.

        Args:
            motion: Any skeleton with `joints`, relative to the body, metres.

        Returns:
            Times ``(T - 1,)`` of the steps, seconds, and speeds ``(T - 1,)``, metres per second.

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
        times = (np.arange(len(velocities)) + 0.5) / motion.fps
        speed = np.sqrt(np.square(velocities).sum(-1).mean(-1))
        return np.asarray(times, np.float64), np.asarray(speed, np.float64)

    def __call__(self, motion: Motion) -> Times:
        """Beats of a motion; arguments and errors as for `speed`."""
        times, speed = self.speed(motion)
        if len(speed) < 3:
            return np.zeros(0)
        floored = np.maximum(speed, self.rest_speed)
        # A rest that lasts to the end is a beat too, so something has to follow it.
        closed = np.append(floored, floored.max())
        _, found = find_peaks(-closed, prominence=self.prominence, plateau_size=1)
        beats = []
        for first, last in zip(found["left_edges"], found["right_edges"], strict=True):
            if last + 1 < len(speed) and first == last:
                beats.append(_vertex(times, np.square(speed), int(first)))
            elif speed[first] <= self.rest_speed:
                beats.append(_arrival(times, speed, int(first), int(last), self.rest_speed))
        return np.array(beats, dtype=np.float64)


def _arrival(times: Times, speed: Times, first: int, last: int, level: float) -> float:
    """When hands came to rest that are no faster than ``level`` from step first to step last."""
    begins = float(np.interp(level, speed[[first, first - 1]], times[[first, first - 1]]))
    ends = float(times[last])
    if last + 1 < len(speed):
        ends = float(np.interp(level, speed[[last, last + 1]], times[[last, last + 1]]))
    return begins + min(_ARRIVAL_S, (ends - begins) / 2)


def _vertex(times: Times, squares: Times, step: int) -> float:
    """The lowest point of the parabola through a local minimum and its neighbours."""
    before, here, after = squares[step - 1 : step + 2]
    curvature = before - 2 * here + after
    offset = 0.5 * (before - after) / curvature if curvature > 0 else 0.0
    return float(times[step] + offset * (times[1] - times[0]))
