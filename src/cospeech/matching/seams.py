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
    if seam == "crossfade":
        return _crossfaded(matched, database, step)
    if seam == "inertialise":
        return _inertialised(matched.poses, step, database.spec.fps)
    return matched.poses


def _crossfaded(matched: Matched, database: MatchingDatabase, step: int) -> NDArray[np.float32]:
    poses = matched.poses.copy()
    count = min(CROSSFADE_FRAMES, step)
    places = np.arange(1, count + 1) / (count + 1)
    shares = (places * places * (3 - 2 * places)).astype(np.float32)[:, None, None]
    last = database.poses.shape[1] - 1
    windows = zip(matched.sequences, matched.frames, strict=True)
    for number, (sequence, frame) in enumerate(windows, start=1):
        first = number * step
        there = poses[first : first + count]
        # A sequence that ends stays in its last pose.
        rows = np.minimum(frame + step + np.arange(len(there)), last)
        before = database.poses[sequence, rows]
        poses[first : first + count] = before + shares[: len(there)] * (there - before)
    return poses


def _inertialised(poses: NDArray[np.float32], step: int, fps: float) -> NDArray[np.float32]:
    """A critically damped spring on the offset from what was put out before each seam."""
    smooth = poses.astype(np.float64)
    stiffness = _HALVED / HALF_LIFE_S
    times_s = (np.arange(step) / fps)[:, None, None]
    decay = np.exp(-stiffness * times_s)
    for first in range(step, len(poses), step):
        window = poses[first : first + step].astype(np.float64)
        velocity = (smooth[first - 1] - smooth[first - 2]) * fps if step > 1 else 0.0
        expected = smooth[first - 1] + velocity / fps
        offset = expected - window[0]
        own = (window[1] - window[0]) * fps if len(window) > 1 else velocity
        slope = velocity - own + stiffness * offset
        smooth[first : first + step] = window + ((offset + slope * times_s) * decay)[: len(window)]
    return smooth.astype(np.float32)
