"""Intervals over recordings."""

import numpy as np
import pytest
import torch

from cospeech.metrics.functional import frechet_distance
from cospeech.metrics.moments import feature_moments, recording_moments
from cospeech.metrics.uncertainty import fgd_interval

SIZE = 4
SPECTRUM = 1 / torch.arange(1.0, SIZE + 1)
SPECTRUM = SPECTRUM / SPECTRUM.sum()


def recordings(count, generator, windows=60, scale=1.0):
    """Moments of features of variance SPECTRUM, as alike within a recording as gestures are.

    30 % of the variance is an offset that all windows of a recording share; in the rest, each
    window correlates by .8 with the next.
    """
    noise = torch.randn(count, windows, SIZE, generator=generator)
    chain = [noise[:, 0]]
    for step in range(1, windows):
        chain.append(0.8 * chain[-1] + 0.6 * noise[:, step])
    offset = torch.randn(count, 1, SIZE, generator=generator)
    features = (0.7**0.5 * torch.stack(chain, 1) + 0.3**0.5 * offset) * SPECTRUM.sqrt() * scale
    ids = [recording for recording in range(count) for _ in range(windows)]
    return recording_moments(features.flatten(0, 1), ids)


def test_estimate_and_jackknife_equal_leaving_out_by_hand():
    generator = torch.Generator().manual_seed(0)
    features = torch.randn(2, 90, 3, generator=generator).double()
    ids = [0] * 20 + [1] * 30 + [2] * 40

    def distance(keep):
        moments = [feature_moments(side[keep]).mean_and_covariance() for side in features]
        return frechet_distance(*moments[0], *moments[1]).item()

    everything = np.ones(90, dtype=bool)
    left_out = [distance(np.array(ids) != recording) for recording in range(3)]
    real, generated = (recording_moments(side, ids) for side in features)
    interval = fgd_interval(real, generated)
    assert interval.estimate == pytest.approx(distance(everything), rel=1e-9)
    assert interval.extrapolated == pytest.approx(
        3 * distance(everything) - 2 * np.mean(left_out), rel=1e-6
    )
    assert interval.recordings == 3


def test_the_jackknife_in_parts_is_the_whole_one(monkeypatch):
    generator = torch.Generator().manual_seed(0)
    real, generated = recordings(23, generator), recordings(23, generator, scale=1.2)
    whole = fgd_interval(real, generated, resamples=10)
    monkeypatch.setattr("cospeech.metrics.uncertainty.LEFT_OUT_AT_ONCE", 5)
    parts = fgd_interval(real, generated, resamples=10)
    assert parts.extrapolated == pytest.approx(whole.extrapolated, rel=1e-9)


def test_recordings_may_be_in_any_order():
    features = torch.randn(12, 3, generator=torch.Generator().manual_seed(0))
    ids = ["b", "a", "b", "c", "a", "b", "c", "c", "c", "a", "b", "a"]
    moments = recording_moments(features, ids)
    for row, name in enumerate("bac"):
        alone = feature_moments(features[[i for i, each in enumerate(ids) if each == name]])
        for found, expected in zip(moments, alone, strict=True):
            torch.testing.assert_close(found[row], expected)


def test_interval_is_the_reflected_one():
    """Against a resampling that copies recordings; equal draws, so equal up to rounding."""
    generator = torch.Generator().manual_seed(1)
    features = torch.randn(2, 6, 15, 3, generator=generator).double()
    features[1] *= 1.5
    ids = [recording for recording in range(6) for _ in range(15)]
    real, generated = (recording_moments(side.flatten(0, 1), ids) for side in features)
    interval = fgd_interval(real, generated, resamples=50, seed=3)
    draws = torch.randint(6, (50, 6), generator=torch.Generator().manual_seed(3))
    values = []
    for draw in draws:
        sides = [
            feature_moments(side[draw].flatten(0, 1)).mean_and_covariance() for side in features
        ]
        values.append(frechet_distance(*sides[0], *sides[1]).item())
    high, low = 2 * interval.estimate - np.quantile(values, [0.025, 0.975])
    assert (interval.low, interval.high) == pytest.approx((max(low, 0), max(high, 0)), rel=1e-9)
    assert interval == fgd_interval(real, generated, resamples=50, seed=3)


def test_refusals():
    generator = torch.Generator().manual_seed(2)
    with pytest.raises(ValueError, match="at least two recordings"):
        fgd_interval(recordings(1, generator), recordings(1, generator))
    with pytest.raises(ValueError, match="same recordings on both sides"):
        fgd_interval(recordings(3, generator), recordings(4, generator))
    lopsided = recording_moments(torch.randn(4, 2, generator=generator), [0, 0, 0, 1])
    with pytest.raises(ValueError, match="all windows but one"):
        fgd_interval(lopsided, lopsided)


@pytest.mark.slow
def test_coverage():
    """Nominal 95 % intervals of a perfect system, 15 recordings.

    Reflected intervals must cover the true distance 0, which lies under every plain percentile;
    extrapolation must take most of the bias away.
    """
    generator = torch.Generator().manual_seed(5)
    repeats, single, estimates, extrapolated = 200, 0, [], []
    for repeat in range(repeats):
        real, perfect = recordings(15, generator), recordings(15, generator)
        interval = fgd_interval(real, perfect, resamples=100, seed=repeat)
        single += interval.low <= 0 <= interval.high
        estimates.append(interval.estimate)
        extrapolated.append(interval.extrapolated)
    assert single >= 0.92 * repeats
    assert np.mean(estimates) > 0.05
    assert abs(np.mean(extrapolated)) < 0.35 * np.mean(estimates)
