"""Log-mel, MFCC and energy against librosa, SciPy and signals whose values are known."""

import numpy as np
import pytest
import scipy.fft
import torch

from cospeech.speech.audio import load_audio
from cospeech.speech.features import (
    CEPSTRAL_MEL,
    TRIMODAL_MEL,
    MelSpec,
    energy,
    log_mel,
    mfcc,
)

RATE = 16000
SPECS = [
    TRIMODAL_MEL,
    CEPSTRAL_MEL,
    MelSpec(fft_samples=2048, hop_samples=1102, bands=64, lowest_hz=100.0, highest_hz=7500.0),
]


def sine(hz, seconds=1.0, level=0.5):
    samples = np.arange(round(seconds * RATE))
    return (level * np.sin(2 * np.pi * hz * samples / RATE)).astype(np.float32)


def click(sample, samples=RATE):
    waveform = np.zeros(samples, dtype=np.float32)
    waveform[sample] = 0.8
    return waveform


def chirp(seed=0, samples=36267):
    rng = np.random.default_rng(seed)
    time = np.arange(samples) / RATE
    swept = np.sin(2 * np.pi * (100 * time + 900 * time**2))
    return (0.3 * swept + 0.01 * rng.normal(size=samples)).astype(np.float32)


def slaney_hz(count):
    """Evenly spaced mels from 0 to 8 kHz, in Hz: linear to 1 kHz, then 27 steps per factor 6.4."""
    mels = np.linspace(0, 15 + 27 * np.log(8.0) / np.log(6.4), count)
    return np.where(mels < 15, mels * 200 / 3, 1000 * 6.4 ** ((mels - 15) / 27))


@pytest.fixture(scope="module")
def librosa():
    return pytest.importorskip("librosa")


# librosa's first calls compile for several seconds
@pytest.mark.slow
@pytest.mark.parametrize("spec", SPECS)
def test_log_mel_equals_librosa(librosa, spec):
    waveform = chirp()
    power = librosa.feature.melspectrogram(
        y=waveform, sr=RATE, n_fft=spec.fft_samples, hop_length=spec.hop_samples, power=2.0,
        n_mels=spec.bands, fmin=spec.lowest_hz, fmax=spec.highest_hz,
    )  # fmt: skip
    expected = librosa.power_to_db(power, ref=np.max)
    features = log_mel(waveform, spec)
    assert features.shape == expected.shape
    np.testing.assert_allclose(features, expected, atol=5e-3)


@pytest.mark.slow
def test_log_mel_of_speech_equals_librosa(librosa, shared):
    waveform = load_audio(shared / "data/real/speech/librispeech/61-70968-0000.flac")
    power = librosa.feature.melspectrogram(y=waveform, sr=RATE, n_fft=1024, hop_length=512)
    expected = librosa.power_to_db(power, ref=np.max)
    np.testing.assert_allclose(log_mel(waveform), expected, atol=5e-3)


@pytest.mark.slow
def test_mfcc_equals_librosa(librosa):
    waveform = chirp(1)
    spec = CEPSTRAL_MEL
    expected = librosa.feature.mfcc(
        y=waveform, sr=RATE, n_mfcc=20, n_fft=spec.fft_samples, hop_length=spec.hop_samples,
        n_mels=spec.bands, fmin=spec.lowest_hz, fmax=spec.highest_hz,
    )  # fmt: skip
    np.testing.assert_allclose(mfcc(waveform, 20), expected, atol=5e-3)


def test_mel_power_by_hand():
    # One frame, by the definition: windowed DFT, squared, weighted by the triangle of one band.
    spec = MelSpec(fft_samples=512, hop_samples=256, bands=20)
    waveform = chirp(2, 4096)
    frame, band = 5, 7
    hann = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(512) / 512)
    part = waveform[frame * 256 - 256 : frame * 256 + 256].astype(np.float64) * hann
    power = np.abs(np.fft.rfft(part)) ** 2
    left, centre, right = slaney_hz(22)[band : band + 3]
    bins = np.arange(257) * RATE / 512
    triangle = np.clip(
        np.minimum((bins - left) / (centre - left), (right - bins) / (right - centre)), 0, None
    )
    expected_db = 10 * np.log10((triangle * 2 / (right - left)) @ power)
    unscaled = scipy.fft.idct(mfcc(waveform, 20, spec), axis=0, norm="ortho")
    assert unscaled[band, frame] == pytest.approx(expected_db, abs=1e-3)


@pytest.mark.parametrize(
    ("samples", "frames"), [(36267, 71), (44800, 88), (512, 2), (511, 1), (1, 1)]
)
def test_frame_count(samples, frames):
    assert log_mel(chirp(samples=samples)).shape == (128, frames)
    assert energy(chirp(samples=samples), hop_samples=512).shape == (frames,)


@pytest.mark.parametrize("frame", [0, 3, 17, 30])
def test_a_click_is_loudest_in_the_frame_centred_on_it(frame):
    waveform = click(frame * 512)
    assert log_mel(waveform).mean(axis=0).argmax() == frame
    loudness = energy(waveform, frame_samples=512, hop_samples=512)
    heard = np.flatnonzero(loudness > -100)
    # frame i holds samples [512 i - 256, 512 i + 256); at the start only half of them exist
    np.testing.assert_array_equal(heard, [frame])
    inside = 256 if frame == 0 else 512
    assert loudness[frame] == pytest.approx(10 * np.log10(0.8**2 / inside), abs=1e-3)


@pytest.mark.parametrize("hz", [250.0, 440.0, 1000.0, 3000.0])
def test_a_sine_peaks_in_the_band_around_it(hz):
    bands = log_mel(sine(hz))[:, 5:-5]
    centres = slaney_hz(130)[1:-1]
    nearest = int(np.abs(centres - hz).argmin())
    assert np.abs(bands.argmax(axis=0) - nearest).max() <= 1
    assert bands.max() == pytest.approx(0, abs=0.05)


@pytest.mark.parametrize(
    ("level", "expected_db"), [(1.0, -3.0103), (0.5, -9.0309), (0.01, -43.0103)]
)
def test_level_of_a_sine_up_to_the_ends(level, expected_db):
    # 40 ms hold 40 periods of 1 kHz, and half a frame at the ends 20
    np.testing.assert_allclose(energy(sine(1000, level=level)), expected_db, atol=1e-2)


def test_silence_is_the_floor():
    silence = np.zeros(RATE, dtype=np.float32)
    np.testing.assert_array_equal(log_mel(silence), -80.0)
    np.testing.assert_allclose(energy(silence), -100.0)
    cepstra = mfcc(silence)
    np.testing.assert_allclose(cepstra[0], -100.0 * np.sqrt(40), rtol=1e-5)
    np.testing.assert_allclose(cepstra[1:], 0.0, atol=1e-3)


def test_silence_between_words_is_the_floor():
    waveform = np.concatenate([sine(500), np.zeros(RATE, dtype=np.float32)])
    features = log_mel(waveform)
    assert features.max() == 0.0
    np.testing.assert_array_equal(features[:, 40:], -80.0)


def test_log_mel_does_not_depend_on_the_recording_level():
    waveform = chirp()
    np.testing.assert_allclose(log_mel(waveform), log_mel(0.25 * waveform), atol=2e-3)


def test_a_batch_equals_its_clips_one_by_one():
    clips = np.stack([chirp(0), 0.1 * chirp(1), np.zeros(36267, dtype=np.float32)])
    for feature in (log_mel, mfcc, energy):
        together = feature(torch.from_numpy(clips))
        assert isinstance(together, torch.Tensor)
        for clip, features in zip(clips, together, strict=True):
            alone = feature(clip)
            assert isinstance(alone, np.ndarray)
            assert alone.dtype == np.float32
            np.testing.assert_allclose(features.numpy(), alone, atol=1e-4)


def test_gradients_flow():
    waveform = torch.from_numpy(chirp()).requires_grad_()
    (log_mel(waveform).sum() + mfcc(waveform).sum() + energy(waveform).sum()).backward()
    assert waveform.grad is not None
    assert torch.isfinite(waveform.grad).all()
    assert waveform.grad.abs().max() > 0


def test_what_is_no_waveform_is_refused():
    with pytest.raises(ValueError, match="float in"):
        log_mel(torch.zeros(1000, dtype=torch.int16))
    with pytest.raises(ValueError, match="at least one sample"):
        energy(np.zeros(0, dtype=np.float32))
    with pytest.raises(ValueError, match="40 mel bands give 1 to 40"):
        mfcc(chirp(), 41)
    with pytest.raises(ValueError, match="between 0 and 8000 Hz"):
        MelSpec(highest_hz=11025.0)
    with pytest.raises(ValueError, match="even"):
        energy(chirp(), frame_samples=401)
