"""Looking at one recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.recording import Recording
from cospeech.doctor.audio import check_signal, check_silence, level_db
from cospeech.doctor.body import find_body
from cospeech.doctor.findings import Check, Files, Finding, has_errors
from cospeech.doctor.fingerprints import Fingerprints, audio_fingerprints, motion_fingerprints
from cospeech.doctor.lengths import Lengths, check_lengths
from cospeech.doctor.motion import (
    check_finite,
    check_jumps,
    check_swaps,
    find_swaps,
)
from cospeech.doctor.posture import check_picture, check_sides, check_units, check_vertical
from cospeech.doctor.standstill import check_standstills, find_standstills
from cospeech.doctor.stretches import word_intervals
from cospeech.doctor.transcript import Doubt, check_transcript
from cospeech.doctor.words import check_word_rate, check_words_end

MOST_WORDS_SHARE = 2.0
"""Words that go on for longer than this share of the audio are not looked for in it: their times
are in another unit."""

SPREAD_TIMING = "spread"
"""``annotations["word_timing"]`` of words that were spread over a text: no times to judge."""


@dataclass(frozen=True, eq=False)
class Traces:
    """What is kept of a recording to compare it with the others.

    Attributes:
        id: Recording id.
        speaker: Speaker name.
        files: What its parts are called.
        parts: Split, first and last second of each part that is in a split.
        lengths: Of the recording before anything was cut, where known and it has audio.
        audio: Fingerprints of its audio.
        motion: Fingerprints of its motion.
        words: ``(W, 2)`` word intervals, s; None without a transcript.
        doubt: A transcript that does not fit.
    """

    id: str
    speaker: str
    files: Files
    parts: tuple[tuple[str, float, float], ...]
    lengths: Lengths | None
    audio: Fingerprints
    motion: Fingerprints
    words: NDArray[np.float64] | None
    doubt: Doubt | None


@dataclass(frozen=True, eq=False)
class Examination:
    """Findings about one recording, and its traces."""

    findings: list[Finding]
    traces: Traces
    seconds: float


def examine(recording: Recording, files: Files | None = None) -> list[Finding]:
    """Every check that needs no other recording.

    Args:
        recording: As a reader yields it.
        files: What its parts are called; its ``source``, else its id, when None.
    """
    return examine_closely(recording, files).findings


def examine_closely(
    recording: Recording,
    files: Files | None = None,
    lengths: Lengths | None = None,
    parts: tuple[tuple[str, float, float], ...] | None = None,
) -> Examination:
    """`examine`, keeping what comparing recordings needs.

    Args:
        recording: As a reader yields it.
        files: What its parts are called.
        lengths: Before the reader cut anything; those of the recording when None.
        parts: Split, first and last second of its parts; all of it in its published split when
            None.
    """
    if files is None:
        files = Files.all_in(recording.source or recording.id)
    speech, motion = recording.speech, recording.motion
    duration = speech.duration or motion.duration
    if parts is None:
        parts = () if recording.split is None else ((recording.split, 0.0, duration),)
    silent = bool(recording.annotations.get("silent"))
    has_audio = len(speech.waveform) > 0 and not silent
    findings: list[Finding] = []
    if has_audio and lengths is None:
        lengths = Lengths(motion.duration, speech.duration, motion.fps)
        findings += check_lengths(lengths, files)
    findings += _examine_motion(recording, files)
    doubt = None
    if has_audio:
        heard, doubt = _examine_speech(recording, files)
        findings += heard
    elif speech.words is not None:
        findings += check_words_end(speech.words, duration, files)
    traces = Traces(
        recording.id,
        recording.speaker,
        files,
        parts,
        lengths,
        audio_fingerprints(speech.waveform if has_audio else speech.waveform[:0]),
        motion_fingerprints(motion),
        word_intervals(speech.words) if speech.words else None,
        doubt,
    )
    return Examination(findings, traces, duration)


def _examine_speech(recording: Recording, files: Files) -> tuple[list[Finding], Doubt | None]:
    speech = recording.speech
    is_dialogue = recording.interlocutor is not None
    findings = list(check_signal(speech.waveform, files, is_dialogue))
    is_heard = not any(f.check in (Check.NOT_A_NUMBER, Check.SILENT) for f in findings)
    intervals = word_intervals(speech.words)
    ends = list(check_words_end(speech.words or (), speech.duration, files))
    words = list(check_word_rate(speech, files))
    is_timed = recording.annotations.get("word_timing") != SPREAD_TIMING
    in_seconds = len(intervals) > 0 and intervals.max() < MOST_WORDS_SHARE * speech.duration
    doubt = None
    if is_heard and is_timed and in_seconds and not has_errors(words):
        verdict = check_transcript(level_db(speech.waveform), intervals, files)
        words += verdict.findings
        doubt = verdict.doubt
        ends = [] if verdict.misplaced else ends
    words += ends
    if is_heard:
        fitting = intervals if is_timed and not has_errors(words) else intervals[:0]
        findings += check_silence(speech.waveform, fitting, files)
    return findings + words, doubt


def _examine_motion(recording: Recording, files: Files) -> list[Finding]:
    motion = recording.motion
    findings = list(check_finite(motion, files))
    if findings:
        return findings
    body = find_body(motion)
    swaps = np.zeros(0, np.int64)
    if body is not None:
        findings += check_units(body, files)
        if body.scale < 1e-9:
            return findings
        vertical = list(check_vertical(body, files))
        findings += vertical
        swaps = find_swaps(motion, body)
        findings += check_swaps(motion, swaps, files)
        if not vertical and len(swaps) == 0:
            findings += check_sides(body, motion, files)
    findings += check_picture(motion, files)
    standstills = find_standstills(motion, body)
    findings += check_standstills(motion, standstills, files)
    ends = [frame for still in standstills for frame in (still.start, still.stop)]
    inside = [frame for frame in ends if 0 < frame < len(motion)]
    explained = np.concatenate([swaps, np.array(inside, np.int64)])
    findings += check_jumps(motion, body, explained, files)
    return findings
