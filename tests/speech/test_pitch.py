"""F0 of signals whose pitch is known, and of real speech against Praat."""

import numpy as np
import pytest
import scipy.signal

from cospeech.speech.audio import load_audio
from cospeech.speech.pitch import SPEECH_PITCH, PitchSpec, f0

RATE = 16000


def pulse_train(hz, seconds=1.0):
    """A buzz rich in harmonics, as a voice is: its waveform repeats with period 1 / hz."""
    phase = 2 * np.pi * np.cumsum(np.broadcast_to(hz, round(seconds * RATE))) / RATE
    harmonics = np.arange(1, 9)[:, None]
    return (0.1 * np.cos(harmonics * phase) / harmonics).sum(axis=0).astype(np.float32)


@pytest.mark.parametrize("hz", [80.0, 110.0, 163.7, 220.0, 333.3, 480.0])
def test_a_buzz_has_its_pitch(hz):
    track = f0(pulse_train(hz))
    assert track.shape == (101,)
    assert track.dtype == np.float32
    np.testing.assert_allclose(track[5:-5], hz, rtol=1e-3)


@pytest.mark.parametrize("hz", [100.0, 250.0, 400.0])
def test_a_sine_has_its_pitch(hz):
    waveform = np.sin(2 * np.pi * hz * np.arange(RATE) / RATE).astype(np.float32)
    np.testing.assert_allclose(f0(waveform)[5:-5], hz, rtol=1e-3)


def test_a_missing_fundamental_is_heard():
    time = np.arange(RATE) / RATE
    waveform = np.cos(2 * np.pi * 150 * np.outer([2, 3, 4, 5], time)).sum(axis=0)
    np.testing.assert_allclose(f0((0.2 * waveform).astype(np.float32))[5:-5], 150, rtol=1e-3)


def test_a_glide_is_followed_in_time():
    seconds = 2.0
    hz = 120 * 2 ** (np.arange(round(seconds * RATE)) / RATE / seconds)  # an octave in 2 s
    track = f0(pulse_train(hz, seconds))
    expected = 120 * 2 ** (np.arange(201) * 0.01 / seconds)  # frame i is centred at 10 i ms
    np.testing.assert_allclose(track[5:-5], expected[5:-5], rtol=3e-3)


def test_silence_and_noise_are_unvoiced():
    assert np.isnan(f0(np.zeros(RATE, dtype=np.float32))).all()
    noise = np.random.default_rng(0).normal(size=3 * RATE).astype(np.float32) * 0.1
    assert np.isnan(f0(noise)).mean() > 0.95


def test_only_the_voiced_part_is_voiced():
    rng = np.random.default_rng(1)
    waveform = np.concatenate([np.zeros(RATE), pulse_train(200.0), np.zeros(RATE)])
    waveform = (waveform + 1e-4 * rng.normal(size=len(waveform))).astype(np.float32)
    voiced = np.flatnonzero(~np.isnan(f0(waveform)))
    assert abs(voiced[0] - 100) <= 1  # 1.00 s
    assert abs(voiced[-1] - 200) <= 1
    assert len(voiced) == voiced[-1] - voiced[0] + 1


def test_a_constant_offset_changes_nothing():
    waveform = pulse_train(140.0)
    np.testing.assert_allclose(f0(waveform + 0.3), f0(waveform), rtol=1e-4)


def test_the_level_changes_nothing():
    waveform = pulse_train(140.0)
    np.testing.assert_allclose(f0(waveform * 0.01), f0(waveform), rtol=1e-4)


def test_pitch_out_of_range_is_not_reported():
    track = f0(pulse_train(150.0), PitchSpec(lowest_hz=200.0, highest_hz=500.0))
    assert np.nanmin(track, initial=200.0) >= 200.0
    with pytest.raises(ValueError, match="pitch is looked for between 0 and 4000 Hz"):
        PitchSpec(lowest_hz=500.0, highest_hz=100.0)


def test_a_range_narrower_than_the_candidates():
    track = f0(pulse_train(410.0), PitchSpec(lowest_hz=400.0, highest_hz=420.0))
    np.testing.assert_allclose(track[5:-5], 410.0, rtol=2e-3)


def test_another_hop_gives_the_same_pitch_at_its_own_frames():
    hz = 120 + 40 * np.sin(np.linspace(0, 6, 2 * RATE))
    waveform = pulse_train(hz, 2.0)
    fine, coarse = f0(waveform, PitchSpec(hop_samples=80)), f0(waveform)
    np.testing.assert_allclose(fine[10:-10:2], coarse[5:-5], rtol=1e-3)


@pytest.mark.parametrize("samples", [1, 10, 160, 640, 641])
def test_short_waveforms(samples):
    assert f0(pulse_train(200.0)[:samples]).shape == (1 + samples // SPEECH_PITCH.hop_samples,)


@pytest.mark.parametrize("waveform", [np.zeros(0, np.float32), np.zeros((2, 9)), np.zeros(9, int)])
def test_what_is_no_waveform_is_refused(waveform):
    with pytest.raises(ValueError, match="a waveform is"):
        f0(waveform)


def agreement(waveform, track):
    """Share of frames with Praat's voicing, median difference in Hz, share off by over 20 %."""
    parselmouth = pytest.importorskip("parselmouth")
    sound = parselmouth.Sound(waveform.astype(np.float64), RATE)
    pitch = sound.to_pitch_ac(time_step=0.01, pitch_floor=75, pitch_ceiling=500)
    frame = np.round((np.arange(len(track)) * 0.01 - pitch.t1) / pitch.dt).astype(int)
    near = pitch.selected_array["frequency"][np.clip(frame, 0, pitch.n_frames - 1)]
    at_time = np.array([pitch.get_value_at_time(i * 0.01) for i in range(len(track))])
    both = ~np.isnan(track) & ~np.isnan(at_time)
    return (
        np.mean(np.isnan(track) == (near == 0)),
        np.median(np.abs(track - at_time)[both]),
        np.mean(np.abs(track / at_time - 1)[both] > 0.2),
    )


RECORDINGS = {
    "speech/jfk/jfk.flac": 0.98,
    "speech/librispeech/2412-153948-0000.flac": 0.96,
    "speech/librispeech/61-70968-0000.flac": 0.95,
    "speech/ami/ES2011a.Headset-0-40s-46s.wav": 0.98,
    "speech/mfa/acoustic_corpus.wav": 0.94,
    "beat/2_scott_0_1_1.wav": 0.96,
    "zeggs/067_Speech_2_x_1_0.wav": 0.97,
}


@pytest.mark.parametrize(("name", "same_voicing"), RECORDINGS.items())
def test_real_speech_agrees_with_praat(shared, name, same_voicing):
    waveform = load_audio(shared / "data/real" / name)
    voicing, difference_hz, gross = agreement(waveform, f0(waveform))
    assert voicing > same_voicing
    assert difference_hz < 0.3
    assert gross < 0.01


def test_a_filtered_buzz_agrees_with_praat():
    # a vowel: a buzz through two formants
    waveform = pulse_train(130 + 30 * np.sin(np.linspace(0, 12, 3 * RATE)), 3.0)
    for hz, width in ((700, 80), (1200, 100)):
        radius = np.exp(-np.pi * width / RATE)
        poles = [1, -2 * radius * np.cos(2 * np.pi * hz / RATE), radius**2]
        waveform = scipy.signal.lfilter([1], poles, waveform)
    waveform = (waveform / np.abs(waveform).max() / 2).astype(np.float32)
    voicing, difference_hz, gross = agreement(waveform, f0(waveform))
    assert voicing > 0.97
    assert difference_hz < 0.1
    assert gross == 0
