"""Looking at one recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.recording import Recording
from cospeech.doctor.audio import check_audio, level_db
from cospeech.doctor.body import find_body
from cospeech.doctor.findings import Check, Files, Finding, Severity, has_errors
from cospeech.doctor.fingerprints import Fingerprints, audio_fingerprints, motion_fingerprints
from cospeech.doctor.lengths import Lengths, check_lengths
from cospeech.doctor.motion import (
    check_finite,
    check_frozen,
    check_jumps,
    check_swaps,
    find_swaps,
)
from cospeech.doctor.posture import check_sides, check_units, check_vertical
from cospeech.doctor.stretches import word_intervals
from cospeech.doctor.transcript import Doubt, check_transcript
from cospeech.doctor.words import check_word_rate, check_words_end
from cospeech.motion.joint_map import JointMap

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


def examine(
    recording: Recording, files: Files | None = None, joint_map: JointMap | None = None
) -> list[Finding]:
    """Every check that needs no other recording.

    Args:
        recording: As a reader yields it.
        files: What its parts are called; its ``source``, else its id, when None.
        joint_map: Where the evaluation joints are; found by the joints' names when None.
    """
    return examine_closely(recording, files, joint_map).findings


def examine_closely(
    recording: Recording,
    files: Files | None = None,
    joint_map: JointMap | None = None,
    lengths: Lengths | None = None,
    parts: tuple[tuple[str, float, float], ...] | None = None,
) -> Examination:
    """`examine`, keeping what comparing recordings needs.

    Args:
        recording: As a reader yields it.
        files: What its parts are called.
        joint_map: Where the evaluation joints are.
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
    if has_audio:
        findings += check_audio(speech, files)
        if lengths is None:
            lengths = Lengths(motion.duration, speech.duration, motion.fps)
            findings += check_lengths(lengths, files)
    audio_is_fine = has_audio and not has_errors(findings)
    findings += _examine_motion(recording, files, joint_map)
    intervals = word_intervals(speech.words)
    doubt = None
    if speech.words is not None:
        findings += check_words_end(speech.words, duration, files)
        if has_audio:
            findings += check_word_rate(speech, files, recording.interlocutor is not None)
        timed = recording.annotations.get("word_timing") != SPREAD_TIMING
        if audio_is_fine and timed and not _has(findings, Check.WORD_TIMES):
            fits, doubt = check_transcript(level_db(speech.waveform), intervals, files)
            findings += fits
    traces = Traces(
        recording.id,
        recording.speaker,
        files,
        parts,
        lengths,
        audio_fingerprints(speech.waveform if has_audio else speech.waveform[:0]),
        motion_fingerprints(motion),
        intervals if speech.words else None,
        doubt,
    )
    return Examination(findings, traces, duration)


def _examine_motion(
    recording: Recording, files: Files, joint_map: JointMap | None
) -> list[Finding]:
    motion = recording.motion
    findings = check_finite(motion, files)
    if findings:
        return findings
    body = find_body(motion, joint_map)
    swaps = np.zeros(0, np.int64)
    if body is not None:
        units = check_units(body, files)
        if body.scale < 1e-9:
            return units
        findings += units
        vertical = check_vertical(body, files)
        findings += vertical
        swaps = find_swaps(motion, body)
        findings += check_swaps(motion, swaps, files)
        if not vertical and len(swaps) == 0:
            findings += check_sides(body, motion, joint_map, files)
    findings += check_frozen(motion, body, files)
    findings += check_jumps(motion, body, swaps, files)
    return findings


def _has(findings: list[Finding], check: Check) -> bool:
    return any(f.check is check and f.severity is Severity.ERROR for f in findings)
