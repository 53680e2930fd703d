"""HTK's mel bands against those of the published Speech2Gesture code."""

import numpy as np

from cospeech.speech.band_power import htk_bands
from tests.parity import formulas


def test_mel_bands_are_the_published_ones():
    """64 triangles of height 1; sums over the bands of each bin, and over the bins of each band."""
    bands = htk_bands(512, 16_000, 64, 125.0, 7500.0)
    expected = formulas.expected("speech2gesture_original")
    np.testing.assert_allclose(bands.sum(axis=0), expected["mel_matrix_row_sums"], atol=2e-6)
    np.testing.assert_allclose(bands.sum(axis=1), expected["mel_matrix_column_sums"], atol=2e-6)
