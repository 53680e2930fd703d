"""Beat consistency of motion and speech, in both directions, over its chance level."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cospeech.metrics.beat_consistency.audio_beats import AudioDetector
from cospeech.metrics.beat_consistency.motion_beats import MotionBeats, Times
from cospeech.metrics.beat_consistency.scores import (
    SIGMA_S,
    beat_scores,
    circular_shifts,
    cut_from,
    lift,
)
from cospeech.metrics.resampling import Array, Estimate, Resampling
from cospeech.motion.motion import Motion
from cospeech.speech.speech import SAMPLE_RATE, Speech

MISMATCHED = 100
"""Mismatched audios per clip; the protocol asks for 20 or more."""
RESAMPLES = 400

Mismatch = Literal["shifts", "recordings"]


@dataclass(frozen=True, eq=False)
class BeatClip:
    """The beats of one stretch of motion and of the speech that it goes with.

    Attributes:
        recording: Which recording it is of; intervals resample recordings.
        motion_beats: ``(m,)`` seconds from the start of the clip, ascending.
        audio_beats: ``(n,)`` the same of the speech.
        duration: Seconds.
    """

    recording: str
    motion_beats: Times
    audio_beats: Times
    duration: float


def beat_clip(
    recording: str,
    motion: Motion,
    speech: Speech,
    motion_detector: MotionBeats,
    audio_detector: AudioDetector,
) -> BeatClip:
    """Find the beats of a stretch of motion and of its speech.

    Args:
        recording: Which recording it is of.
        motion: Motion relative to the body, at its own frame rate.
        speech: What was said meanwhile.
        motion_detector: Finds the motion's beats.
        audio_detector: Finds the speech's.

    Raises:
        ValueError: Motion and speech differ in length by more than two frames and 1 %: one of the
            rates is not what it says.
    """
    tolerance = max(2 / motion.fps, 0.01 * speech.duration)
    if abs(motion.duration - speech.duration) > tolerance:
        raise ValueError(
            f"{recording}: {len(motion)} frames at {motion.fps:g} fps are {motion.duration:.2f} s,"
            f" {len(speech.waveform)} samples at {SAMPLE_RATE} Hz are {speech.duration:.2f} s:"
            " wrong frame or sample rate, or not the same recording"
        )
    return BeatClip(
        recording,
        motion_detector(motion),
        audio_detector(speech.waveform, SAMPLE_RATE),
        speech.duration,
    )


@dataclass(frozen=True, eq=False)
class DirectedConsistency:
    """One direction's score S(A -> B), over all clips, each beat of A counting the same.

    Attributes:
        score: S with the speech that belongs to the motion.
        chance: Mean S with mismatched speech.
        lift: ``(score - chance) / (1 - chance)``, with its draws over recordings.
        p_value: Share of the audios, the true one counted in, that score at least as much as it.
    """

    score: float
    chance: float
    lift: Estimate
    p_value: float

    @property
    def interval(self) -> tuple[float, float] | None:
        """95 % interval of the lift over recordings; None for fewer than five of them."""
        return self.lift.interval()


@dataclass(frozen=True, eq=False)
class BeatConsistency:
    """How far motion and speech beat together.

    Attributes:
        audio_to_motion: Whether a beat of speech has one of motion: lowered by what is missing.
        motion_to_audio: Whether a beat of motion has one of speech: lowered by what is too much.
        motion_beats_per_second: Over all clips.
        audio_beats_per_second: Over all clips.
        lag_s: Seconds by which speech was taken to follow motion.
        clips: How many there are.
        clips_without_motion_beats: Of these; their beats of speech count, with a score of 0.
        clips_without_audio_beats: Of these; fewer than two beats of speech. They are not scored.
        recordings: How many recordings were scored.
    """

    audio_to_motion: DirectedConsistency
    motion_to_audio: DirectedConsistency
    motion_beats_per_second: float
    audio_beats_per_second: float
    lag_s: float
    clips: int
    clips_without_motion_beats: int
    clips_without_audio_beats: int
    recordings: int


def beat_consistency(
    clips: Sequence[BeatClip],
    sigma_s: float = SIGMA_S,
    lag_s: float = 0.0,
    mismatch: Mismatch = "shifts",
    mismatched: int = MISMATCHED,
    seed: int = 0,
    resamples: int = RESAMPLES,
) -> BeatConsistency:
    """Score clips in both directions against mismatched speech.

    Both sides are scored from the first to the last beat of speech. In the silence before and
    after, hands rest in all recordings alike: with it, motion of *another* recording of the
    embedded corpus has a lift of 0.2.

    Beats of speech stay in the sum where motion has none, with a score of 0 in truth and in chance.
    So hands that never stop or never move have the lift 0 in both directions, as beats at random
    have; and motion that stops only when it is sure is found out from audio to motion.

    Mismatched speech is the clip's own, shifted around by a quarter to three quarters. Speech of
    other recordings is the alternative; where those who speak fast also gesture fast, it finds
    consistency in motion that never heard the speech, since every recording is then held against
    one that is slower or faster.

    Args:
        clips: What is scored together.
        sigma_s: Width of the Gaussian, seconds.
        lag_s: Seconds by which speech follows motion; gestures tend to lead by about 0.2 s. A
            beat of motion at t is in time with one of speech at ``t + lag_s``.
        mismatch: ``"shifts"`` or ``"recordings"``.
        mismatched: Mismatched audios per clip, at least 20.
        seed: Of the mismatch and the resampling.
        resamples: Draws of recordings for the intervals.

    Raises:
        ValueError: No clip has two beats of speech; fewer than 20 mismatched audios; one recording
            only and mismatch from other recordings.
    """
    if mismatched < 20:
        raise ValueError(f"a chance level takes 20 mismatched audios or more, got {mismatched}")
    spoken = [_while_spoken(clip, lag_s) for clip in clips if len(clip.audio_beats) > 1]
    if not spoken:
        raise ValueError(f"none of {len(clips)} clips has two beats of speech to be in time with")
    rng = np.random.default_rng(seed)
    mismatches = _shifted_speech(rng) if mismatch == "shifts" else _other_speech(spoken, rng)
    sums = np.array(
        [_sums(clip, [clip.audio_beats, *mismatches(clip, mismatched)], sigma_s) for clip in spoken]
    )
    resampling = Resampling([clip.recording for clip in spoken], resamples, seed)
    seconds = sum(clip.duration for clip in clips)
    return BeatConsistency(
        audio_to_motion=_directed(sums[:, 0], resampling),
        motion_to_audio=_directed(sums[:, 1], resampling),
        motion_beats_per_second=sum(len(clip.motion_beats) for clip in clips) / seconds,
        audio_beats_per_second=sum(len(clip.audio_beats) for clip in clips) / seconds,
        lag_s=lag_s,
        clips=len(clips),
        clips_without_motion_beats=sum(not len(clip.motion_beats) for clip in clips),
        clips_without_audio_beats=len(clips) - len(spoken),
        recordings=resampling.groups,
    )


def lag_profile(
    clips: Sequence[BeatClip],
    lags_s: Sequence[float],
    sigma_s: float = SIGMA_S,
    mismatch: Mismatch = "shifts",
    mismatched: int = MISMATCHED,
    seed: int = 0,
) -> Array:
    """The lifts at several lags: a peak says that motion and speech beat together, and how apart.

    Args:
        clips: As for `beat_consistency`, like the rest.
        lags_s: ``(L,)`` seconds by which speech follows motion.
        sigma_s: Width of the Gaussian, seconds.
        mismatch: ``"shifts"`` or ``"recordings"``.
        mismatched: Mismatched audios per clip.
        seed: Of the mismatch, the same at every lag.

    Returns:
        ``(L, 2)`` lift from audio to motion and from motion to audio.
    """
    found = [
        beat_consistency(clips, sigma_s, lag, mismatch, mismatched, seed, resamples=0)
        for lag in lags_s
    ]
    return np.array(
        [(at.audio_to_motion.lift.value, at.motion_to_audio.lift.value) for at in found]
    )


def _while_spoken(clip: BeatClip, lag_s: float) -> BeatClip:
    """The clip from half a mean gap before the first beat of speech to as much after the last."""
    first, last = clip.audio_beats[[0, -1]].tolist()
    gap = (last - first) / (len(clip.audio_beats) - 1)
    start, duration = first - gap / 2, last - first + gap
    moved = clip.motion_beats + lag_s - start
    inside = (moved >= 0) & (moved < duration)
    return replace(
        clip,
        motion_beats=moved[inside],
        audio_beats=clip.audio_beats - start,
        duration=duration,
    )


_Mismatcher = Callable[[BeatClip, int], list[Times]]


def _shifted_speech(rng: np.random.Generator) -> _Mismatcher:
    def beats_of(clip: BeatClip, count: int) -> list[Times]:
        return [
            cut_from(clip.audio_beats, clip.duration, shift, clip.duration)
            for shift in circular_shifts(clip.duration, count, rng).tolist()
        ]

    return beats_of


def _other_speech(clips: Sequence[BeatClip], rng: np.random.Generator) -> _Mismatcher:
    if len({clip.recording for clip in clips}) < 2:
        raise ValueError("one recording has no other's speech: mismatch it by shifts")

    def beats_of(clip: BeatClip, count: int) -> list[Times]:
        others = [other for other in clips if other.recording != clip.recording]
        chosen = [others[i] for i in rng.integers(len(others), size=count)]
        starts = rng.random(count)
        return [
            cut_from(other.audio_beats, other.duration, share * other.duration, clip.duration)
            for other, share in zip(chosen, starts.tolist(), strict=True)
        ]

    return beats_of


def _sums(clip: BeatClip, speeches: Sequence[Times], sigma_s: float) -> Array:
    """Sum of scores and number of beats, ``(2, S, 2)``: per direction and speech."""
    # All at once: each speech has its own copy of the motion, far from the next one's.
    apart = clip.duration + 100 * sigma_s
    counts = [len(speech) for speech in speeches]
    of_speech = np.repeat(np.arange(len(speeches)), counts)
    spoken = np.concatenate(speeches) + apart * of_speech
    moved = (clip.motion_beats + apart * np.arange(len(speeches))[:, None]).ravel()
    to_motion = np.bincount(of_speech, beat_scores(spoken, moved, sigma_s), len(speeches))
    to_audio = beat_scores(moved, spoken, sigma_s).reshape(len(speeches), -1).sum(axis=1)
    beats = np.full(len(speeches), len(clip.motion_beats))
    return np.stack([np.stack([to_motion, counts], axis=-1), np.stack([to_audio, beats], axis=-1)])


def _directed(sums: Array, resampling: Resampling) -> DirectedConsistency:
    """From ``(clips, 1 + K, 2)`` sums and numbers of beats, those with the true speech first."""

    def scores(chosen: NDArray[np.int64]) -> Array:
        totals = sums[chosen].sum(axis=0)
        return np.divide(
            totals[:, 0], totals[:, 1], out=np.zeros(len(totals)), where=totals[:, 1] > 0
        )

    def lift_of(chosen: NDArray[np.int64]) -> float:
        values = scores(chosen)
        return lift(float(values[0]), float(values[1:].mean()))

    values = scores(np.arange(len(sums)))
    return DirectedConsistency(
        score=float(values[0]),
        chance=float(values[1:].mean()),
        lift=resampling.estimate(lift_of),
        p_value=float(np.mean(values >= values[0])),
    )
