"""Fixed windows over recordings."""

from __future__ import annotations

from dataclasses import dataclass

from cospeech.speech.speech import SAMPLE_RATE


@dataclass(frozen=True)
class WindowSpec:
    """The windows a method works on.

    Attributes:
        fps: Frames per second.
        frames: Frames per window.
        seed_frames: Leading frames given to the method.
        stride: Frames from one window's start to the next.
    """

    fps: float
    frames: int
    seed_frames: int
    stride: int

    @property
    def audio_samples(self) -> int:
        """Samples of 16 kHz audio that go with one window."""
        return round(self.frames / self.fps * SAMPLE_RATE)
