"""The windows that the published code cuts of the 2-D keypoints, and whose size it scales to."""

from __future__ import annotations

import numpy as np

from cospeech.corpus.recording import WindowList
from cospeech.speech.speech import SAMPLE_RATE

WINDOW_FRAMES = 64
WINDOW_STRIDE = 5
NOMINAL_FPS = 15.0
JON_SHOULDER_PX = 313.594
"""Horizontal shoulder distance of Jon's published mean pose, which all speakers are scaled to: over
a speaker's own it gives the ten published ``scale_factor`` values to 6 digits."""


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
