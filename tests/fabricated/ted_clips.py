"""Made-up clips in the TED set's own layout, axes and units: a moving upper body that speaks."""

import math
from typing import Any

import numpy as np

from cospeech.motion.upper_body import UPPER_BODY
from tests.fabricated.ted_cache import PUBLISHED_MEAN_DIRECTION

# the published bone table, brought to a mean bone of 0.2
BONE_LENGTHS = np.array([0.26, 0.18, 0.14, 0.22, 0.36, 0.33, 0.22, 0.36, 0.33]) * 0.2 * 9 / 2.4
SYLLABLES = ["ba", "de", "ki", "lo", "mu", "na", "po", "ri", "sa", "te", "vu", "wen"]
SPECTROGRAM_ROWS, SPECTROGRAM_HOP = 128, 512


def make_poses(frames: int, fps: float, seed: int, arm_swing: float = 0.55) -> np.ndarray:
    """``(frames, 10, 3)`` float16; with an ``arm_swing`` under 0.05 the wrists count as still."""
    rng = np.random.default_rng([seed, 1])
    directions = np.reshape(PUBLISHED_MEAN_DIRECTION, (9, 3)).copy()
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    swing = np.array([0.03, 0.06, 0.06, 0.06, arm_swing, arm_swing, 0.06, arm_swing, arm_swing])
    phases = (
        2 * np.pi * rng.uniform(0.05, 1.2, (4, 9, 3)) * np.arange(frames)[:, None, None, None] / fps
    ) + rng.uniform(0, 2 * np.pi, (4, 9, 3))
    moved = directions + swing[:, None] * np.sin(phases).sum(axis=1) / 2
    moved /= np.linalg.norm(moved, axis=2, keepdims=True)
    poses = np.zeros((frames, 10, 3))
    for child in range(1, 10):
        bone = BONE_LENGTHS[child - 1] * moved[:, child - 1]
        poses[:, child] = poses[:, UPPER_BODY.parents[child]] + bone
    return poses.astype(np.float16)


def make_words(seconds: float, seed: int) -> list[list[Any]]:
    """[text, start, end] from the clip's start; the first begins before it, the last ends after."""
    rng = np.random.default_rng([seed, 2])
    words, time = [], -0.2
    while time < seconds:
        end = round(time + rng.uniform(0.15, 0.5), 3)
        text = "".join(rng.choice(SYLLABLES, rng.integers(1, 4)))
        words.append([text, time, end])
        time = round(end + rng.choice([0.0, 0.03, 0.25], p=[0.6, 0.3, 0.1]), 3)
    return words


def make_audio(seconds: float, words: list[list[Any]], seed: int) -> np.ndarray:
    """A hum that is 30 dB louder inside words; float16 at 16 kHz."""
    rng = np.random.default_rng([seed, 3])
    count = math.ceil(seconds * 16000)
    times = np.arange(count) / 16000
    loudness = np.full(count, 0.004)
    for _, start, end in words:
        loudness[max(0, int(start * 16000)) : max(0, int(end * 16000))] = 0.12
    pitch = rng.uniform(90, 220)
    hum = sum(np.sin(2 * np.pi * pitch * h * times) / h for h in (1, 2, 3, 5))
    return (loudness * hum).astype(np.float16)


def make_clip(
    seconds: float,
    fps: float = 25.0,
    start_frame: int = 75,
    seed: int = 0,
    arm_swing: float = 0.55,
) -> dict[str, Any]:
    """One item of a video's ``clips``, times on the video's clock."""
    frames = round(seconds * fps)
    start_s, end_s = start_frame / fps, (start_frame + frames) / fps
    words = make_words(end_s - start_s, seed)
    audio = make_audio(end_s - start_s, words, seed)
    rng = np.random.default_rng([seed, 4])
    columns = 1 + len(audio) // SPECTROGRAM_HOP
    decibels = -80 * rng.random((SPECTROGRAM_ROWS, columns), dtype=np.float32)
    poses = make_poses(frames, fps, seed, arm_swing)
    return {
        "words": [[text, round(a + start_s, 3), round(b + start_s, 3)] for text, a, b in words],
        "skeletons": np.full((frames, 16), np.nan, np.float16),
        "skeletons_3d": poses,
        "audio_feat": decibels.astype(np.float16),
        "audio_raw": audio,
        "start_frame_no": start_frame,
        "end_frame_no": start_frame + frames,
        "start_time": start_s,
        "end_time": end_s,
    }


def moved_clip(clip: dict[str, Any], start_frame: int, fps: float = 25.0) -> dict[str, Any]:
    """The same clip elsewhere in a video: its arrays are shared, only times differ."""
    shift = start_frame / fps - clip["start_time"]
    frames = clip["end_frame_no"] - clip["start_frame_no"]
    return {
        **clip,
        "words": [[text, round(a + shift, 3), round(b + shift, 3)] for text, a, b in clip["words"]],
        "start_frame_no": start_frame,
        "end_frame_no": start_frame + frames,
        "start_time": start_frame / fps,
        "end_time": (start_frame + frames) / fps,
    }
