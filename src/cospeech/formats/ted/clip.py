"""One clip of a TED video, and what makes one unusable."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.speech.speech import Word

_LARGEST_NATIVE_FPS = 1000.0


@dataclass(frozen=True, eq=False)
class TedClip:
    """One clip of a video, as stored.

    Attributes:
        words: On the video's clock; the first may begin before the clip.
        poses: ``(n, 10, 3)`` at the video's frame rate.
        spectrogram: ``(128, m)`` decibels.
        audio: ``(k,)`` at 16 kHz.
        start_frame: Video frame of the first pose.
        start_s: Clip start on the video's clock.
        end_s: Clip end on the video's clock.
    """

    words: tuple[Word, ...]
    poses: NDArray[np.floating]
    spectrogram: NDArray[np.floating]
    audio: NDArray[np.floating]
    start_frame: int
    start_s: float
    end_s: float

    @property
    def native_fps(self) -> float:
        """Frames per second of the poses, from the clip's own times; 0 if they are impossible."""
        seconds = self.end_s - self.start_s
        return len(self.poses) / seconds if seconds > 0 else 0.0


class ValueLayoutError(ValueError):
    """A value isn't what its database should hold; nothing in it can be used."""


class UnusableClipError(ValueError):
    """A clip on which the published preprocessing would stop.

    Attributes:
        kind: The reason in a word or two.
    """

    def __init__(self, kind: str, reason: str) -> None:
        self.kind = kind
        super().__init__(reason)


def check_poses(clip: TedClip) -> None:
    """Whether there is motion, its times fit its frames, and every coordinate is a number.

    Raises:
        UnusableClipError: One of these doesn't hold.
    """
    if len(clip.poses) < 2:
        raise UnusableClipError("no motion", f"{len(clip.poses)} poses")
    if not 1 <= clip.native_fps <= _LARGEST_NATIVE_FPS:
        raise UnusableClipError(
            "times don't fit the frames",
            f"{len(clip.poses)} poses from {clip.start_s:g} s to {clip.end_s:g} s",
        )
    finite = np.isfinite(clip.poses).all(axis=(1, 2))
    if not finite.all():
        frame = int(finite.argmin())
        raise UnusableClipError(
            "pose not a number",
            f"pose {frame} of {len(clip.poses)} ({frame / clip.native_fps:.2f} s) holds a NaN"
            " or infinite coordinate",
        )
