"""Quantities of poses that controls speak of."""

import numpy as np
import pytest

from cospeech.errors import ConfigError
from cospeech.matching.control import QUANTITIES, measure

ROLES = ("neck", "left_elbow", "left_wrist", "right_elbow", "right_wrist")


def clip(left, right, elbows=0.0):
    """``(T, 5, 3)`` with the wrists where they are said to be."""
    left, right = np.array(left, dtype=np.float32), np.array(right, dtype=np.float32)
    positions = np.full((len(left), 5, 3), elbows, dtype=np.float32)
    positions[:, 2], positions[:, 4] = left, right
    return positions


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("left_wrist_height", [0.2, 0.2, 0.5]),
        ("right_wrist_height", [0.1, 0.6, 0.6]),
        # 3-4-5 triangles: 0.5 m in a fifteenth of a second; the first frame copies the second.
        ("left_wrist_speed", [7.5, 7.5, 4.5]),
        ("right_wrist_speed", [7.5, 7.5, 0.0]),
        ("speed", [7.5, 7.5, 2.25]),
        ("asymmetry", [0.1, 0.4, 0.1]),
        ("left_wrist_radius", [0.0, 0.5, 0.5]),
        ("right_wrist_radius", [1.0, 1.0, 1.0]),
        ("radius", [0.5, 0.75, 0.75]),
        ("left_wrist_x", [0.0, 0.3, 0.3]),
        ("left_wrist_y", [0.2, 0.2, 0.5]),
        ("left_wrist_z", [0.0, 0.4, 0.4]),
        ("hands_distance", [np.sqrt(1.01), np.sqrt(0.9 + 0.16 + 0.16), np.sqrt(0.9 + 0.17)]),
        ("right_elbow_height", [0.05, 0.05, 0.05]),
    ],
)
def test_values_by_hand(name, expected):
    left = [[0, 0.2, 0], [0.3, 0.2, 0.4], [0.3, 0.5, 0.4]]
    right = [[-0.6, 0.1, 0.8], [-0.6, 0.6, 0.8], [-0.6, 0.6, 0.8]]
    if name == "hands_distance":
        gaps = np.subtract(left, right)
        expected = np.sqrt((gaps**2).sum(axis=1))
    values = measure(name, clip(left, right, 0.05), ROLES, 15.0)
    np.testing.assert_allclose(values, expected, atol=1e-6)


def test_every_quantity_is_measured_per_sequence_and_says_what_it_is():
    rng = np.random.default_rng(0)
    poses = rng.normal(size=(3, 10, 5, 3)).astype(np.float32)
    for name, quantity in QUANTITIES.items():
        assert quantity.unit in ("m", "m/s")
        assert quantity.about
        together = measure(name, poses, ROLES, 15.0)
        assert together.shape == (3, 10)
        for sequence in range(3):
            alone = measure(name, poses[sequence], ROLES, 15.0)
            # No speed is taken from one sequence to the next.
            np.testing.assert_array_equal(together[sequence], alone)


def test_a_single_frame_stands_still_and_no_frame_is_no_value():
    one = clip([[0, 0, 0]], [[0, 0, 0]])
    assert measure("left_wrist_speed", one, ROLES, 15.0).tolist() == [0.0]
    assert measure("left_wrist_speed", one[:0], ROLES, 15.0).shape == (0,)


def test_order_of_the_joints_is_that_of_the_roles():
    positions = clip([[1, 2, 3]], [[4, 5, 6]])
    turned = measure("left_wrist_height", positions[:, ::-1], ROLES[::-1], 15.0)
    assert turned.tolist() == [2.0]


def test_unknown_quantities_and_missing_joints_say_what_there_is():
    positions = clip([[1, 2, 3]], [[4, 5, 6]])
    with pytest.raises(ConfigError, match="did you mean 'left_wrist_height'") as caught:
        measure("left_wrist_heigth", positions, ROLES, 15.0)
    assert "hands_distance" in caught.value.hint
    with pytest.raises(ConfigError, match="asymmetry needs right_wrist"):
        measure("asymmetry", positions[:, :4], ROLES[:4], 15.0)
