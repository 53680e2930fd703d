"""What was said: the waveform and, where known, the words with their times."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

SAMPLE_RATE = 16_000
"""Samples per second of every waveform inside the framework."""


@dataclass(frozen=True)
class Word:
    """A spoken word.

    Attributes:
        text: The word as transcribed.
        start: Onset, seconds from the start of the recording.
        end: Offset, seconds.
    """

    text: str
    start: float
    end: float


@dataclass(frozen=True, eq=False)
class Speech:
    """A waveform with its transcript.

    Attributes:
        waveform: ``(N,)`` float32 in [-1, 1], mono, 16 kHz.
        words: Words in order of onset; None when there is no transcript.
    """

    waveform: NDArray[np.float32]
    words: tuple[Word, ...] | None = None

    def __post_init__(self) -> None:
        if self.waveform.ndim != 1:
            raise ValueError(f"a waveform is (samples,), got shape {self.waveform.shape}")

    @property
    def duration(self) -> float:
        """Seconds of audio."""
        return len(self.waveform) / SAMPLE_RATE

    def since(self, sample: int) -> Speech:
        """What is left from a sample on, its clock starting there; words before it are over."""
        words, first_s = self.words, sample / SAMPLE_RATE
        if words is not None:
            words = tuple(
                replace(word, start=word.start - first_s, end=word.end - first_s)
                for word in words
                if word.end > first_s
            )
        return Speech(self.waveform[sample:], words)


def covering_frames(samples: int, fps: float) -> int:
    """Fewest frames that cover ``samples`` of 16 kHz audio: ``ceil(seconds * fps)``."""
    return math.ceil(round(samples * fps, 6) / SAMPLE_RATE)
