"""Windows of velocities and phases for training and judging a phase classifier."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from cospeech.corpus.phase_sequences import (
    STEP_FPS,
    PhaseSequence,
    Piece,
    phase_sequences,
    pieces_of,
)
from cospeech.errors import CospeechError
from cospeech.motion.phases import PhaseMerge

__all__ = [
    "STEP_FPS",
    "WINDOW_STEPS",
    "FeatureStatistics",
    "PhaseSequence",
    "PhaseWindows",
    "Piece",
    "phase_sequences",
    "pieces_of",
]

WINDOW_STEPS = 100
"""Five seconds at 20 fps, the windows of all of Ferstl et al.'s networks."""

_SMALLEST_DEVIATION = 1e-6

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class FeatureStatistics:
    """Mean and standard deviation of each feature, of the training part alone.

    Attributes:
        mean: ``(C,)`` float32.
        deviation: ``(C,)`` float32.
    """

    mean: NDArray[np.float32]
    deviation: NDArray[np.float32]

    @classmethod
    def of(cls, sequences: Sequence[PhaseSequence]) -> FeatureStatistics:
        """Statistics over all steps of the training sequences, mirrored ones included."""
        steps = np.concatenate([sequence.features for sequence in sequences]).astype(np.float64)
        deviation = np.maximum(steps.std(axis=0), _SMALLEST_DEVIATION)
        return cls(steps.mean(axis=0).astype(np.float32), deviation.astype(np.float32))

    def normalised(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """Z-scores, ``(..., C)``."""
        return (features - self.mean) / self.deviation


class PhaseWindows:
    """Windows of normalised features with a class per step; a `torch.utils.data.Dataset`.

    A window lies within one sequence, hence within one piece of one recording. Windows begin every
    ``stride`` steps, and one more ends with the sequence, so that every step is in a window. A
    sequence shorter than a window is left out, with a warning.

    Args:
        sequences: From `phase_sequences`.
        statistics: Of the training part.
        merge: The classes, made of the nine labels.
        steps: Steps per window.
        stride: Steps from one window's start to the next.

    Raises:
        CospeechError: No sequence is as long as a window.
    """

    def __init__(
        self,
        sequences: Sequence[PhaseSequence],
        statistics: FeatureStatistics,
        merge: PhaseMerge,
        *,
        steps: int = WINDOW_STEPS,
        stride: int = WINDOW_STEPS,
    ) -> None:
        self.sequences = [sequence for sequence in sequences if len(sequence.labels) >= steps]
        if short := len(sequences) - len(self.sequences):
            _log.warning("%d sequences are shorter than %d steps and left out", short, steps)
        if not self.sequences:
            raise CospeechError(
                f"no annotated stretch is as long as a window of {steps} steps"
                f" ({steps / STEP_FPS:g} s)"
            )
        self.merge, self.steps = merge, steps
        self._features = [
            torch.from_numpy(statistics.normalised(sequence.features))
            for sequence in self.sequences
        ]
        self._labels = [torch.from_numpy(merge(sequence.labels)) for sequence in self.sequences]
        self.windows: list[tuple[int, int]] = []
        for i, sequence in enumerate(self.sequences):
            last = len(sequence.labels) - steps
            starts = sorted({*range(0, last + 1, stride), last})
            self.windows += [(i, start) for start in starts]

    def __len__(self) -> int:
        return len(self.windows)

    def __getitem__(self, index: int) -> tuple[Tensor, Tensor]:
        """Features ``(steps, C)`` float32 and classes ``(steps,)`` int64 of one window."""
        sequence, start = self.windows[index]
        stop = start + self.steps
        return self._features[sequence][start:stop], self._labels[sequence][start:stop]

    def batch(self, indices: Sequence[int] | NDArray[np.integer]) -> tuple[Tensor, Tensor]:
        """Features ``(B, steps, C)`` and classes ``(B, steps)`` of several windows."""
        windows = [self[int(i)] for i in indices]
        return torch.stack([f for f, _ in windows]), torch.stack([c for _, c in windows])

    def labels(self) -> list[Tensor]:
        """Class of every step of every sequence, ``(T,)`` int64 each."""
        return self._labels

    def stitched(self, scores: Tensor) -> list[Tensor]:
        """Scores of overlapping windows, put together again step by step.

        A window counts most at its centre, where it sees both sides: its weight falls linearly to
        its edges.

        Args:
            scores: ``(N, steps, K)`` for all N windows in order; sums to be averaged, such as class
                probabilities.

        Returns:
            ``(T, K)`` per sequence, as `labels`.
        """
        ramp = torch.arange(1, self.steps + 1, dtype=scores.dtype)
        weights = torch.minimum(ramp, ramp.flip(0)).unsqueeze(-1)
        totals = [scores.new_zeros(len(labels), scores.shape[-1]) for labels in self._labels]
        counts = [scores.new_zeros(len(labels), 1) for labels in self._labels]
        for (sequence, start), window in zip(self.windows, scores, strict=True):
            totals[sequence][start : start + self.steps] += window * weights
            counts[sequence][start : start + self.steps] += weights
        return [total / count for total, count in zip(totals, counts, strict=True)]
