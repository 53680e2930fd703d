"""Gesticulator's log-mel against the published one, from files of three rates."""

import numpy as np
import pytest
import soundfile

from cospeech.speech.audio import load_audio
from cospeech.speech.feature_sets.gesticulator import gesticulator_log_mel
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
