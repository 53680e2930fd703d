"""Gesticulator's acoustic features against the published ones, from files of several rates."""

import numpy as np
import pytest
import soundfile

from cospeech.speech.audio import load_audio
from cospeech.speech.feature_sets.gesticulator import gesticulator_log_mel
from cospeech.speech.feature_sets.gesticulator_cepstra import gesticulator_cepstra
from cospeech.speech.feature_sets.gesticulator_prosody import gesticulator_prosody, prosody_track
from tests.parity import formulas


def test_the_waveform_is_the_one_that_was_used():
    expected, waveform = formulas.expected("gesticulator"), formulas.waveform_16_bit(22_050)
    np.testing.assert_array_equal(waveform[:16], expected["waveform_first_16"])
    assert np.abs(waveform.astype(np.int64)).sum() == expected["waveform_sum_abs"]


# The published code resamples 16 kHz once, with the same filter but for the first five samples, in
# the middle of the first frame. What goes through 16 kHz here goes straight to 22 050 Hz there,
# with another filter: it shows in the topmost bands, most in mirrored edges.
@pytest.mark.parametrize(
    ("rate", "edge_atol", "atol"), [(16_000, 1e-2, 2e-5), (22_050, 3e-2, 2e-2), (44_100, 0.1, 2e-2)]
)
def test_log_mel_is_the_published_one(rate, edge_atol, atol, tmp_path):
    soundfile.write(tmp_path / "a.wav", formulas.waveform_16_bit(rate), rate, subtype="PCM_16")
    ours = gesticulator_log_mel(load_audio(tmp_path / "a.wav"), published_hop=True)
    published = formulas.expected("gesticulator")[f"logmel_formula{rate}_reflect"]
    np.testing.assert_allclose(ours, published, atol=edge_atol, rtol=0)
    np.testing.assert_allclose(ours[1:-1], published[1:-1], atol=atol, rtol=0)


@pytest.mark.parametrize("rate", [16_000, 22_050])
def test_cepstra_are_the_published_ones_at_the_rate_of_the_file(rate):
    waveform = (formulas.waveform_16_bit(rate) / 32_768).astype(np.float32)
    published = formulas.expected("gesticulator")[f"mfcc_formula{rate}"]
    ours = gesticulator_cepstra(waveform, rate)
    assert len(ours) == len(published) + 1  # the incomplete last row
    np.testing.assert_allclose(ours[:-1], published, atol=1e-5, rtol=0)


def test_prosody_is_the_published_one_but_beside_digital_silence():
    """There Praat interpolates between intensities of minus infinity and of sound."""
    expected = formulas.expected("gesticulator")
    waveform = (formulas.waveform_16_bit(16_000) / 32_768).astype(np.float32)
    published = expected["prosody5ms_formula16000"]
    away = np.abs(prosody_track(waveform)[: len(published)] - published)
    where = np.flatnonzero(away[:, 0] > 1e-3)
    assert set(where) <= {283, 284, 285, 286, 334, 335, 336, 594}
    np.testing.assert_array_less(away[:, 1], 2e-3)

    published = expected["prosody_formula16000"]
    ours = gesticulator_prosody(waveform)
    assert len(ours) == len(published) + 1
    sounding = ~np.isin(np.arange(59), [28, 33])
    np.testing.assert_allclose(ours[:-1][sounding], published[sounding], atol=1e-3, rtol=0)
    np.testing.assert_allclose(ours[:-1, 0], published[:, 0], atol=0.05, rtol=0)
    # Per millisecond, a hundredth of what rows are: compared by their own size.
    for change in (1, 3):
        np.testing.assert_allclose(ours[:-1, change], published[:, change], atol=5e-5, rtol=0)
        assert np.abs(published[:, change]).max() > 5e-3


def test_a_recordings_cepstra_and_prosody_are_the_published_ones(shared):
    path = shared / "data/real/speech/ljspeech/LJ002-0020.wav"
    waveform, rate = soundfile.read(path, dtype="float32")
    with np.load(shared / "data/parity/gesticulator/expected.npz") as expected:
        cepstra, prosody = expected["mfcc_lj"], expected["prosody_lj"]
    ours = gesticulator_cepstra(waveform, rate)
    np.testing.assert_allclose(ours[: len(cepstra)], cepstra, atol=1e-5, rtol=0)
    # Through 16 kHz and with another tracker of pitch.
    away = np.abs(gesticulator_prosody(load_audio(path))[: len(prosody)] - prosody)
    np.testing.assert_array_less(away.max(axis=0), [0.14, 6e-4, 0.17, 5e-4])
    np.testing.assert_array_less(np.median(away, axis=0), [2e-4, 2e-5, 5e-4, 5e-5])
