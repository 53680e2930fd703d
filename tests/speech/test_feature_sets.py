"""The papers' feature sets against librosa, the definitions written out, and published numbers."""

import subprocess
import sys

import numpy as np
import pytest
import soundfile
import soxr

from cospeech.speech.audio import load_audio
from cospeech.speech.band_power import htk_bands
from cospeech.speech.feature_sets.gesticulator import gesticulator_log_mel
from cospeech.speech.feature_sets.opensmile import opensmile_features, whole_frames
from cospeech.speech.pitch import f0
from cospeech.speech.resampling import resampled

RATE = 16_000


def sine(hz, seconds=1.0, level=0.5):
    return (level * np.sin(2 * np.pi * hz * np.arange(round(seconds * RATE)) / RATE)).astype("f4")


def chirp(seconds=1.5, seed=0):
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * RATE)) / RATE
    swept = np.sin(2 * np.pi * (100 * time + 900 * time**2))
    return (0.3 * swept + 0.01 * rng.normal(size=len(time))).astype(np.float32)


def speech(shared):
    return load_audio(shared / "data/real/speech/librispeech/61-70968-0000.flac")


# --- Gesticulator ---------------------------------------------------------------------------------


@pytest.mark.parametrize("published_hop", [False, True])
def test_a_minute_has_1201_frames_of_64_bands_and_silence_is_minus_23(published_hop):
    features = gesticulator_log_mel(np.zeros(60 * RATE, "f4"), published_hop=published_hop)
    assert features.shape == (1201, 64)
    assert features.dtype == np.float32
    np.testing.assert_allclose(features, -23.0259, atol=5e-5)


def librosa_log_mel(signal):
    librosa = pytest.importorskip("librosa")
    power = librosa.feature.melspectrogram(
        y=signal, sr=22_050, n_fft=2048, hop_length=1102, n_mels=64, fmin=100, fmax=7500,
        power=2.0, pad_mode="reflect", window=np.hanning,
    )  # fmt: skip
    return np.log(power + 1e-10).T


# librosa's first calls compile for several seconds
@pytest.mark.slow
def test_the_published_hop_equals_librosa():
    waveform = chirp(5.01)
    expected = librosa_log_mel(soxr.resample(waveform, RATE, 22_050))
    features = gesticulator_log_mel(waveform, published_hop=True)
    assert features.shape == expected.shape == (101, 64)
    np.testing.assert_allclose(features, expected, atol=2e-3)


@pytest.mark.slow
def test_going_through_16_khz_costs_little_below_7500_hz(shared):
    path = shared / "data/real/speech/jfk/jfk.flac"
    original, rate = soundfile.read(path, dtype="float32", always_2d=True)
    assert rate == 44_100
    direct = librosa_log_mel(soxr.resample(original.mean(axis=1), rate, 22_050))
    distance = np.abs(gesticulator_log_mel(load_audio(path), published_hop=True) - direct)
    assert distance.mean() < 5e-4
    assert distance[:, -1].mean() < 0.01


@pytest.mark.parametrize("frame", [0, 1, 2, 13, 29, 30])
def test_a_frame_by_its_definition(frame):
    # 30 frames begin inside the 1.5 s, and frame 30 lies on the end
    waveform = chirp()
    signal = resampled(waveform).astype(np.float64)
    centre = int(frame * 1102.5 + 0.5)
    at = np.abs(np.arange(centre - 1024, centre + 1024))  # mirrored about the first sample
    at = np.where(at < len(signal), at, 2 * (len(signal) - 1) - at)  # and about the last
    symmetric = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(2048) / 2047)
    power = np.abs(np.fft.rfft(signal[at] * symmetric)) ** 2

    def mel(hz):
        return hz * 3 / 200 if hz < 1000 else 15 + 27 * np.log(hz / 1000) / np.log(6.4)

    def hz(mel):
        return mel * 200 / 3 if mel < 15 else 1000 * 6.4 ** ((mel - 15) / 27)

    edges = [hz(m) for m in np.linspace(mel(100), mel(7500), 66)]
    features = gesticulator_log_mel(waveform)
    assert features.shape == (31, 64)
    for band in (0, 7, 40, 63):
        left, middle, right = edges[band : band + 3]
        total = 0.0
        for k, value in enumerate(power):
            f = k * 22_050 / 2048
            if left < f < right:
                side = (
                    (f - left) / (middle - left) if f < middle else (right - f) / (right - middle)
                )
                total += value * side * 2 / (right - left)
        # a periodic window would be 1e-4 to 8e-3 off
        assert features[frame, band] == pytest.approx(np.log(total + 1e-10), abs=3e-5)


def test_after_ten_minutes_the_published_hop_is_5_44_frames_off_and_ours_none():
    waveform = np.zeros(601 * RATE, "f4")
    waveform[600 * RATE] = 0.9  # on motion frame 12 000 at 20 fps
    ours, published = (
        gesticulator_log_mel(waveform, published_hop=hop).mean(axis=1) for hop in (False, True)
    )
    assert ours.argmax() == 12_000
    # 1102.5 / 1102 * 12 000 = 12 005.44: between the frames 12 005 and 12 006, nearer to the first
    assert published.argmax() == 12_005


@pytest.mark.parametrize("samples", [1, 2, 799, 800, 801, 1102, 15_999, 16_000, 100_003])
@pytest.mark.parametrize("published_hop", [False, True])
def test_there_are_frames_for_all_of_the_motion(samples, published_hop):
    waveform = chirp(samples / RATE)
    features = gesticulator_log_mel(waveform, published_hop=published_hop)
    assert len(features) >= -(-samples * 20 // RATE)
    assert np.isfinite(features).all()


# --- openSMILE ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("samples", "frames"), [(1, 0), (319, 0), (320, 1), (479, 1), (480, 2), (16_000, 99)]
)
def test_only_whole_frames_count(samples, frames):
    assert whole_frames(samples) == frames
    assert opensmile_features(chirp(samples / RATE)).shape == (frames, 27)
    # by trying: frames of 320 samples every 160
    assert frames == sum(start + 320 <= samples for start in range(0, samples, 160))


def mfcc_by_hand(waveform, frame):
    """HTK's definition in loops: Hamming, 512-point FFT, 40 triangles in mel, ln, DCT."""
    part = np.zeros(320)
    inside = waveform[frame * 160 : frame * 160 + 320]
    part[: len(inside)] = inside
    hamming = 0.54 - 0.46 * np.cos(2 * np.pi * np.arange(320) / 319)
    power = np.abs(np.fft.rfft(part * hamming, 512)) ** 2

    def mel(hz):
        return 1127 * np.log(1 + hz / 700)

    step = (mel(8000) - mel(20)) / 41
    logs = []
    for band in range(40):
        middle = mel(20) + step * (band + 1)
        weights = [max(0.0, 1 - abs(mel(k * 31.25) - middle) / step) for k in range(257)]
        assert max(weights) > 0
        logs.append(np.log(max(float(np.dot(weights, power)), 1e-8)))
    return [
        np.sqrt((1 if c == 0 else 2) / 40)
        * sum(v * np.cos(np.pi * c * (b + 0.5) / 40) for b, v in enumerate(logs))
        for c in range(26)
    ]


@pytest.mark.parametrize("frame", [0, 57, 148])
def test_cepstra_by_their_definition(frame):
    waveform = chirp()
    features = opensmile_features(waveform)
    assert features.shape == (149, 27)
    assert features.dtype == np.float32
    np.testing.assert_allclose(features[frame, :26], mfcc_by_hand(waveform, frame), atol=2e-3)


def test_frames_past_the_end_are_filled_with_silence():
    waveform = chirp(0.5)
    whole, more = opensmile_features(waveform), opensmile_features(waveform, 53)
    assert len(whole) == 49
    np.testing.assert_allclose(more[:49], whole, atol=1e-4)
    np.testing.assert_allclose(more[49, :26], mfcc_by_hand(waveform, 49), atol=2e-3)
    # ln(1e-8) in all of 40 bands: c0 is its mean times the root of 40
    assert more[51:, 0] == pytest.approx(np.sqrt(40) * np.log(1e-8), rel=1e-6)
    np.testing.assert_allclose(more[51:, 1:], 0, atol=1e-4)
    np.testing.assert_allclose(opensmile_features(waveform, 20), whole[:20], atol=1e-4)
    with pytest.raises(ValueError, match="-1 frames"):
        opensmile_features(waveform, -1)


@pytest.mark.slow
def test_htk_triangles_are_librosas_but_for_straightness():
    # librosa's triangles are straight in Hz; over one narrow band the difference is small
    librosa = pytest.importorskip("librosa")
    expected = librosa.filters.mel(
        sr=RATE, n_fft=8192, n_mels=40, fmin=20, fmax=8000, htk=True, norm=None
    )
    np.testing.assert_allclose(htk_bands(8192, RATE, 40, 20.0, 8000.0), expected, atol=0.02)


def test_a_frame_covers_20_ms_from_its_time_on():
    waveform = np.zeros(RATE, "f4")
    waveform[8000:8160] = sine(1000, 0.01)  # 0.50 to 0.51 s
    loud = opensmile_features(waveform)[:, 0] > opensmile_features(0 * waveform)[0, 0] + 1
    assert np.flatnonzero(loud).tolist() == [49, 50]


def test_pitch_is_hertz_or_zero_in_the_middle_of_the_frame():
    waveform = np.concatenate([np.zeros(4800, "f4"), sine(200), np.zeros(4800, "f4")])
    track = opensmile_features(waveform)[:, 26]
    np.testing.assert_allclose(track[35:125], 200, rtol=0.005)
    assert (track[:26] == 0).all()
    assert (track[134:] == 0).all()
    # pitch frame i is centred on 10 i ms, the middle of frame i - 1
    np.testing.assert_array_equal(track, np.nan_to_num(f0(waveform))[1 : 1 + len(track)])


def test_log_pitch_is_interpolated_between_voices():
    gap = np.zeros(6400, "f4")
    waveform = np.concatenate([gap, sine(100), gap, sine(200), gap])
    features = opensmile_features(waveform, 330, pitch="log")
    assert features.shape == (330, 28)
    log_pitch, voicing = features[:, 26], features[:, 27]
    assert set(voicing.tolist()) == {0, 1}
    hertz = opensmile_features(waveform, 330)[:, 26]
    np.testing.assert_array_equal(voicing > 0, hertz > 0)
    np.testing.assert_allclose(log_pitch[voicing > 0], np.log(hertz[hertz > 0]), rtol=1e-6)
    # a straight line from ln 100 to ln 200 across the gap; at its middle their mean
    before, after = np.flatnonzero((voicing[:-1] == 1) & (voicing[1:] == 0))[0], 180
    after = before + 1 + int(voicing[before + 1 :].argmax())
    middle = (before + after) // 2
    share = (middle - before) / (after - before)
    expected = log_pitch[before] + share * (log_pitch[after] - log_pitch[before])
    assert log_pitch[middle] == pytest.approx(expected, abs=1e-5)
    assert np.exp(log_pitch[middle]) == pytest.approx(np.sqrt(100 * 200), rel=0.03)
    assert log_pitch[0] == pytest.approx(np.log(100), abs=0.01)
    assert log_pitch[-1] == pytest.approx(np.log(200), abs=0.01)


def test_log_pitch_without_any_voice_is_a_constant():
    features = opensmile_features(np.zeros(3200, "f4"), pitch="log")
    assert features[:, 26] == pytest.approx(np.log(np.sqrt(75 * 500)))
    assert (features[:, 27] == 0).all()


def test_deltas_are_slopes_of_a_line_through_five_frames():
    waveform = chirp()
    static = opensmile_features(waveform)[:, :13].astype(np.float64)
    features = opensmile_features(waveform, cepstra="deltas")
    assert features.shape == (149, 27)
    np.testing.assert_allclose(features[:, :13], static, atol=1e-4)
    for frame in (2, 80, 146):
        slope = np.polyfit(np.arange(-2, 3), static[frame - 2 : frame + 3], 1)[0]
        np.testing.assert_allclose(features[frame, 13:26], slope, atol=1e-4)
    # at the edge the first frame is repeated
    edge = (static[1] - static[0]) + 2 * (static[2] - static[0])
    np.testing.assert_allclose(features[0, 13:26], edge / 10, atol=1e-4)
    np.testing.assert_array_equal(features[:, 26], opensmile_features(waveform)[:, 26])


def test_features_of_real_speech(shared):
    waveform = speech(shared)
    features = opensmile_features(waveform)
    assert np.isfinite(features).all()
    np.testing.assert_allclose(features[120, :26], mfcc_by_hand(waveform, 120), atol=2e-3)
    voiced = features[:, 26] > 0
    assert 0.3 < voiced.mean() < 0.8
    # c0 follows loudness, and voices are loud
    assert features[voiced, 0].mean() > features[~voiced, 0].mean() + 10


def test_speech_and_motion_stay_aligned_in_every_interleave():
    # A loud 10 ms and a hand that moves in that very frame land on one frame of one set.
    waveform = np.zeros(RATE, "f4")
    waveform[53 * 160 : 54 * 160] = sine(500, 0.01)
    features = opensmile_features(waveform, 100)
    positions = np.zeros((100, 10, 3), "f4")
    positions[53] = 1.0
    loudest = features[53 % 5 :: 5, 0].argmax()
    moving = positions[53 % 5 :: 5, 0, 0].argmax()
    assert loudest == moving == 53 // 5


# --- both -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("features", [gesticulator_log_mel, opensmile_features])
@pytest.mark.parametrize(
    "waveform", [np.zeros(0, "f4"), np.zeros((2, 100), "f4"), np.zeros(100, np.int16)]
)
def test_what_is_no_waveform_is_refused(features, waveform):
    with pytest.raises(ValueError, match="a waveform is"):
        features(waveform)


def test_no_torch_is_imported():
    modules = "gesticulator", "opensmile"
    imports = "; ".join(f"import cospeech.speech.feature_sets.{name}" for name in modules)
    code = f"import sys; {imports}; sys.exit('torch' in sys.modules or 'librosa' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
