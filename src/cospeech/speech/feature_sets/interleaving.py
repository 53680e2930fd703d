"""Five sets at 20 fps from one at 100 fps (Ferstl et al. 2020; spec B.2 and D row 3)."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

PHASES = 5
"""Interleaved sets; set r holds frames r, r + 5, r + 10 ..."""

Value = TypeVar("Value", bound=np.generic)


def interleave(frames_100fps: NDArray[Value], phase: int) -> NDArray[Value]:
    """Every fifth frame from frame ``phase`` on: frame j shows ``(phase + 5 j) / 100`` s.

    Frames are picked, not averaged, so speech and motion at 100 fps that were aligned stay so, and
    the five sets together are the original.

    Args:
        frames_100fps: ``(T, ...)`` features, positions or labels at 100 fps.
        phase: Which of the five sets, from 0.

    Returns:
        ``(ceil((T - phase) / 5), ...)`` at 20 fps, a view.

    Raises:
        ValueError: There is no such set.
    """
    if not 0 <= phase < PHASES:
        raise ValueError(f"there are sets 0 to {PHASES - 1}, not {phase}")
    return frames_100fps[phase::PHASES]
