"""Sequences at a low rate that together use every frame of a motion at a high one."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cospeech.motion.motion import resample_positions


def at_a_multiple(
    positions: NDArray[np.float32], fps: float, sequence_fps: float
) -> tuple[NDArray[np.float32], int]:
    """Positions at the next multiple of a rate: 60 fps gives three sequences of 20 fps.

    Sequence i is every n-th frame from frame i on (Ferstl et al. 2020, section 3.1, where 100 fps
    give five). A motion that is at a multiple already is left as it is.

    Args:
        positions: ``(T, J, 3)``.
        fps: Their rate.
        sequence_fps: Rate of the sequences.

    Returns:
        Positions at ``n * sequence_fps``, and n.
    """
    count = math.ceil(fps / sequence_fps - 1e-6)
    if not math.isclose(count * sequence_fps, fps, rel_tol=1e-6):
        positions = resample_positions(positions, fps, count * sequence_fps)
    return positions, count
