"""Fingerprints of audio and motion that find the same seconds in two recordings.

A fingerprint is a hash of the exact samples around a landmark, and landmarks are places that the
content itself marks (the loudest sample around, the fastest frame around). So a stretch that two
recordings share has the same fingerprints in both, wherever it lies in each.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from cospeech.motion.motion import Motion
from cospeech.speech.speech import SAMPLE_RATE

REACH_S = 0.25
"""A landmark is the highest within this distance, s: there are one to two in a second of speech."""

AUDIO_BYTES_S = 0.02
"""Audio around a landmark that is hashed, s."""

LOUD = 0.02
"""Quieter landmarks are noise, full scale being 1."""

MOTION_FRAMES = 3
"""Frames from a landmark on that are hashed."""

GRID_M, GRID_PX = 1e-4, 1e-2
"""Positions are rounded to this before they are hashed, m or pixels."""

MOVING_SHARE = 0.01
"""Landmarks of motion need a mean step of the joints of this share of the body's size per frame at
30 fps: a T-pose at the start of every take is no common content."""


@dataclass(frozen=True, eq=False)
class Fingerprints:
    """Hashes of a recording's landmarks.

    Attributes:
        hashes: ``(L,)`` uint64.
        times: ``(L,)`` float32, s.
    """

    hashes: NDArray[np.uint64]
    times: NDArray[np.float32]


def audio_fingerprints(waveform: NDArray[np.float32]) -> Fingerprints:
    """Fingerprints of a waveform at 16 kHz, as 16-bit samples."""
    samples = np.rint(np.clip(np.nan_to_num(waveform), -1, 1) * 32767).astype(np.int16)
    strength = np.abs(samples.astype(np.int32))
    landmarks = _landmarks(strength, round(REACH_S * SAMPLE_RATE), LOUD * 32767)
    half = round(AUDIO_BYTES_S / 2 * SAMPLE_RATE)
    landmarks = landmarks[(landmarks >= half) & (landmarks < len(samples) - half)]
    return _hashed(
        [samples[i - half : i + half].tobytes() for i in landmarks], landmarks, SAMPLE_RATE
    )


def motion_fingerprints(motion: Motion) -> Fingerprints:
    """Fingerprints of a motion relative to its root, to `GRID_M` or `GRID_PX`."""
    if len(motion) <= MOTION_FRAMES or not np.isfinite(motion.positions).all():
        return _hashed([], np.zeros(0, np.int64), 1.0)
    own = motion.positions - motion.positions[:, motion.skeleton.parents.index(-1)][:, None]
    size = float(np.abs(own[:: max(1, len(own) // 100)]).max()) or 1.0
    speed = np.linalg.norm(np.diff(own, axis=0), axis=-1).mean(axis=1) * (motion.fps / 30 / size)
    landmarks = _landmarks(speed, round(REACH_S * motion.fps), MOVING_SHARE)
    landmarks = landmarks[landmarks < len(own) - MOTION_FRAMES]
    grid = GRID_M if motion.dimensions == 3 else GRID_PX
    blocks = [
        np.rint(own[i : i + MOTION_FRAMES] / grid).astype(np.int32).tobytes() for i in landmarks
    ]
    return _hashed(blocks, landmarks, motion.fps)


def _landmarks(
    strength: NDArray[np.floating] | NDArray[np.integer], reach: int, least: float
) -> NDArray[np.int64]:
    if len(strength) == 0:
        return np.zeros(0, np.int64)
    highest = maximum_filter1d(strength, 2 * reach + 1, mode="constant")
    found = np.flatnonzero((strength == highest) & (strength >= least))
    if len(found) == 0:
        return found
    # Flat tops have many highest samples; the first of each is enough.
    return found[np.concatenate([[True], np.diff(found) > reach])]


def _hashed(blocks: list[bytes], landmarks: NDArray[np.int64], rate: float) -> Fingerprints:
    hashes = [
        int.from_bytes(hashlib.blake2b(block, digest_size=8).digest(), "little") for block in blocks
    ]
    return Fingerprints(
        np.array(hashes, np.uint64), (np.asarray(landmarks) / rate).astype(np.float32)
    )
