"""One row of the study: what is measured of a system's motion for given speech."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.metrics.beat_consistency import (
    AudioDetector,
    BeatClip,
    BeatConsistency,
    MotionBeats,
    beat_consistency,
    lag_profile,
)
from cospeech.metrics.evaluation_windows import cut_windows
from cospeech.metrics.movement import border_steps, seam_jump, velocity_power
from cospeech.motion.motion import Motion, resample_positions
from cospeech.motion.upper_body import EVALUATION_FPS, UPPER_BODY

LAGS_S = tuple(round(0.05 * step, 2) for step in range(-12, 13))
"""At which the lift is looked at, seconds by which speech follows motion."""

LONGEST_LEAD_S = 0.4
"""Seconds that recorded motion may lead speech by."""

SEAM_FRAMES = 8
"""Frames at 15 fps from one search of the k-NN to the next: where its seams are."""

_WRISTS = (UPPER_BODY.index["left_wrist"], UPPER_BODY.index["right_wrist"])


@dataclass(frozen=True)
class Detectors:
    """What counts as a beat.

    Attributes:
        motion: Finds beats of motion.
        audio: Finds beats of speech.
    """

    motion: MotionBeats
    audio: AudioDetector


@dataclass(frozen=True)
class Moving:
    """How the wrists and the joints move, at 15 fps.

    Attributes:
        seam_ratio: Median step of the joints where windows of the k-NN meet over that elsewhere; 1
            where no seam can be told. None without motion.
        jitter_share: Share of the wrists' velocity power above 4 Hz; None without motion.
        wrist_speed: Mean of both wrists, metres per second.
    """

    seam_ratio: float | None
    jitter_share: float | None
    wrist_speed: float


@dataclass(frozen=True, eq=False)
class SynchronyRow:
    """A system in numbers.

    Attributes:
        name: Of the system.
        at_lag: Beat consistency at the study's lag.
        at_none: The same without a lag.
        profile: ``(len(LAGS_S), 2)`` lifts at `LAGS_S`, audio to motion and motion to audio.
        fgd: Values of `cospeech.evaluation.Catalogue.row`; of recorded motion those of its two
            halves; None where the distance says nothing.
        moving: Steps and speeds; None where they are those of another row.
    """

    name: str
    at_lag: BeatConsistency
    at_none: BeatConsistency
    profile: NDArray[np.float64]
    fgd: dict[str, float] | None
    moving: Moving | None


def measure(
    name: str,
    clips: Sequence[BeatClip],
    lag_s: float,
    seed: int,
    fgd: dict[str, float] | None,
    moving: Moving | None,
) -> SynchronyRow:
    """A row from clips whose beats are known."""
    return SynchronyRow(
        name=name,
        at_lag=beat_consistency(clips, lag_s=lag_s, seed=seed),
        at_none=beat_consistency(clips, seed=seed),
        profile=lag_profile(clips, LAGS_S, seed=seed),
        fgd=fgd,
        moving=moving,
    )


def lag_of(clips: Sequence[BeatClip], seed: int) -> float:
    """The lag from 0 to `LONGEST_LEAD_S` with the largest lifts, both directions together, seconds.

    Strokes come before the syllable that they go with or meet it. At other lags the end of a stroke
    may meet it too: to take that would reward motion that comes too late.
    """
    leads = [lag for lag in LAGS_S if 0 <= lag <= LONGEST_LEAD_S]
    return leads[int(lag_profile(clips, leads, seed=seed).sum(axis=1).argmax())]


def how_it_moves(motions: Sequence[Motion]) -> Moving:
    """Seams, jitter and speed of upper-body motions, over all of them."""
    borders, speeds, power = [], [], np.zeros(2)
    for motion in motions:
        positions = resample_positions(motion.positions, motion.fps, EVALUATION_FPS)
        borders.append(border_steps(positions, SEAM_FRAMES))
        steps = np.diff(positions[:, _WRISTS].astype(np.float64), axis=0)
        speeds.append(np.linalg.norm(steps, axis=-1).mean(-1) * EVALUATION_FPS)
        windows = cut_windows(torch.from_numpy(positions)[None])
        if len(windows):
            power += velocity_power(windows.numpy(), _WRISTS, EVALUATION_FPS).sum(axis=0)
    seam = seam_jump(borders)
    return Moving(
        seam_ratio=None if np.isnan(seam) else seam,
        jitter_share=float(power[0] / power[1]) if power[1] > 0 else None,
        wrist_speed=float(np.concatenate(speeds).mean()),
    )


def mismatched_clips(
    clips: Sequence[BeatClip], partners: int, rng: np.random.Generator
) -> list[BeatClip]:
    """Each clip's motion with the speech of other recordings, both cut to the shorter of the two.

    Args:
        clips: Of recorded motion.
        partners: Other recordings per motion, fewer where there are fewer.
        rng: Chooses them.

    Returns:
        Clips named after the motion's recording; none if all are of one recording.
    """
    mismatched = []
    for clip in clips:
        others = [other for other in clips if other.recording != clip.recording]
        for i in rng.permutation(len(others))[:partners].tolist():
            duration = min(clip.duration, others[i].duration)
            moved, spoken = clip.motion_beats, others[i].audio_beats
            mismatched.append(
                BeatClip(
                    clip.recording, moved[moved < duration], spoken[spoken < duration], duration
                )
            )
    return mismatched
