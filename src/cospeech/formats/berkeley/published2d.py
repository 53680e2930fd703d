"""What the published code does with the 2-D keypoints: normalising, scaling, cutting windows.

Everything here works on `Motion.positions` of `keypoints.BERKELEY_2D` (``(T, 49, 2)`` pixels
relative to the neck, y up) and on the published layout (``(T, 98)``: all x, then all y, y down).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.recording import Recording, WindowList
from cospeech.errors import CospeechError
from cospeech.formats.berkeley.keypoints import BERKELEY_2D, COUNT
from cospeech.speech.speech import SAMPLE_RATE

WINDOW_FRAMES = 64
WINDOW_STRIDE = 5
NOMINAL_FPS = 15.0
TEST_WINDOWS = 1000
"""Published number of test windows per speaker."""
JON_SHOULDER_PX = 313.594
"""Horizontal shoulder distance of Jon's published mean pose, which all speakers are scaled to."""

_EPSILON = float(np.finfo(np.float64).eps)


def to_channels(positions: NDArray[Any]) -> NDArray[np.float64]:
    """``(..., 49, 2)`` house positions as the published ``(..., 98)``: all x, then all y down."""
    relative = positions - positions[..., :1, :]
    flipped = relative.astype(np.float64) * [1.0, -1.0]
    return flipped.swapaxes(-1, -2).reshape(*positions.shape[:-2], 2 * COUNT)


def from_channels(channels: NDArray[Any]) -> NDArray[np.float64]:
    """The inverse of `to_channels`: ``(..., 98)`` as ``(..., 49, 2)`` positions, neck at 0."""
    grid = channels.reshape(*channels.shape[:-1], 2, COUNT).swapaxes(-1, -2)
    return grid * [1.0, -1.0]


@dataclass(frozen=True, eq=False)
class SpeakerStatistics:
    """Mean and standard deviation of one speaker's channels.

    Attributes:
        count: Frames they are of.
        mean: ``(98,)`` pixels.
        std: ``(98,)`` pixels, population standard deviation.
    """

    count: int
    mean: NDArray[np.float64]
    std: NDArray[np.float64]

    @property
    def shoulder_distance(self) -> float:
        """Horizontal distance of the shoulders in the mean pose, pixels."""
        index = BERKELEY_2D.index
        left, right = self.mean[index["left_shoulder"]], self.mean[index["right_shoulder"]]
        return float(abs(left - right))

    def normalise(self, positions: NDArray[Any]) -> NDArray[np.float64]:
        """``(x - mean) / (std + 2.2e-16)`` of positions ``(..., 49, 2)``, as ``(..., 98)``."""
        return (to_channels(positions) - self.mean) / (self.std + _EPSILON)

    def denormalise(self, channels: NDArray[Any], scale: float = 1.0) -> NDArray[np.float64]:
        """The inverse of `normalise`; the neck is put to 0 first, as published.

        Args:
            channels: ``(..., 98)``.
            scale: Factor on the result: `scale_factors` shows every speaker at Jon's size.
        """
        channels = np.array(channels, dtype=np.float64)
        channels[..., [0, COUNT]] = 0.0
        return from_channels((channels * (self.std + _EPSILON) + self.mean) * scale)


def speaker_statistics(recordings: Iterable[Recording]) -> dict[str, SpeakerStatistics]:
    """Statistics of each speaker, in one pass; memory is one recording's.

    How the published constants were made is not documented; take the training recordings.

    Raises:
        CospeechError: A recording isn't on `keypoints.BERKELEY_2D`.
    """
    sums: dict[str, tuple[int, NDArray[np.float64], NDArray[np.float64]]] = {}
    for recording in recordings:
        motion = recording.motion
        if motion.skeleton.joints != BERKELEY_2D.joints:
            raise CospeechError(f"recording {recording.id} has no 2-D Berkeley keypoints")
        channels = to_channels(motion.positions)
        if len(channels) == 0:
            continue
        mean, spread = channels.mean(axis=0), channels.var(axis=0) * len(channels)
        sums[recording.speaker] = _merged(
            sums.get(recording.speaker), (len(channels), mean, spread)
        )
    return {
        speaker: SpeakerStatistics(count, mean, np.sqrt(spread / count))
        for speaker, (count, mean, spread) in sums.items()
    }


_Moments = tuple[int, NDArray[np.float64], NDArray[np.float64]]


def _merged(first: _Moments | None, second: _Moments) -> _Moments:
    """Count, mean and summed squares of two parts together (Chan et al. 1979)."""
    if first is None:
        return second
    count = first[0] + second[0]
    step = second[1] - first[1]
    mean = first[1] + step * (second[0] / count)
    spread = first[2] + second[2] + step**2 * (first[0] * second[0] / count)
    return count, mean, spread


def scale_factors(shoulder_px: Mapping[str, float]) -> dict[str, float]:
    """Jon's horizontal shoulder distance over each speaker's.

    This gives the ten published ``scale_factor`` values to 6 digits. Where Jon is not among the
    speakers, his published distance is taken.
    """
    jon = shoulder_px.get("jon", JON_SHOULDER_PX)
    return {speaker: jon / distance for speaker, distance in shoulder_px.items()}


def window_audio_samples(fps: float) -> int:
    """Samples of a published window: its 63 frame gaps (67,267 at 14.985 fps, 67,200 at 15)."""
    return round((WINDOW_FRAMES - 1) / fps * SAMPLE_RATE)


def training_windows(frames: int, fps: float) -> WindowList:
    """The published windows of a recording: 64 frames, stride 5, starts 0 to ``frames - 65``.

    A window that would end with the last frame is skipped, as published. All windows are said to
    be at 15 fps, the published code's constant, so that videos of 14.985 fps are on one list with
    the others; the audio's starts are at the true rate.

    Args:
        frames: Frames of the recording.
        fps: Its true rate.
    """
    starts = np.arange(0, max(0, frames - WINDOW_FRAMES), WINDOW_STRIDE, dtype=np.int64)
    # The published code cuts the fraction off.
    samples = np.floor(starts / fps * SAMPLE_RATE + 1e-6).astype(np.int64)
    return WindowList(NOMINAL_FPS, WINDOW_FRAMES, WINDOW_STRIDE, starts, samples)


def random_windows(
    lengths: Mapping[str, int], seed: int, count: int = TEST_WINDOWS
) -> list[tuple[str, int]]:
    """Test windows of one speaker: a random recording, then a random start in it.

    As the published script draws them, but from a seed: there is no published list.

    Args:
        lengths: Recording id -> frames, of the speaker's test recordings.
        seed: Same seed and recordings, same windows, whatever the mapping's order.
        count: Number of windows.

    Returns:
        (recording id, first frame); starts are 0 to ``frames - 64``.

    Raises:
        CospeechError: No recording has 64 frames.
    """
    usable = sorted(name for name, frames in lengths.items() if frames >= WINDOW_FRAMES)
    if not usable:
        raise CospeechError(f"none of {len(lengths)} test recordings has {WINDOW_FRAMES} frames")
    generator = np.random.default_rng(seed)
    windows = []
    for _ in range(count):
        name = usable[int(generator.integers(len(usable)))]
        windows.append((name, int(generator.integers(lengths[name] - WINDOW_FRAMES + 1))))
    return windows
