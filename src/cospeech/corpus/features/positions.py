"""The upper body at the evaluation rate over the time of each window."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.field import Gather, Places, WindowField
from cospeech.corpus.store import Store
from cospeech.motion.upper_body import EVALUATION_FPS


def evaluation_frames(frames: int, fps: float) -> int:
    """Frames at the evaluation rate that so many frames at another rate cover."""
    return math.floor((frames - 1) / fps * EVALUATION_FPS + 1e-6) + 1


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
