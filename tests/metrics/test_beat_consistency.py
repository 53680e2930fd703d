"""Scores, chance and lift, on beats that are known."""

import itertools
import math

import numpy as np
import pytest
from scipy.special import erf, erfcx

from cospeech.metrics.beat_consistency import (
    BeatClip,
    MotionBeats,
    SpeechOnsets,
    StressedSyllables,
    beat_clip,
    beat_consistency,
    beat_scores,
    lag_profile,
    lift,
)
from cospeech.metrics.beat_consistency.scores import circular_shifts, cut_from
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.speech.speech import Speech

SECONDS = 60.0


def at_random(rng, rate, seconds=SECONDS):
    return np.sort(rng.uniform(0, seconds, rng.poisson(rate * seconds)))


def evenly(rng, rate, seconds=SECONDS):
    return np.arange(rng.random() / rate, seconds, 1 / rate)


def syllables(rng, rate=3.0, seconds=SECONDS, start=0.0):
    """Beats whose gaps are neither even nor random: between 0.2 and 1.8 times the mean."""
    gaps = rng.uniform(0.2, 1.8, round(2 * rate * seconds)) / rate
    times = start + np.cumsum(gaps)
    return times[times < seconds]


def clips_of(motion, count=20, seed=0, speech=syllables):
    rng = np.random.default_rng(seed)
    found = []
    for i in range(count):
        spoken = speech(rng)
        found.append(BeatClip(f"take{i}", motion(rng, spoken), spoken, SECONDS))
    return found


def test_the_score_by_hand_and_by_brute_force():
    beats, others = np.array([1.0, 2.0, 5.0]), np.array([1.1, 1.8])
    by_hand = [math.exp(-0.5), math.exp(-2.0), math.exp(-(3.2**2) / 0.02)]
    assert beat_scores(beats, others, 0.1).tolist() == pytest.approx(by_hand)
    assert beat_scores(beats, np.zeros(0), 0.1).tolist() == [0, 0, 0]
    assert len(beat_scores(np.zeros(0), others, 0.1)) == 0
    rng = np.random.default_rng(0)
    a, b = at_random(rng, 2), at_random(rng, 3)
    nearest = np.abs(a[:, None] - b).min(1)
    np.testing.assert_allclose(beat_scores(a, b, 0.3), np.exp(-(nearest**2) / 0.18))


def test_chance_is_the_mean_over_mismatched_speech():
    """Against a loop that shifts the speech and scores it, one shift at a time."""
    rng = np.random.default_rng(0)
    spoken = syllables(rng)
    gap = (spoken[-1] - spoken[0]) / (len(spoken) - 1)
    start, duration = spoken[0] - gap / 2, spoken[-1] - spoken[0] + gap
    moved = at_random(rng, 1.5)
    inside = moved[(moved >= start) & (moved < start + duration)]
    found = beat_consistency([BeatClip("a", moved, spoken, SECONDS)], mismatched=30, seed=7)
    scores = []
    for shift in circular_shifts(duration, 30, np.random.default_rng(7)):
        shifted = np.sort((spoken - start - shift) % duration) + start
        scores.append((beat_scores(shifted, inside).mean(), beat_scores(inside, shifted).mean()))
    for directed, column in ((found.audio_to_motion, 0), (found.motion_to_audio, 1)):
        assert directed.chance == pytest.approx(np.mean(scores, axis=0)[column])
    assert found.motion_to_audio.score == pytest.approx(beat_scores(inside, spoken).mean())


def test_lift_by_hand():
    assert lift(0.6, 0.2) == pytest.approx(0.5)
    assert lift(0.1, 0.2) == pytest.approx(-0.125)
    assert lift(1, 0.7) == 1
    assert math.isnan(lift(1, 1))


def test_clips_add_up_by_beats():
    """One clip of two beats that both hit, one of a single beat that misses by sigma."""
    clips = [
        BeatClip("a", np.array([1.0, 2.0]), np.array([1.0, 2.0]), 3.0),
        BeatClip("b", np.array([2.1]), np.array([0.5, 2.0, 4.0]), 5.0),
    ]
    found = beat_consistency(clips, sigma_s=0.1)
    assert found.motion_to_audio.score == pytest.approx((2 + math.exp(-0.5)) / 3)
    assert found.audio_to_motion.score == pytest.approx((2 + math.exp(-0.5)) / 5, abs=1e-6)
    assert found.motion_beats_per_second == pytest.approx(3 / 8)
    assert found.audio_beats_per_second == pytest.approx(5 / 8)
    assert found.motion_to_audio.interval is None  # of two recordings


TABLE = [
    # sigma, beats per second, at random, evenly spaced: chance table of the metrics' definition
    (0.3, 0.5, 0.29, 0.38),
    (0.3, 1.0, 0.48, 0.66),
    (0.3, 1.5, 0.62, 0.81),
    (0.3, 2.0, 0.70, 0.88),
    (0.3, 3.0, 0.82, 0.95),
    (0.1, 1.0, 0.22, 0.26),
    (0.1, 2.0, 0.37, 0.48),
    (0.1, 3.0, 0.52, 0.65),
]


@pytest.mark.parametrize(("sigma", "rate", "published_random", "published_even"), TABLE)
def test_motion_that_never_heard_the_speech(sigma, rate, published_random, published_even):
    x = rate * sigma * math.sqrt(2)
    expected = {
        at_random: (x * math.sqrt(math.pi) * erfcx(x), published_random),
        evenly: (x * math.sqrt(math.pi) * erf(1 / (2 * x)), published_even),
    }
    for beats, (formula, published) in expected.items():
        clips = clips_of(lambda rng, _, beats=beats: beats(rng, rate), count=60, seed=3)
        found = beat_consistency(clips, sigma_s=sigma, resamples=200)
        assert found.audio_to_motion.score == pytest.approx(formula, abs=0.02)
        # the table is rounded, and from clips whose ends have fewer neighbours
        assert found.audio_to_motion.score == pytest.approx(published, abs=0.035)
        for directed in (found.audio_to_motion, found.motion_to_audio):
            low, high = directed.interval
            assert low < 0.01
            assert high > -0.01
            assert abs(directed.lift.value) < 0.08
            assert directed.p_value > 0.01
        chance = found.motion_to_audio.score
        assert (0.78 < chance < 0.95) if sigma == 0.3 else (0.48 < chance < 0.65)


def test_the_interval_covers_nothing_where_there_is_nothing():
    inside = 0
    for seed in range(40):
        clips = clips_of(lambda rng, _: at_random(rng, 1.5, 20.0), count=12, seed=seed)
        found = beat_consistency(clips, mismatched=40, resamples=200)
        low, high = found.motion_to_audio.interval
        inside += low <= 0 <= high
    assert inside >= 32  # of 95 % nominal; 12 recordings make percentiles a little narrow


def test_motion_that_is_the_speech_has_a_lift_of_one():
    found = beat_consistency(clips_of(lambda rng, spoken: spoken))
    for directed in (found.audio_to_motion, found.motion_to_audio):
        assert directed.score == pytest.approx(1)
        assert directed.lift.value == pytest.approx(1)
        assert directed.p_value == pytest.approx(1 / 101)


def test_half_of_the_beats_is_found_out_in_one_direction():
    found = beat_consistency(clips_of(lambda rng, spoken: spoken[::2]))
    assert found.motion_to_audio.lift.value == pytest.approx(1)
    assert 0.2 < found.audio_to_motion.lift.value < 0.5


def test_more_beats_raise_the_score_and_not_the_lift():
    lifts, scores = [], []
    for extra in (0.0, 2.0, 6.0):
        clips = clips_of(
            lambda rng, spoken, extra=extra: np.sort([*spoken[::3], *at_random(rng, extra)])
        )
        found = beat_consistency(clips)
        scores.append(found.audio_to_motion.score)
        lifts.append((found.audio_to_motion.lift.value, found.motion_to_audio.lift.value))
    assert scores[0] < scores[1] - 0.1 < scores[2] - 0.3
    for fewer, more in itertools.pairwise(lifts):
        assert more[0] < fewer[0] + 0.04
        assert more[1] < fewer[1] - 0.1


def test_a_lag_costs_lift_and_can_be_given():
    def late(rng, spoken):
        return spoken - 0.2 + rng.normal(0, 0.03, len(spoken))

    clips = clips_of(late, speech=lambda rng: syllables(rng, 1.5))
    lags = (-0.4, -0.2, 0.0, 0.1, 0.2, 0.3, 0.4)
    profile = lag_profile(clips, lags)
    assert profile.argmax(axis=0).tolist() == [4, 4]
    assert (profile[4] > 0.9).all()
    assert (profile[2] < 0.2).all()
    assert beat_consistency(clips, lag_s=0.2).motion_to_audio.lift.value == profile[4, 1]


def test_frozen_motion_gets_nothing_and_is_counted():
    clips = clips_of(lambda rng, spoken: np.zeros(0))
    found = beat_consistency(clips)
    for directed in (found.audio_to_motion, found.motion_to_audio):
        assert (directed.score, directed.chance, directed.lift.value) == (0, 0, 0)
        assert directed.p_value == 1
    assert (found.clips, found.clips_without_motion_beats) == (20, 20)


def test_moving_in_one_clip_alone_does_not_pay():
    rng = np.random.default_rng(0)
    clips = clips_of(lambda rng, spoken: np.zeros(0), count=19)
    spoken = syllables(rng)
    clips.append(BeatClip("careful", spoken[:1], spoken, SECONDS))
    found = beat_consistency(clips)
    assert found.motion_to_audio.lift.value == pytest.approx(1)
    assert found.audio_to_motion.lift.value < 0.001
    assert found.clips_without_motion_beats == 19


def test_clips_without_speech_are_counted():
    clips = clips_of(lambda rng, spoken: spoken, count=6)
    silent = [BeatClip(f"s{n}", np.array([1.0]), np.arange(n) + 1.0, 9.0) for n in (0, 1)]
    found = beat_consistency([*clips, *silent])
    assert (found.clips, found.clips_without_audio_beats, found.recordings) == (8, 2, 6)
    assert found.motion_to_audio.score == pytest.approx(1)
    with pytest.raises(ValueError, match="none of 2 clips has two beats of speech"):
        beat_consistency(silent)


def test_silence_before_and_after_is_not_in_time_with_anything():
    """All recordings begin and end silent and at rest; nothing else is shared."""

    def spoken(rng):
        return syllables(rng, start=12.0)[:90]

    clips = clips_of(lambda rng, own: syllables(rng, 1.5, 42.0, 12.0), speech=spoken)
    found = beat_consistency(clips)
    for directed in (found.audio_to_motion, found.motion_to_audio):
        low, high = directed.interval
        assert low < 0.01 < 0.05 > high - 0.05


def test_fast_speakers_that_move_fast_are_not_in_time():
    """Why speech is mismatched by shifts: other recordings' speech finds what is not there."""
    rng = np.random.default_rng(0)
    clips = []
    for i in range(24):
        pace = (0.7, 3.0)[i % 2]
        clips.append(
            BeatClip(f"r{i}", at_random(rng, 1.5 * pace), syllables(rng, 2 * pace), SECONDS)
        )
    shifts = beat_consistency(clips, mismatch="shifts").motion_to_audio
    others = beat_consistency(clips, mismatch="recordings").motion_to_audio
    assert shifts.score == others.score
    assert abs(shifts.lift.value) < 0.03
    assert others.lift.value > 0.2


def test_both_mismatches_agree_where_speakers_are_alike():
    clips = clips_of(lambda rng, spoken: spoken[::2] + 0.05)
    lifts = [
        beat_consistency(clips, mismatch=mismatch).motion_to_audio.lift.value
        for mismatch in ("shifts", "recordings")
    ]
    assert lifts[0] == pytest.approx(lifts[1], abs=0.02)


def test_shifts_and_cuts_keep_the_beats():
    shifts = circular_shifts(40.0, 25, np.random.default_rng(0))
    assert 10 <= shifts.min() < shifts.max() <= 30
    beats = np.array([1.0, 4.0, 9.0])
    np.testing.assert_allclose(cut_from(beats, 10.0, 4.0, 10.0), [0.0, 5.0, 7.0])
    np.testing.assert_allclose(cut_from(beats, 10.0, 4.0, 6.0), [0.0, 5.0])
    np.testing.assert_allclose(cut_from(beats, 10.0, 4.0, 16.0), [0.0, 5.0, 7.0, 10.0, 15.0])


def test_the_seed_decides():
    clips = clips_of(lambda rng, spoken: at_random(rng, 1.0))
    first, again, other = (beat_consistency(clips, seed=seed) for seed in (1, 1, 2))
    assert first.motion_to_audio.chance == again.motion_to_audio.chance
    assert first.motion_to_audio.interval == again.motion_to_audio.interval
    assert first.motion_to_audio.chance != other.motion_to_audio.chance


def test_what_cannot_be_scored_is_refused():
    clips = clips_of(lambda rng, spoken: spoken, count=1)
    with pytest.raises(ValueError, match="20 mismatched audios or more, got 19"):
        beat_consistency(clips, mismatched=19)
    with pytest.raises(ValueError, match="one recording has no other's speech"):
        beat_consistency(clips, mismatch="recordings")


def test_rates_that_are_not_what_they_say_are_refused():
    motion = Motion(UPPER_BODY, 20.0, np.zeros((150, 10, 3), np.float32))
    speech = Speech(np.zeros(160_000, np.float32))
    with pytest.raises(ValueError, match=r"take: 150 frames at 20 fps are 7.50 s, 160000 samples"):
        beat_clip("take", motion, speech, MotionBeats(), SpeechOnsets())
    right = Motion(UPPER_BODY, 15.0, motion.positions)
    assert beat_clip("take", right, speech, MotionBeats(), SpeechOnsets()).duration == 10


def test_a_recorded_person_gestures_before_the_syllable(shared):
    """ZEGGS, one minute: gestures lead by about 0.2 s, as studies of gesture have it."""
    import soundfile

    from cospeech.motion.bvh import read_bvh
    from cospeech.motion.upper_body import to_upper_body

    folder = shared / "data/real/zeggs"
    waveform, rate = soundfile.read(folder / "067_Speech_2_x_1_0.wav", dtype="float32")
    assert rate == 16000
    motion = to_upper_body(read_bvh(folder / "067_Speech_2_x_1_0.bvh"))
    clip = beat_clip("067", motion, Speech(waveform), MotionBeats(), StressedSyllables())
    lags = (-0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6)
    assert lag_profile([clip], lags).argmax(axis=0).tolist() == [4, 4]
    found = beat_consistency([clip], lag_s=0.2)
    assert found.motion_to_audio.lift.value > 0.1
    assert found.motion_to_audio.p_value < 0.03
    assert found.audio_to_motion.p_value < 0.03


def test_the_embedded_corpus_gestures_before_stressed_syllables():
    """Its strokes begin about 0.2 s before their causes."""
    from cospeech.corpus.synthetic import synthesise
    from cospeech.motion.upper_body import to_upper_body

    clips = [
        beat_clip(
            recording.id,
            to_upper_body(recording.motion),
            recording.speech,
            MotionBeats(),
            StressedSyllables(),
        )
        for recording in synthesise(8, seed=0, speakers=8, fps=15)
    ]
    found = beat_consistency(clips, lag_s=0.2)
    for directed in (found.audio_to_motion, found.motion_to_audio):
        assert directed.interval[0] > 0
        assert directed.p_value < 0.02
    mismatched = [
        BeatClip(a.recording, a.motion_beats, b.audio_beats, b.duration)
        for a, b in zip(clips, clips[1:] + clips[:1], strict=True)
    ]
    other = beat_consistency(mismatched, lag_s=0.2)
    assert other.motion_to_audio.lift.value < 0.5 * found.motion_to_audio.lift.value
    assert other.motion_to_audio.interval[0] < 0
