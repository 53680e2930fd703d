"""The upper body at the evaluation rate over the time of each window, and the way to that rate."""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from cospeech.corpus.features.field import Gather, Places, WindowField
from cospeech.corpus.store import Store
from cospeech.motion.upper_body import EVALUATION_FPS


def evaluation_frames(frames: int, fps: float) -> int:
    """Frames at the evaluation rate that so many frames at another rate cover."""
    return math.floor((frames - 1) / fps * EVALUATION_FPS + 1e-6) + 1


def at_evaluation_rate(positions: Tensor, fps: float) -> Tensor:
    """Windows of a method's own rate as the field ``positions`` has them, by linear interpolation.

    Args:
        positions: ``(B, T, J, 3)`` at ``fps``.
        fps: Their rate.

    Returns:
        ``(B, E, J, 3)`` with `evaluation_frames` E; frame j shows time ``j / 15``.
    """
    last = positions.shape[1] - 1
    frames = torch.arange(evaluation_frames(last + 1, fps), device=positions.device)
    places = (frames.double() * fps / EVALUATION_FPS).clamp(max=last)
    low = places.floor().long()
    high = (low + 1).clamp(max=last)
    share = (places - low).to(positions)[:, None, None]
    return positions[:, low] + share * (positions[:, high] - positions[:, low])


def _reader(store: Store, places: Places) -> Gather:
    at = places.starts_s * EVALUATION_FPS
    frames = np.floor(at + 1e-6).astype(np.int64)
    weights = (at - frames).clip(min=0).astype(np.float32)
    weights[weights < 1e-6] = 0
    begins = store.first_rows["upper_body"][places.recordings]
    firsts, last_rows = begins + frames, begins + places.stops - 1
    stream = store.stream("upper_body").reshape(-1, 10, 3)
    within = np.arange(evaluation_frames(places.frames, places.fps))

    def gather(windows: NDArray[np.int64]) -> NDArray[np.float32]:
        # Between two stored frames linearly; what lies past the span isn't looked at.
        ends = last_rows[windows, None]
        rows = np.minimum(firsts[windows, None] + within, ends)
        positions: NDArray[np.float32] = stream[rows]
        between = np.flatnonzero(weights[windows])
        if len(between):
            ahead = stream[np.minimum(rows[between] + 1, ends[between])]
            shares = weights[windows][between, None, None, None]
            positions[between] += (ahead - positions[between]) * shares
        return positions

    return gather


POSITIONS = WindowField(
    name="positions",
    reads="upper body",
    axis="evaluation frames",
    width=30,
    unit="metres, relative to the root, in house axes",
    reader=_reader,
)
