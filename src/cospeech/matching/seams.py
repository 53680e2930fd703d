"""Smoothing where one window of the database ends and the next begins (none is published)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cospeech.matching.database import MatchingDatabase
from cospeech.matching.matching import Matched

Seam = Literal["cut", "crossfade", "inertialise"]
"""``"cut"``: windows side by side, as published. ``"crossfade"``: a window goes on in the database
for a few frames while the next one fades in. ``"inertialise"``: the next window begins where the
one before was, at its velocity, and the difference dies away like a damped spring."""

CROSSFADE_FRAMES = 4
"""Half a published step: 0.27 s."""

HALF_LIFE_S = 0.1
"""In which half of a difference has died away."""

LEAST_INERTIAL_STEP = 4
"""Frames of a window below which differences would add up from seam to seam."""

_HALVED = 1.678346990016661
"""Where (1 + x) exp(-x), a critically damped spring let go, is 1/2."""


def blended(
    matched: Matched, database: MatchingDatabase, step: int, seam: Seam
) -> NDArray[np.float32]:
    """Poses ``(F, J, 3)`` of what was matched, with its seams smoothed.

    Args:
        matched: From a search of ``database``.
        database: Where windows go on.
        step: Frames of a window.
        seam: How.
    """
    if seam == "cut" or not len(matched.poses):
        return matched.poses
    smoothed = SmoothedSeams(database, step, seam)
    windows = [
        smoothed(matched.poses[number * step : (number + 1) * step], int(sequence), int(frame))
        for number, (sequence, frame) in enumerate(
            zip(matched.sequences, matched.frames, strict=True)
        )
    ]
    return np.concatenate(windows)


class SmoothedSeams:
    """Windows one after the other, each joined to the one before.

    Args:
        database: Where windows go on.
        step: Frames of a window, of which the last may have fewer.
        seam: How.
    """

    def __init__(self, database: MatchingDatabase, step: int, seam: Seam) -> None:
        self._database, self._step, self._seam = database, step, seam
        self._from: tuple[int, int] | None = None
        self._before: NDArray[np.float64] | None = None

    def __call__(
        self, window: NDArray[np.float32], sequence: int, frame: int
    ) -> NDArray[np.float32]:
        """The next window ``(F, J, 3)``, smoothed.

        Args:
            window: Its poses.
            sequence: Where it comes from.
            frame: Its first frame there.
        """
        if self._seam == "crossfade":
            before, self._from = self._from, (sequence, frame)
            return window if before is None else self._crossfaded(window, *before)
        if self._seam == "inertialise":
            return self._inertialised(window)
        return window

    def _crossfaded(
        self, window: NDArray[np.float32], sequence: int, frame: int
    ) -> NDArray[np.float32]:
        count = min(CROSSFADE_FRAMES, self._step)
        places = np.arange(1, count + 1) / (count + 1)
        shares = (places * places * (3 - 2 * places)).astype(np.float32)[:, None, None]
        there = window[:count]
        # A sequence that ends stays in its last pose.
        last = self._database.poses.shape[1] - 1
        rows = np.minimum(frame + self._step + np.arange(len(there)), last)
        before = self._database.poses[sequence, rows]
        faded = before + shares[: len(there)] * (there - before)
        return np.concatenate([faded, window[count:]])

    def _inertialised(self, poses: NDArray[np.float32]) -> NDArray[np.float32]:
        """A critically damped spring on the offset from what was put out before the seam."""
        window, before = poses.astype(np.float64), self._before
        if before is not None:
            fps, stiffness = self._database.spec.fps, _HALVED / HALF_LIFE_S
            times_s = (np.arange(self._step) / fps)[:, None, None]
            decay = np.exp(-stiffness * times_s)
            velocity = (before[-1] - before[-2]) * fps if self._step > 1 else 0.0
            offset = before[-1] + velocity / fps - window[0]
            own = (window[1] - window[0]) * fps if len(window) > 1 else velocity
            slope = velocity - own + stiffness * offset
            window = window + ((offset + slope * times_s) * decay)[: len(window)]
        self._before = window
        return window.astype(np.float32)
