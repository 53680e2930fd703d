"""Beats of motion and of speech that are known."""

import numpy as np
import pytest

from cospeech.metrics.beat_consistency import MotionBeats, SpeechOnsets, StressedSyllables
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY

LEFT, RIGHT = UPPER_BODY.index["left_wrist"], UPPER_BODY.index["right_wrist"]


def moving(path, seconds, fps=15.0, joints=(LEFT, RIGHT)):
    """Wrists that follow ``path(times) -> metres`` along x."""
    times = np.arange(round(seconds * fps)) / fps
    positions = np.zeros((len(times), 10, 3), np.float32)
    for joint in joints:
        positions[:, joint, 0] = path(times)
    return Motion(UPPER_BODY, fps, positions)


def reach(times, start, stop, metres=0.3):
    """Minimum jerk from 0 to ``metres``."""
    part = np.clip((times - start) / (stop - start), 0, 1)
    return metres * part**3 * (10 - 15 * part + 6 * part**2)


@pytest.mark.parametrize("phase", [0.0, 0.3, 0.7, 1.1])
@pytest.mark.parametrize("rate", [0.6, 1.0])
def test_a_swinging_hand_beats_where_it_turns(rate, phase):
    beats = MotionBeats()(moving(lambda t: 0.15 * np.sin(2 * np.pi * rate * t + phase), 10))
    turns = (np.arange(-2, 40) + 0.5 - phase / np.pi) / (2 * rate)
    turns = turns[(turns > 0.3) & (turns < 9.7)]
    inside = beats[(beats > 0.2) & (beats < 9.8)]
    assert 0 <= len(inside) - len(turns) <= 2  # those within 0.1 s of an end may be seen
    inside = inside[np.abs(inside[:, None] - turns).argmin(axis=0)]
    # a fifth of a frame; frames alone are off by up to half
    assert np.abs(inside - turns).max() < 0.2 / 15
    steps = (np.round(turns * 15 - 0.5) + 0.5) / 15
    assert np.abs(inside - turns).mean() < 0.5 * np.abs(steps - turns).mean()


@pytest.mark.parametrize("fps", [15.0, 30.0, 60.0])
def test_holds_are_one_beat_each_at_their_beginning(fps):
    def path(times):
        return reach(times, 1.0, 1.5) - reach(times, 3.0, 3.5) + reach(times, 5.0, 5.6)

    beats = MotionBeats()(moving(path, 8, fps))
    # the last hold lasts to the end; the rest before the first stroke has no beginning
    np.testing.assert_allclose(beats, [1.5, 3.5, 5.6], atol=0.05)


def test_beats_do_not_depend_on_the_frame_rate():
    def path(times):
        return 0.12 * np.sin(2 * np.pi * 0.7 * times) + 0.05 * np.sin(2 * np.pi * 1.1 * times)

    coarse, fine = (MotionBeats()(moving(path, 12, fps)) for fps in (15.0, 60.0))
    coarse, fine = (beats[beats < 11.7] for beats in (coarse, fine))
    assert len(coarse) == len(fine)
    np.testing.assert_allclose(coarse, fine, atol=0.02)


def test_either_hand_can_beat():
    both = MotionBeats()(moving(lambda t: 0.2 * np.sin(2 * np.pi * t), 6))
    one = MotionBeats()(moving(lambda t: 0.2 * np.sin(2 * np.pi * t), 6, joints=(RIGHT,)))
    np.testing.assert_allclose(one, both, atol=1e-3)


def test_what_is_too_small_to_be_seen_is_no_beat():
    assert len(MotionBeats()(moving(lambda t: np.zeros_like(t), 5))) == 0
    assert len(MotionBeats()(moving(lambda t: 0.01 * np.sin(2 * np.pi * t), 5))) == 0
    noise = np.random.default_rng(0)
    held = moving(lambda t: reach(t, 1.0, 1.5) + noise.normal(0, 0.001, len(t)), 5)
    assert len(MotionBeats()(held)) == 1
    swinging = moving(lambda t: 0.2 * np.sin(2 * np.pi * t), 5)
    assert len(MotionBeats(prominence=3)(swinging)) == 0


def test_a_motion_of_no_steps_has_no_beats():
    for frames in range(4):
        assert len(MotionBeats()(moving(lambda t: t, frames / 15))) == 0


def test_motion_that_cannot_be_read_is_named():
    motion = moving(lambda t: t, 2)
    with pytest.raises(ValueError, match=r"left_knee: skeleton upper_body has no such joint"):
        MotionBeats(joints=("left_knee",))(motion)
    motion.positions[3, LEFT, 1] = np.nan
    with pytest.raises(ValueError, match="NaN"):
        MotionBeats()(motion)


def syllables(starts, levels, seconds):
    """Vowel-like tones that rise within 30 ms and die away, over faint noise."""
    rng = np.random.default_rng(0)
    times = np.arange(round(seconds * 16000)) / 16000
    audio = 1e-4 * rng.standard_normal(len(times))
    for start, level in zip(starts, levels, strict=True):
        part = times - start
        envelope = np.clip(part / 0.03, 0, 1) * np.exp(-np.clip(part, 0, None) / 0.05)
        tone = sum(np.sin(2 * np.pi * hertz * times) for hertz in (140, 560, 1120, 2240))
        audio += level * envelope * tone
    return audio.astype(np.float32)


@pytest.mark.parametrize("detector", [SpeechOnsets(), StressedSyllables()], ids=repr)
def test_syllables_beat_where_they_begin(detector):
    starts = np.array([0.5, 0.83, 1.31, 1.72, 2.4, 2.9, 3.47])
    beats = detector(syllables(starts, np.full(7, 0.1), 4.5), 16000)
    # at 0 the faint noise begins
    np.testing.assert_allclose(beats[beats > 0.2], starts, atol=0.03)


def test_stressed_syllables_are_the_loud_ones_whatever_the_gain():
    starts = np.array([0.5, 0.8, 1.1, 1.4, 1.7, 2.0, 2.3])
    levels = np.array([0.1, 0.05, 0.05, 0.1, 0.05, 0.05, 0.1])
    audio = syllables(starts, levels, 3)
    beats = StressedSyllables()(audio, 16000)
    np.testing.assert_allclose(beats, starts[levels > 0.07], atol=0.03)
    np.testing.assert_array_equal(StressedSyllables()(0.1 * audio, 16000), beats)
    assert len(StressedSyllables(within_db=10)(audio, 16000)) == 7


@pytest.mark.parametrize("detector", [SpeechOnsets(), StressedSyllables()], ids=repr)
def test_silence_has_no_beats_and_wrong_audio_is_refused(detector):
    assert len(detector(np.zeros(16000, np.float32), 16000)) == 0
    assert len(detector(np.zeros(0, np.float32), 16000)) == 0
    with pytest.raises(ValueError, match="beats of audio at 22050 Hz: resample it to 16000 Hz"):
        detector(np.zeros(16000, np.float32), 22050)
    with pytest.raises(ValueError, match="shape"):
        detector(np.zeros((16000, 2), np.float32), 16000)
