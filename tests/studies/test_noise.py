"""The picture of the noise study."""

import numpy as np
from matplotlib.image import imread

from cospeech.metrics.noise_study import NoiseRow
from cospeech.reporting.charts import colour
from cospeech.studies.noise import plot_noise_study


def test_bars_of_both_terms_and_of_the_error_are_drawn(tmp_path):
    rows = [NoiseRow("gaussian", zeta, 40 * zeta, 10 * zeta, 30 * zeta, zeta) for zeta in (1, 2)]
    path = tmp_path / "noise.png"
    plot_noise_study(rows, path)
    pixels = np.round(255 * imread(path)[..., :3]).astype(int)
    ink = {}
    for name in ("c1", "c6", "c2"):
        rgb = [int(colour(name)[i : i + 2], 16) for i in (1, 3, 5)]
        ink[name] = (np.abs(pixels - rgb).max(-1) <= 5).mean()
    assert ink["c2"] > 0.005
    # the covariance term is three times the mean term
    assert 2.5 < ink["c6"] / ink["c1"] < 3.5
    assert (pixels == 255).all(-1).mean() > 0.4
