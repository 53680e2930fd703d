"""A TED clip at 15 fps, cut into the published windows.

See docs/facts/trimodal.md, sections 3.5 and 3.6.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.formats.ted.clip import TedClip, UnusableClipError, check_poses
from cospeech.formats.ted.filters import PASSED, PUBLISHED_RULES, WindowRules, judge_motion
from cospeech.speech.speech import SAMPLE_RATE, Word

LARGEST_SPECTROGRAM_DIFFERENCE = 5
"""Columns by which a clip's spectrogram may differ from what its motion's length asks for."""

_SPECTROGRAM_WINDOW, _SPECTROGRAM_HOP = 1024, 512


def resample_poses(
    poses: NDArray[np.floating], duration_s: float, fps: float
) -> NDArray[np.float16]:
    """Poses at another frame rate, bit for bit as the published code has them.

    See docs/facts/trimodal.md, section 3.6, step 1.

    Linear interpolation over the frame index at 0, n/E, 2n/E ... below n, with E = duration * fps
    not rounded; positions past the last frame continue its slope. Differences between neighbouring
    frames are taken in the input's own precision.

    Args:
        poses: ``(n, J, 3)``, n >= 2.
        duration_s: Seconds that the n frames last.
        fps: Frame rate wanted.

    Returns:
        ``(K, J, 3)`` float16 with K = ceil(E) up to rounding.
    """
    count = len(poses)
    at = np.arange(0, count, count / (duration_s * fps))
    high = np.searchsorted(np.arange(count), at).clip(1, count - 1)
    low = high - 1
    slope = (poses[high] - poses[low]).astype(np.float64)
    return (slope * (at - low)[:, None, None] + poses[low]).astype(np.float16)


def spectrogram_columns(frames: int, fps: float = PUBLISHED_RULES.fps) -> int:
    """Spectrogram columns that go with so many frames; halves round to even.

    See docs/facts/trimodal.md, section 3.5.
    """
    samples = frames / fps * SAMPLE_RATE
    return round((samples - _SPECTROGRAM_WINDOW) / _SPECTROGRAM_HOP + 1)


@dataclass(frozen=True, eq=False)
class CandidateWindow:
    """One window of a clip, kept or not.

    Attributes:
        start: First frame, at the rules' rate.
        start_s: Start on the video's clock.
        end_s: End on the video's clock.
        words: Words that overlap it.
        verdict: `PASSED`, ``"words"`` (too few) or the motion filter that it fails.
    """

    start: int
    start_s: float
    end_s: float
    words: tuple[Word, ...]
    verdict: str


class ClipWindows:
    """A clip cut into the published windows.

    Args:
        clip: The clip.
        rules: What is kept.

    Attributes:
        poses: ``(K, 10, 3)`` float16 poses at the rules' rate.
        windows: Every candidate, in order; none when the clip is shorter than a window.

    Raises:
        UnusableClipError: The published code stops on such a clip: audio and motion differ in
            length, or a pose is not a number.
    """

    def __init__(self, clip: TedClip, rules: WindowRules = PUBLISHED_RULES) -> None:
        self.clip, self.rules = clip, rules
        check_poses(clip)
        self.poses = resample_poses(clip.poses, clip.end_s - clip.start_s, rules.fps)
        columns, expected = clip.spectrogram.shape[1], spectrogram_columns(len(self), rules.fps)
        if abs(columns - expected) > LARGEST_SPECTROGRAM_DIFFERENCE:
            raise UnusableClipError(
                "audio and motion differ in length",
                f"the spectrogram has {columns} columns where {len(self)} frames of motion ask for"
                f" {expected}",
            )
        starts = range(0, len(self) - rules.frames + 1, rules.stride)
        self.windows = [self._window(start) for start in starts]

    def __len__(self) -> int:
        return len(self.poses)

    def _window(self, start: int) -> CandidateWindow:
        rules = self.rules
        start_s = self.clip.start_s + start / rules.fps
        end_s = self.clip.start_s + (start + rules.frames) / rules.fps
        words = tuple(w for w in self.clip.words if w.start < end_s and w.end > start_s)
        if len(words) < rules.least_words:
            verdict = "words"
        else:
            verdict = judge_motion(self.poses[start : start + rules.frames], rules)
        return CandidateWindow(start, start_s, end_s, words, verdict)

    @property
    def kept(self) -> list[CandidateWindow]:
        """The windows that pass."""
        return [window for window in self.windows if window.verdict == PASSED]

    def dropped(self) -> dict[str, int]:
        """Reason -> how many candidate windows it left out."""
        return dict(Counter(w.verdict for w in self.windows if w.verdict != PASSED))

    def audio_start(self, start: int) -> int:
        """First sample of the audio of the window at frame `start`: floor(start / K * length)."""
        return math.floor(start / len(self) * len(self.clip.audio))
