"""22 050 Hz of 16 kHz against soxr, and of a part against the whole."""

import numpy as np
import pytest
import soxr

from cospeech.speech.resampling import BLOCK, REACH_SAMPLES, RESAMPLED_BLOCK, resampled


def noise(samples):
    return (0.2 * np.random.default_rng(3).standard_normal(samples)).astype(np.float32)


def test_samples_are_soxrs_but_for_the_first_five():
    waveform = noise(20_123)
    expected = soxr.resample(waveform, 16_000, 22_050)
    np.testing.assert_allclose(resampled(waveform)[5:], expected[5:], atol=1e-6)


@pytest.mark.parametrize("samples", [1, 2, 3, 159, 160, 161, 320, 480, 799, 801, 15_999, 16_000])
def test_there_are_as_many_as_soxr_makes(samples):
    waveform = noise(samples)
    assert len(resampled(waveform)) == len(soxr.resample(waveform, 16_000, 22_050))


@pytest.mark.parametrize(("first", "samples"), [(1, 900), (7, 1000), (7, 5000), (30, 9999)])
def test_a_part_has_the_bits_of_the_whole_where_nothing_outside_is_in_reach(first, samples):
    waveform = noise(48_000)
    whole = resampled(waveform)[first * RESAMPLED_BLOCK :]
    part = resampled(waveform[first * BLOCK : first * BLOCK + samples])
    reach = -(-REACH_SAMPLES * RESAMPLED_BLOCK // BLOCK)
    inside = slice(reach, len(part) - reach - 1)
    np.testing.assert_array_equal(part[inside], whole[: len(part)][inside])
    assert (part != whole[: len(part)])[:reach].any()
    assert (part != whole[: len(part)])[-reach:].any()
