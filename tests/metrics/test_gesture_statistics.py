"""Gesture statistics, against numbers that can be worked out by hand and against plain loops."""

import itertools

import numpy as np
import pytest

from cospeech.metrics.gesture_statistics import movement, wrists
from cospeech.metrics.gesture_statistics.phase_structure import (
    count_phases,
    phase_distances,
    phase_structure,
)
from cospeech.metrics.gesture_statistics.resampling import Estimate, Resampling, mean_estimate

FPS = 20.0
LEFT, RIGHT = 0, 1
WRISTS = (LEFT, RIGHT)


def still(windows=1, frames=100, joints=2):
    return np.zeros((windows, frames, joints, 3))


def test_one_wrist_moving_one_centimetre_per_frame():
    windows = still()
    windows[0, :, LEFT, 0] = 0.01 * np.arange(100)
    velocities = wrists.wrist_velocities(windows, WRISTS, FPS)
    assert velocities.shape == (1, 99)
    # 20 cm/s on the left, nothing on the right
    np.testing.assert_allclose(velocities, 0.1)
    np.testing.assert_allclose(wrists.wrist_velocities(windows, [LEFT], FPS), 0.2)


def test_velocity_is_the_sum_of_absolute_values_as_printed():
    windows = still()
    windows[0, :, LEFT] = np.arange(100)[:, None] * [0.01, -0.02, 0.03]
    np.testing.assert_allclose(wrists.wrist_velocities(windows, [LEFT], FPS), 0.06 * FPS)


def test_the_curve_is_the_median_over_windows_at_each_step():
    velocities = np.array([[1.0, 9.0], [2.0, 7.0], [9.0, 8.0]])
    assert wrists.median_curve(velocities).tolist() == [2.0, 8.0]


def test_area_between_two_curves():
    # 0.1 m/s apart for 100 steps of 1/20 s, half of them above and half below
    curve, other = np.full(100, 0.3), np.repeat([0.2, 0.4], 50)
    assert wrists.area_between(curve, other, FPS) == pytest.approx(0.5)
    assert wrists.area_between(curve, curve, FPS) == 0
    with pytest.raises(ValueError, match="steps"):
        wrists.area_between(curve, other[:99], FPS)


def test_reach_is_the_farthest_moment_of_either_wrist_from_its_mean():
    mean_pose = np.array([[1.0, 2.0, 3.0], [-1.0, 2.0, 3.0]])
    windows = np.tile(mean_pose, (3, 100, 1, 1))
    windows[0, 17, RIGHT] += [0.03, -0.04, 0.0]
    windows[0, 60, LEFT] += [0.0, 0.0, 0.02]
    windows[2, 99, LEFT] += [0.0, 0.12, 0.05]
    reaches = wrists.farthest_reaches(windows, WRISTS, mean_pose)
    np.testing.assert_allclose(reaches, [0.05, 0.0, 0.13], atol=1e-12)


def test_scatter_takes_four_positions_per_second_until_two_minutes_are_full():
    first, second = still(frames=101)[0], still(frames=4000)[0]
    first[:, LEFT, 0], second[:, LEFT, 0] = np.arange(101), 1000 + np.arange(4000)
    scatter = wrists.scattered_positions([first, second], FPS)
    assert scatter.shape == (480, 2, 3)
    assert scatter[:21, LEFT, 0].tolist() == list(range(0, 101, 5))
    assert scatter[21:, LEFT, 0].tolist() == [1000 + 5 * i for i in range(459)]
    assert len(wrists.scattered_positions([first], FPS)) == 21
    with pytest.raises(ValueError, match="no recordings"):
        wrists.scattered_positions([], FPS)


def test_rigid_bones_do_not_vary_and_others_do():
    times = np.arange(100)
    recording = np.zeros((100, 3, 3))
    recording[:, 1] = np.stack([np.cos(times), np.sin(times), 0 * times], axis=-1)
    # 0.9 and 1.1 in turn: a mean of 1, a standard deviation of 0.1
    recording[:, 2] = recording[:, 1] * np.where(times % 2, 1.9, 2.1)[:, None]
    bones = [(0, 1), (1, 2)]
    np.testing.assert_allclose(movement.bone_variation(recording, bones), [0, 0.1], atol=1e-12)
    lengths = movement.bone_lengths(recording, bones)
    np.testing.assert_allclose(lengths[:2], [[1, 1.1], [1, 0.9]])
    assert movement.bone_variation(np.zeros((5, 2, 3)), [(0, 1)]).tolist() == [0]


def test_identical_windows_have_no_distance_and_no_variety():
    rng = np.random.default_rng(0)
    windows = np.repeat(rng.normal(size=(1, 100, 2, 3)), 4, axis=0)
    distances = movement.WindowDistances(windows)
    assert distances.mean() == 0
    assert distances.variety() == 0
    assert distances.nearest.tolist() == [0, 0, 0, 0]


def test_window_distance_is_a_root_mean_square():
    windows = still(windows=2, frames=4)
    windows[1, :, LEFT] = [3.0, 0.0, 4.0]
    # 5 m on one of two joints
    assert movement.WindowDistances(windows).mean() == pytest.approx(5 / np.sqrt(2))
    with pytest.raises(ValueError, match="two"):
        movement.WindowDistances(windows[:1])


@pytest.mark.parametrize("chosen", [None, np.array([0, 0, 3, 4, 4, 4])])
def test_diversity_and_variety_against_loops_over_pairs(chosen):
    rng = np.random.default_rng(1)
    pattern = rng.normal(size=(1, 12, 2, 3))
    windows = pattern + 0.4 * rng.normal(size=(5, 12, 2, 3)) + 30
    taken = windows if chosen is None else windows[chosen]
    labels = np.arange(5) if chosen is None else chosen
    pairs = [
        (a, b) for a, b in itertools.permutations(range(len(taken)), 2) if labels[a] != labels[b]
    ]
    squares = [np.square(taken[a] - taken[b]).sum(-1).mean() for a, b in pairs]
    variance = np.square(taken - taken.mean(axis=(0, 1))).sum(-1).mean()
    distances = movement.WindowDistances(windows)
    assert distances.mean(chosen) == pytest.approx(np.mean(np.sqrt(squares)))
    assert distances.variety(chosen) == pytest.approx(np.mean(squares) / (2 * variance))


def test_variety_does_not_depend_on_size():
    rng = np.random.default_rng(2)
    windows = rng.normal(size=(40, 100, 2, 3))
    large, small = movement.WindowDistances(windows), movement.WindowDistances(0.01 * windows + 5)
    assert large.variety() == pytest.approx(1, abs=0.02)
    assert small.variety() == pytest.approx(large.variety(), rel=1e-6)
    assert small.mean() == pytest.approx(0.01 * large.mean())
    assert np.isnan(movement.WindowDistances(still(windows=3)).variety())


def test_nearest_window():
    windows = still(windows=4, frames=5, joints=1)
    windows[:, :, 0, 0] = np.array([0.0, 1.0, 5.0, 5.5])[:, None]
    np.testing.assert_allclose(movement.WindowDistances(windows).nearest, [1, 1, 0.5, 0.5])


def test_jerk_of_a_cubic_is_six():
    windows = still()
    windows[0, :, LEFT, 1] = (np.arange(100) / FPS) ** 3
    np.testing.assert_allclose(movement.mean_jerk(windows, [LEFT], FPS), 6)
    np.testing.assert_allclose(movement.mean_jerk(windows, WRISTS, FPS), 3)


@pytest.mark.parametrize(("hertz", "expected"), [(1.0, 0.0), (3.0, 0.0), (5.0, 1.0), (8.0, 1.0)])
def test_power_above_four_hertz(hertz, expected):
    windows = still(windows=2)
    windows[:, :, LEFT, 2] = 0.1 * np.sin(2 * np.pi * hertz * np.arange(100) / FPS)
    power = movement.velocity_power(windows, WRISTS, FPS)
    assert power.shape == (2, 2)
    np.testing.assert_allclose(power[:, 0] / power[:, 1], expected, atol=0.01)


def test_held_where_both_wrists_are_slow():
    windows = still(frames=101)
    # 9 cm/s throughout on the left; 12 cm/s in the second half on the right, 6.9 per axis
    windows[0, :, LEFT, 0] = 0.09 / FPS * np.arange(101)
    windows[0, 51:, RIGHT] = 0.12 / FPS / np.sqrt(3) * np.arange(1, 51)[:, None]
    np.testing.assert_allclose(movement.held_share(windows, WRISTS, FPS), 0.5)


def test_steps_at_the_borders_of_windows():
    recording = np.zeros((250, 2, 3))
    recording[:, :, 0] = 0.01 * np.arange(250)[:, None]
    recording[100:, LEFT, 1] += 0.08
    at_border, inside = movement.border_steps(recording, 100)
    # half of the joints jump sideways
    np.testing.assert_allclose(at_border, [(np.hypot(0.01, 0.08) + 0.01) / 2, 0.01])
    assert len(inside) == 247
    np.testing.assert_allclose(inside, 0.01)


def test_phases_of_a_short_recording():
    structure = phase_structure([count_phases(np.array([0, 0, 1, 1, 1, 0]), 3, 2.0)], 2.0)
    np.testing.assert_allclose(structure.shares, [0.5, 0.5, 0])
    np.testing.assert_allclose(structure.mean_durations_s, [0.75, 1.5, np.nan])
    np.testing.assert_allclose(
        structure.transitions, [[0, 1, 0], [1, 0, 0], [np.nan, np.nan, np.nan]]
    )
    np.testing.assert_allclose(structure.pairs, [[0, 0.5, 0], [0.5, 0, 0], [0, 0, 0]])
    # bins from 0.5, 1 and 1.4 s on
    np.testing.assert_allclose(structure.durations[0, [4, 6]], [0.5, 0.5])
    assert structure.durations[1, 7] == 1


def test_recordings_add_up_without_a_transition_between_them():
    counts = [count_phases(np.array(labels), 2, FPS) for labels in ([0, 0, 1], [0, 1, 1, 1])]
    structure = phase_structure(counts, FPS)
    np.testing.assert_allclose(structure.shares, [3 / 7, 4 / 7])
    np.testing.assert_allclose(structure.mean_durations_s, [1.5 / FPS, 2 / FPS])
    np.testing.assert_allclose(structure.transitions, [[0, 1], [np.nan, np.nan]])


def test_a_duration_on_an_edge_is_in_the_longer_bin():
    labels = np.array([0] * 3 + [1] * 10 + [0] * 5)
    durations = count_phases(labels, 2, FPS).durations
    # 0.15 s and 0.25 s begin the second and the third bin, 0.5 s the fifth
    assert np.flatnonzero(durations[0]).tolist() == [1, 2]
    assert np.flatnonzero(durations[1]).tolist() == [4]


def test_phases_against_a_loop():
    rng = np.random.default_rng(3)
    labels = np.repeat(rng.integers(0, 4, 200), rng.integers(1, 30, 200))
    runs = [(key, len(list(group))) for key, group in itertools.groupby(labels.tolist())]
    structure = phase_structure([count_phases(labels, 4, FPS)], FPS)
    for phase in range(4):
        lengths = [length for key, length in runs if key == phase]
        assert structure.mean_durations_s[phase] == pytest.approx(np.mean(lengths) / FPS)
        followers = [b for (a, _), (b, _) in itertools.pairwise(runs) if a == phase]
        expected = np.bincount(followers, minlength=4) / len(followers)
        np.testing.assert_allclose(structure.transitions[phase], expected)


def test_jensen_shannon_distances():
    half = phase_structure([count_phases(np.array([0, 1] * 10), 2, FPS)], FPS)
    one = phase_structure([count_phases(np.zeros(20, dtype=int), 2, FPS)], FPS)
    same = phase_distances(half, half)
    assert (same.shares, same.transitions, same.durations.tolist()) == (0, 0, [0, 0])
    # of (1/2, 1/2) and (1, 0), middle (3/4, 1/4): H(3/4, 1/4) - H(1/2, 1/2) / 2 bits
    divergence = -(0.75 * np.log2(0.75) + 0.25 * np.log2(0.25)) - 0.5
    distances = phase_distances(half, one)
    assert distances.shares == pytest.approx(np.sqrt(divergence))
    assert distances.transitions == 1
    # one step against 20, and there against never
    assert distances.durations.tolist() == [1, 1]


def test_labels_that_are_no_class():
    with pytest.raises(ValueError, match="for 2 classes"):
        count_phases(np.array([0, 2]), 2, FPS)


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
    difference = estimate.combined(Estimate(1.5, draws - 0.5), np.subtract)
    assert (difference.value, difference.interval()) == (0.5, (0.5, 0.5))
    assert estimate.combined(Estimate(1.0, np.zeros(0)), np.subtract).interval() is None


def test_mean_over_training_seeds():
    mean = mean_estimate([Estimate(1, np.array([0.0, 2.0])), Estimate(3, np.array([4.0, 4.0]))])
    assert (mean.value, mean.draws.tolist()) == (2, [2, 3])
