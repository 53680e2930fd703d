"""How joints move, against numbers that can be worked out by hand and against plain loops."""

import itertools

import numpy as np
import pytest

from cospeech.metrics import movement

FPS = 20.0
LEFT, RIGHT = 0, 1
WRISTS = (LEFT, RIGHT)


def still(windows=1, frames=100, joints=2):
    return np.zeros((windows, frames, joints, 3))


def test_one_wrist_moving_one_centimetre_per_frame():
    windows = still()
    windows[0, :, LEFT, 0] = 0.01 * np.arange(100)
    velocities = movement.wrist_velocities(windows, WRISTS, FPS)
    assert velocities.shape == (1, 99)
    # 20 cm/s on the left, nothing on the right
    np.testing.assert_allclose(velocities, 0.1)
    np.testing.assert_allclose(movement.wrist_velocities(windows, [LEFT], FPS), 0.2)


def test_velocity_is_the_sum_of_absolute_values_as_printed():
    windows = still()
    windows[0, :, LEFT] = np.arange(100)[:, None] * [0.01, -0.02, 0.03]
    np.testing.assert_allclose(movement.wrist_velocities(windows, [LEFT], FPS), 0.06 * FPS)


def test_the_curve_is_the_median_over_windows_at_each_step():
    velocities = np.array([[1.0, 9.0], [2.0, 7.0], [9.0, 8.0]])
    assert movement.median_curve(velocities).tolist() == [2.0, 8.0]


def test_area_between_two_curves():
    # 0.1 m/s apart for 100 steps of 1/20 s, half of them above and half below
    curve, other = np.full(100, 0.3), np.repeat([0.2, 0.4], 50)
    assert movement.area_between(curve, other, FPS) == pytest.approx(0.5)
    assert movement.area_between(curve, curve, FPS) == 0
    with pytest.raises(ValueError, match="steps"):
        movement.area_between(curve, other[:99], FPS)


def test_reach_is_the_farthest_moment_of_either_wrist_from_its_mean():
    mean_pose = np.array([[1.0, 2.0, 3.0], [-1.0, 2.0, 3.0]])
    windows = np.tile(mean_pose, (3, 100, 1, 1))
    windows[0, 17, RIGHT] += [0.03, -0.04, 0.0]
    windows[0, 60, LEFT] += [0.0, 0.0, 0.02]
    windows[2, 99, LEFT] += [0.0, 0.12, 0.05]
    reaches = movement.farthest_reaches(windows, WRISTS, mean_pose)
    np.testing.assert_allclose(reaches, [0.05, 0.0, 0.13], atol=1e-12)


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


def test_derivatives_of_a_polynomial_in_both_conventions():
    """x = t³ / 6 metres: speed t² / 2, acceleration t, jerk 1, whatever the rate; y the half."""
    times = np.arange(5) / FPS
    positions = np.zeros((5, 2, 3))
    positions[:, LEFT, 0] = times**3 / 6
    positions[:, RIGHT, 1] = times**3 / 12
    jerk = movement.derivative_sizes(positions, 3, FPS)
    np.testing.assert_allclose(jerk, [[1, 0.5], [1, 0.5]])
    # second differences of a cubic are its second derivative in the middle
    acceleration = movement.derivative_sizes(positions, 2, FPS)
    np.testing.assert_allclose(acceleration[:, LEFT], times[1:-1])
    np.testing.assert_allclose(movement.derivative_sizes(100 * positions, 3, 1), 100 * jerk / 8000)
    np.testing.assert_allclose(
        movement.derivative_sizes(positions, 2, 1), acceleration / 400, atol=1e-15
    )
    stacked = movement.derivative_sizes(np.stack([positions, 2 * positions]), 2, FPS)
    np.testing.assert_allclose(stacked, [acceleration, 2 * acceleration])


def test_sizes_are_of_vectors():
    positions = np.zeros((2, 1, 3))
    positions[1, 0] = [0.03, -0.04, 0.12]
    assert movement.derivative_sizes(positions, 1, FPS).item() == pytest.approx(0.13 * 20)


@pytest.mark.parametrize(("frames", "order"), [(3, 3), (5, 0), (0, 1)])
def test_there_is_no_difference_of_too_few_frames(frames, order):
    with pytest.raises(ValueError, match=f"order {order} of {frames} frames"):
        movement.derivative_sizes(np.zeros((frames, 1, 3)), order, FPS)


def test_a_histogram_counts_what_is_beyond_its_last_bin():
    sizes = np.array([[0.0, 9.0], [0.49, 1.5], [0.5, 1.49], [1.0, 0.2], [7.0, np.inf]])
    counts = movement.histogram(sizes, 0.5, 3)
    # 0-0.5, 0.5-1, 1-1.5, 1.5 and more
    assert counts.tolist() == [[2, 1], [1, 0], [1, 1], [1, 3]]
    assert counts.sum(axis=0).tolist() == [5, 5]
    assert movement.histogram(sizes[:, 0], 0.5, 3).tolist() == [2, 1, 1, 1]
    for odd in (-0.1, np.nan):
        with pytest.raises(ValueError, match="0 or more"):
            movement.histogram([1.0, odd], 0.5, 3)


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
