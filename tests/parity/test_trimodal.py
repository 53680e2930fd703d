"""The Fréchet distance of the published trimodal code."""

import pytest
import torch

from cospeech.metrics.functional import frechet_distance
from cospeech.metrics.moments import feature_moments
from tests.parity import formulas


def test_frechet_distance_is_the_published_one():
    moments = [
        moment
        for samples in formulas.frechet_samples()
        for moment in feature_moments(torch.from_numpy(samples)).mean_and_covariance()
    ]
    published = formulas.expected("trimodal")["frechet_example"].item()
    assert frechet_distance(*moments).item() == pytest.approx(published, rel=1e-6)
