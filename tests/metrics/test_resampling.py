"""Resampled recordings: drawn whole, and intervals as the theory has them."""

import numpy as np
import pytest

from cospeech.metrics.resampling import Estimate, Resampling, combined


def test_recordings_are_drawn_whole():
    groups = np.repeat(np.arange(6), [1, 2, 3, 4, 5, 6])
    resampling = Resampling(groups, 50, seed=0)
    for drawn in resampling.draws:
        counts = np.bincount(drawn, minlength=len(groups))
        times = [set(counts[groups == group].tolist()) for group in range(6)]
        assert all(len(values) == 1 for values in times)
        assert sum(values.pop() for values in times) == 6
    again = Resampling(groups, 50, seed=0)
    assert all((a == b).all() for a, b in zip(resampling.draws, again.draws, strict=True))


def test_the_interval_of_a_mean_is_that_of_the_theory():
    rng = np.random.default_rng(4)
    values = rng.normal(10, 2, 200)
    low, high = Resampling(np.arange(200), 2000, seed=0).mean(values).interval()
    error = 1.96 * values.std() / np.sqrt(200)
    assert low == pytest.approx(values.mean() - error, abs=0.1 * error)
    assert high == pytest.approx(values.mean() + error, abs=0.1 * error)


def test_few_recordings_have_no_interval():
    estimate = Resampling([0, 0, 1, 2, 3], 50, seed=0).mean([1, 2, 3, 4, 5])
    assert (estimate.value, estimate.interval()) == (3, None)


def test_reflected_intervals_and_paired_differences():
    draws = np.linspace(1, 5, 401)
    estimate = Estimate(2.0, draws)
    low, high = estimate.interval()
    assert (low, high) == pytest.approx((1.1, 4.9))
    # twice 2 minus 4.9 is below 0
    assert estimate.interval(reflected=True) == pytest.approx((0.0, 2.9))
    difference = combined(np.subtract, estimate, Estimate(1.5, draws - 0.5))
    assert (difference.value, difference.interval()) == (0.5, (0.5, 0.5))
    assert combined(np.subtract, estimate, Estimate(1.0, np.zeros(0))).interval() is None
