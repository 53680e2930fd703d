"""Clipped, silent and broken audio, and lengths."""

from dataclasses import replace

import numpy as np
import pytest

from cospeech.doctor import Check, Severity, examine
from cospeech.doctor.findings import Files
from cospeech.doctor.lengths import Lengths, check_clock, check_lengths
from cospeech.doctor.stretches import stretches
from tests.doctor.planted import the_error, the_warning, with_waveform

FILES = Files("take.bvh", "take.wav", "take.tsv")


def test_clean_takes_pass(takes, long_take):
    for recording in (*takes, long_take):
        assert examine(recording) == []


def test_stretches_by_hand():
    mask = np.array([1, 1, 0, 1, 0, 0, 1, 1, 1], dtype=bool)
    assert stretches(mask).tolist() == [[0, 2], [3, 4], [6, 9]]
    assert stretches(np.zeros(3, dtype=bool)).tolist() == []


def test_clipped_audio(takes):
    waveform = takes[0].speech.waveform
    clipped = np.clip(waveform * (4 / np.abs(waveform).max()), -1, 1)
    finding = the_error(examine(with_waveform(takes[0], clipped), FILES), Check.CLIPPED)
    first = np.argmax(np.abs(clipped) >= 1)
    assert finding.file == "take.wav"
    assert finding.time_s == pytest.approx(first / 16000, abs=0.2)
    assert "1.00 of full scale" in finding.problem


def test_clipping_is_found_after_the_gain_was_lowered(takes):
    waveform = takes[0].speech.waveform
    clipped = 0.4 * np.clip(waveform * (4 / np.abs(waveform).max()), -1, 1)
    finding = the_error(examine(with_waveform(takes[0], clipped)), Check.CLIPPED)
    assert "0.40 of full scale" in finding.problem


def test_a_normalised_peak_is_no_clipping(takes):
    waveform = takes[0].speech.waveform
    assert examine(with_waveform(takes[0], waveform / np.abs(waveform).max())) == []


def test_silent_audio(takes):
    noise = np.random.default_rng(0).normal(0, 2e-4, len(takes[0].speech.waveform))
    for waveform in (noise, np.zeros_like(noise)):
        finding = the_error(examine(with_waveform(takes[0], waveform), FILES), Check.SILENT)
        assert finding.time_s is None


def test_audio_lost_under_words(long_take):
    waveform = long_take.speech.waveform.copy()
    waveform[20 * 16000 : 26 * 16000] = 0
    finding = the_error(examine(with_waveform(long_take, waveform), FILES), Check.SILENT, 20.0)
    assert "from 20.00 to 26.00 s" in finding.problem
    assert finding.file == "take.wav"


def test_a_listeners_silence_is_only_a_warning(takes):
    waveform = np.concatenate([takes[0].speech.waveform, np.zeros(16000 * 12, np.float32)])
    motion = takes[0].motion
    frames = np.arange(len(motion) + 12 * 60)
    frames = np.where(frames < len(motion), frames, 2 * len(motion) - 1 - frames)
    longer = replace(
        motion,
        positions=motion.positions[frames],
        rotations_local=motion.rotations_local[frames],
    )
    recording = replace(with_waveform(takes[0], waveform), motion=longer)
    the_warning(examine(recording), Check.SILENT, takes[0].speech.duration)


def test_nan_in_audio(takes):
    waveform = takes[0].speech.waveform.copy()
    waveform[5 * 16000] = np.nan
    the_error(examine(with_waveform(takes[0], waveform)), Check.NOT_A_NUMBER, 5.0)


def test_a_tail_and_a_missing_end():
    (finding,) = check_lengths(Lengths(70.0, 63.1, 60.0), FILES)
    assert (finding.check, finding.severity, finding.file) == (
        Check.LENGTHS, Severity.ERROR, "take.bvh",
    )  # fmt: skip
    assert "6.90 s of motion are without the other" in finding.problem
    assert finding.time_s == 63.1
    (finding,) = check_lengths(Lengths(63.8, 64.097, 15.0), FILES)
    assert finding.severity is Severity.WARNING
    assert list(check_lengths(Lengths(64.0, 64.1, 15.0), FILES)) == []


@pytest.mark.parametrize(
    ("ratio", "audio_s", "severity"),
    [
        (14.985 / 15, 600.0, Severity.WARNING),
        (14.985 / 15, 1800.0, Severity.ERROR),
        (24 / 25, 60.0, Severity.ERROR),
        (44.1 / 48, 60.0, Severity.ERROR),
        (2.0, 60.0, Severity.ERROR),
    ],
)
def test_a_known_wrong_rate(ratio, audio_s, severity):
    frames = round(audio_s * ratio * 30)
    (finding,) = check_lengths(Lengths(frames / 30, audio_s, 30.0), FILES)
    assert (finding.check, finding.severity) == (Check.DRIFT, severity)
    assert f"data.frame_rate={30 * ratio:.4g}"[:20] in finding.next_step


def test_a_clock_that_is_wrong_in_the_whole_corpus():
    durations = (61.0, 75.0, 48.0, 90.0, 66.0)
    wrong = [(Lengths(round(0.9973 * s * 60) / 60, s, 60.0), FILES) for s in durations]
    (finding,) = check_clock(wrong)
    assert (finding.check, finding.severity) == (Check.DRIFT, Severity.ERROR)
    assert float(finding.next_step.rpartition("=")[2]) == pytest.approx(59.838, abs=0.02)
    cut = (0.3, 0, 1, 0.1, 0)
    tails = [(Lengths(s - tail, s, 60.0), FILES) for s, tail in zip(durations, cut, strict=True)]
    assert list(check_clock(tails)) == []
    assert list(check_clock([(Lengths(s, s, 60.0), FILES) for s in durations])) == []
