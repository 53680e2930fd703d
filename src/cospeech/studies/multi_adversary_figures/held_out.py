"""The held-out windows and recordings that systems are measured on."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.joints import JOINTS
from cospeech.corpus.features.span_motion import SpanMotion
from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.corpus.windows import WindowDataset, WindowSpec
from cospeech.progress import progress_bar
from cospeech.speech.feature_sets.opensmile import COEFFICIENTS
from cospeech.studies.multi_adversary_figures.measured import FPS, FRAMES

VELOCITY_WINDOWS = 150
"""As many as the paper's figure 11 takes; fewer where the part has fewer."""

_STRIDES = (100, 50, 25)

_logger = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Take:
    """A held-out stretch at 20 fps.

    Attributes:
        span: Where it is in the store.
        sequence: Which of the windows' tracks it is.
        joints: ``(T, J, 3)`` gesturing joints, metres.
        pitch: ``(T,)`` F0, Hz, 0 where unvoiced.
    """

    span: Span
    sequence: int
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
    windows: WindowDataset
    takes: list[Take]

    def side_by_side(self, take: Take) -> NDArray[np.int64]:
        """The windows that cover a take without overlapping, in order."""
        of_take = self.windows.sequences == take.sequence
        return np.flatnonzero(of_take & (self.windows.firsts % FRAMES == 0))


def held_out_part(store: Store, split: str) -> HeldOut:
    """The part's windows, overlapping only as far as it takes to have enough, and its takes."""
    needs = frozenset({"joints", "acoustics", "speakers"})
    for stride in _STRIDES:
        windows = WindowDataset(store, split, WindowSpec(FPS, FRAMES, 0, stride), needs)
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
    tracks = windows.tracks
    takes = [
        Take(
            tracks.spans[tracks.span_of[sequence]],
            sequence,
            tracks.values("joints", sequence),
            tracks.values("acoustics", sequence)[:, COEFFICIENTS].copy(),
        )
        for sequence in takes_of(windows)
    ]
    return HeldOut(store, windows, takes)


def takes_of(windows: WindowDataset) -> list[int]:
    """The sequences that windows were cut from, where they are as long as a window."""
    return np.flatnonzero(windows.tracks.frames >= FRAMES).tolist()


def training_mean_pose(store: Store) -> NDArray[np.float64]:
    """Mean position of each gesturing joint over the training part, ``(J, 3)`` metres."""
    total, frames = np.zeros(()), 0
    spans = store.splits["train"]
    for span in progress_bar(spans, len(spans), "mean pose of the training part"):
        # All frames as they were recorded: a mean needs no common rate.
        motion = SpanMotion(store, span, store.recordings[span.recording].fps)
        positions = JOINTS.of_motion(motion)
        total = total + positions.sum(axis=0, dtype=np.float64)
        frames += len(positions)
    return total / max(1, frames)
