"""What the corpus report counts."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cospeech.motion.upper_body import UPPER_BODY
from cospeech.reporting.corpus_report.streaming import StreamingHistogram

WRISTS = (UPPER_BODY.index["left_wrist"], UPPER_BODY.index["right_wrist"])
"""Left and right wrist among the evaluation joints."""

_HAND_CELL, _HAND_CELLS = 0.025, 88
_FAR_M = 2.0
_HAND_ORIGIN = (-1.1, -0.9)

MEASURES: tuple[str, ...] = (
    "seconds",
    "words_per_minute",
    "left_wrist",
    "right_wrist",
    "still",
    "bone_variation",
    "level",
    "clipped",
    "excess_audio",
)
"""Per-recording numbers: length, s; words per minute; mean wrist speeds, m/s or pixels/s; share of
time with both wrists still; coefficient of variation of the bones' lengths, mean over bones; RMS
level, dBFS; share of samples at full scale; audio minus motion, s."""


@dataclass(frozen=True)
class SplitTotals:
    """What a split holds.

    Attributes:
        name: Split name.
        recordings: Recordings with a part in it.
        speakers: Speakers of those.
        hours: Motion.
        transcribed_hours: Motion of recordings that have a transcript.
        words: Words that begin in it.
        windows: Windows, of the published list where there is one.
    """

    name: str
    recordings: int
    speakers: int
    hours: float
    transcribed_hours: float
    words: int
    windows: int

    @property
    def words_per_minute(self) -> float:
        """NaN without a transcript."""
        return self.words / (self.transcribed_hours * 60 or np.nan)


@dataclass(frozen=True)
class SpeakerTotals:
    """What a speaker gives.

    Attributes:
        name: Speaker name.
        splits: Splits that have a part of it, in order.
        recordings: Number of recordings.
        minutes: Motion.
        words_per_minute: Over recordings with a transcript; NaN without.
        wrist_speeds: Means of left and right, m/s (pixels/s); NaN where a wrist isn't known.
    """

    name: str
    splits: tuple[str, ...]
    recordings: int
    minutes: float
    words_per_minute: float
    wrist_speeds: tuple[float, float]


@dataclass(eq=False)
class JointTotals:
    """Speeds and bone lengths of one skeleton, over the recordings that have it.

    Attributes:
        speeds: One row per joint: displacement over about 1/15 s, in units per second.
        recordings: Recordings counted.
        frames: Frames counted.
    """

    speeds: StreamingHistogram
    recordings: int = 0
    frames: int = 0
    _sums: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    def add(self, lengths: NDArray[np.float64]) -> float:
        """Count ``(T, J)`` bone lengths; the mean coefficient of variation over the bones."""
        count, means, variances = len(lengths), lengths.mean(axis=0), lengths.var(axis=0)
        moments = count * np.stack([means, means**2, variances])
        self._sums = moments if not self.frames else self._sums + moments
        self.frames += count
        self.recordings += 1
        bones = means > 0
        return float((np.sqrt(variances[bones]) / means[bones]).mean()) if bones.any() else np.nan

    @property
    def bone_lengths(self) -> NDArray[np.float64]:
        """``(J,)`` mean distance of each joint from its parent; 0 for a root."""
        return self._sums[0] / self.frames

    @property
    def bone_variation_within(self) -> NDArray[np.float64]:
        """``(J,)`` coefficient of variation over the frames of one recording, pooled."""
        return self._relative(self._sums[2] / self.frames)

    @property
    def bone_variation_between(self) -> NDArray[np.float64]:
        """``(J,)`` coefficient of variation of the recordings' mean lengths, weighted by frames."""
        spread = self._sums[1] / self.frames - self.bone_lengths**2
        return self._relative(np.maximum(spread, 0))

    def _relative(self, variances: NDArray[np.float64]) -> NDArray[np.float64]:
        means = self.bone_lengths
        return np.sqrt(variances) / np.where(means > 0, means, np.nan)


@dataclass(eq=False)
class HandSpace:
    """Where the wrists are, seen from the front, and the mean pose; spine at the origin.

    Attributes:
        counts: ``(2, C, C)`` frames by cell, left and right; cells of 2.5 cm, first axis x.
        pose_sum: ``(10, 3)`` sum of the evaluation joints over ``pose_frames``.
        pose_frames: Frames with every joint within 2 m of the spine; others would spoil the mean.
        frames: Frames seen.
    """

    counts: NDArray[np.int64] = field(
        default_factory=lambda: np.zeros((2, _HAND_CELLS, _HAND_CELLS), dtype=np.int64)
    )
    pose_sum: NDArray[np.float64] = field(default_factory=lambda: np.zeros((10, 3)))
    pose_frames: int = 0
    frames: int = 0
    cell: float = _HAND_CELL
    origin: tuple[float, float] = _HAND_ORIGIN

    def add(self, upper_body: NDArray[np.float32]) -> None:
        """Count ``(T, 10, 3)`` positions."""
        near = (np.abs(upper_body) < _FAR_M).all(axis=(1, 2))
        self.pose_sum += upper_body[near].sum(axis=0, dtype=np.float64)
        self.pose_frames += int(near.sum())
        self.frames += len(upper_body)
        for side, joint in enumerate(WRISTS):
            cells = np.floor((upper_body[:, joint, :2] - self.origin) / self.cell).astype(np.int64)
            cells = cells[((cells >= 0) & (cells < _HAND_CELLS)).all(axis=1)]
            flat = cells[:, 0] * _HAND_CELLS + cells[:, 1]
            self.counts[side] += np.bincount(flat, minlength=_HAND_CELLS**2).reshape(
                _HAND_CELLS, _HAND_CELLS
            )


@dataclass(frozen=True, eq=False)
class CorpusStatistics:
    """Everything the corpus report counts.

    Attributes:
        measures: Name of `MEASURES` -> ``(R,)``, NaN where a recording has no such number.
        splits: Totals per split, in the store's order.
        total: Totals over all recordings, those outside every split included.
        speakers: Most motion first.
        joints: Per skeleton of the store.
        wrists: Wrist speeds, left and right, m/s (pixels/s).
        word_seconds: Word durations.
        levels: RMS level of blocks of a tenth of a second, dBFS.
        phase_frames: ``(9,)`` frames by gesture phase.
        phase_recordings: Recordings with phases.
        word_counts: Occurrences by word id.
        hands: Wrist positions; None without an upper body.
    """

    measures: dict[str, NDArray[np.float64]]
    splits: list[SplitTotals]
    total: SplitTotals
    speakers: list[SpeakerTotals]
    joints: list[JointTotals]
    wrists: StreamingHistogram
    word_seconds: StreamingHistogram
    levels: StreamingHistogram
    phase_frames: NDArray[np.int64]
    phase_recordings: int
    word_counts: NDArray[np.int64]
    hands: HandSpace | None
