"""The held-out windows and recordings that systems are measured on."""

from __future__ import annotations

import itertools
import logging
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.splits import Span
from cospeech.corpus.step_windows import StepWindows
from cospeech.corpus.store import EVALUATION_FPS, Store
from cospeech.corpus.windows import WindowSpec
from cospeech.motion.gesture_joints import gesture_joints
from cospeech.motion.velocities import body_positions
from cospeech.progress import progress_bar
from cospeech.speech.feature_sets.opensmile import COEFFICIENTS

VELOCITY_WINDOWS = 150
"""As many as the paper's figure 11 takes; fewer where the part has fewer."""

FPS = 20.0
FRAMES = 100
_STRIDES = (100, 50, 25)

_logger = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Take:
    """A held-out stretch at 20 fps.

    Attributes:
        span: Where it is in the store.
        first: Its first row in the windows' arrays.
        joints: ``(T, J, 3)`` gesturing joints, metres.
        pitch: ``(T,)`` F0, Hz, 0 where unvoiced.
    """

    span: Span
    first: int
    joints: NDArray[np.float32]
    pitch: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The part that systems are judged on.

    Attributes:
        store: The corpus.
        windows: Its windows of 5 s.
        takes: Its stretches of at least a window.
    """

    store: Store
    windows: StepWindows
    takes: list[Take]

    def side_by_side(self, take: Take) -> NDArray[np.int64]:
        """The windows that cover a take without overlapping, in order."""
        offsets = self.windows.starts - take.first
        inside = (offsets >= 0) & (offsets <= len(take.joints) - FRAMES)
        return np.flatnonzero(inside & (offsets % FRAMES == 0))


def held_out_part(store: Store, split: str) -> HeldOut:
    """The part's windows, overlapping only as far as it takes to have enough, and its takes."""
    needs = frozenset({"joints", "acoustics", "speakers"})
    for stride in _STRIDES:
        spec = WindowSpec(FPS, FRAMES, 0, stride)
        windows = StepWindows(store, split, spec, needs, every_interleave=False)
        if len(windows) >= VELOCITY_WINDOWS:
            break
    else:
        _logger.warning(
            "%s: %d %s windows, where the paper takes %d",
            store.name,
            len(windows),
            split,
            VELOCITY_WINDOWS,
        )
    return HeldOut(store, windows, list(takes_of(store, windows)))


def takes_of(store: Store, windows: StepWindows) -> Iterator[Take]:
    """The stretches that windows were cut from, where they are as long as a window."""
    ends = np.flatnonzero(
        (np.diff(windows.recordings) != 0) | (np.abs(np.diff(windows.times_s) * FPS - 1) > 0.5)
    )
    edges = [0, *(ends + 1).tolist(), len(windows.times_s)]
    for first, stop in itertools.pairwise(edges):
        if stop - first < FRAMES:
            continue
        recording = int(windows.recordings[first])
        start_s, stop_s = windows.times_s[first], windows.times_s[stop - 1] + 1 / FPS
        span = Span(
            recording,
            math.floor(start_s * EVALUATION_FPS + 1e-6),
            min(
                math.ceil(stop_s * EVALUATION_FPS - 1e-6),
                int(store.recordings[recording].frames),
            ),
        )
        acoustics = windows.acoustics[first:stop]
        pitch = acoustics[:, COEFFICIENTS].copy() if acoustics.shape[1] else np.zeros(0, np.float32)
        yield Take(span, first, windows.joints[first:stop], pitch)


def training_mean_pose(store: Store) -> NDArray[np.float64]:
    """Mean position of each gesturing joint over the training part, ``(J, 3)`` metres."""
    total, frames = np.zeros(()), 0
    spans = store.splits["train"]
    for span in progress_bar(spans, len(spans), "mean pose of the training part"):
        motion = store.motion(span.recording)
        first, stop = (
            math.ceil(edge / EVALUATION_FPS * motion.fps - 1e-6) for edge in (span.start, span.stop)
        )
        body = gesture_joints(motion.skeleton).body
        positions = body_positions(motion.slice(first, stop), body)
        total = total + positions.sum(axis=0, dtype=np.float64)
        frames += len(positions)
    return total / max(1, frames)
