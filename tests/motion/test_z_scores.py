"""Z-scored joints: statistics against NumPy, and the way back."""

import numpy as np
import pytest
import torch

from cospeech.motion.codecs import Moments, ZScores


def test_statistics_are_those_of_all_parts_together_and_stay_with_the_weights():
    rng = np.random.default_rng(0)
    positions = (rng.normal(size=(3, 8, 4, 3)) * 0.2 + 1000).astype(np.float32)
    positions[:, :, 2] = 5
    moments = Moments((4, 3))
    for part in torch.from_numpy(positions):
        moments.add(part)
    codec = ZScores((4, 3), least_deviation=0.01)
    codec.take(moments)
    samples = positions.reshape(-1, 4, 3).astype(np.float64)
    np.testing.assert_allclose(codec.mean, samples.mean(axis=0), rtol=1e-6)
    expected = np.maximum(samples.std(axis=0), 0.01)
    np.testing.assert_allclose(codec.deviation, expected, rtol=1e-4)
    other = ZScores((4, 3), least_deviation=0.01)
    other.load_state_dict(codec.state_dict())
    scores = other.encode(torch.from_numpy(positions))
    assert scores.shape == (3, 8, 12)
    joint = (samples[0, 1] - samples.mean(axis=0)[1]) / expected[1]
    np.testing.assert_allclose(scores[0, 0, 3:6], joint, atol=2e-2)
    np.testing.assert_allclose(other.decode(scores), positions, rtol=1e-6)


def test_statistics_of_nothing_are_refused():
    with pytest.raises(ValueError, match="statistics of nothing"):
        ZScores((2, 3), 0.1).take(Moments((2, 3)))
