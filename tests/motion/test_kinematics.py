"""Rotations and forward kinematics against hand calculation, SciPy and a second library."""

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cospeech.motion.bvh import read_bvh
from cospeech.motion.kinematics import (
    euler_to_quaternion,
    forward_kinematics,
    heading_angles,
    invert_quaternions,
    local_translations,
    multiply_quaternions,
    quaternion_to_euler,
    rotate_vectors,
    skeleton_positions,
    turn_about_vertical,
    world_rotations,
)
from cospeech.motion.skeleton import Skeleton
from tests.bvh_elsewhere import read_elsewhere

ORDERS = ["".join(order) for n in (1, 2, 3) for order in itertools.permutations("XYZ", n)]
ARM = Skeleton(
    "arm",
    ("shoulder", "elbow", "wrist"),
    (-1, 0, 1),
    offsets=np.array([[0.0, 1.4, 0.0], [0.3, 0.0, 0.0], [0.25, 0.0, 0.0]]),
)


@pytest.fixture
def generator():
    return np.random.default_rng(5)


@pytest.mark.parametrize("order", ORDERS)
def test_euler_angles_mean_what_scipy_means_by_intrinsic(order, generator):
    angles = generator.uniform(-np.pi, np.pi, (200, len(order)))
    ours = Rotation.from_quat(euler_to_quaternion(angles, order)).as_matrix()
    expected = Rotation.from_euler(order, angles).as_matrix()
    np.testing.assert_allclose(ours, expected, atol=1e-14)


def test_euler_angles_are_single_axis_matrices_in_channel_order():
    angles = np.radians([[30.0, 40.0, 50.0]])
    z, x, y = angles[0]
    rz = [[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]]
    rx = [[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]]
    ry = [[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]]
    by_hand = np.array(rz) @ np.array(rx) @ np.array(ry)
    vector = np.array([[0.3, -0.2, 0.9]])
    turned = rotate_vectors(euler_to_quaternion(angles, "ZXY"), vector)
    np.testing.assert_allclose(turned[0], by_hand @ vector[0], atol=1e-15)


@pytest.mark.parametrize("order", ["ZXY", "XYZ", "ZYX"])
def test_euler_round_trip_even_at_gimbal_lock(order, generator):
    angles = generator.uniform(-np.pi, np.pi, (100, 3))
    angles[:10, 1] = np.pi / 2
    quaternions = euler_to_quaternion(angles, order)
    again = euler_to_quaternion(quaternion_to_euler(quaternions, order), order)
    np.testing.assert_allclose(np.abs((again * quaternions).sum(-1)), 1.0, atol=1e-9)


@pytest.mark.parametrize("order", ["XX", "XYA", "xyz"])
def test_euler_refuses_unknown_orders(order):
    with pytest.raises(ValueError, match="rotation order"):
        euler_to_quaternion(np.zeros((1, len(order))), order)


def test_quaternion_products_match_scipy(generator):
    a, b = Rotation.random(50, rng=generator), Rotation.random(50, rng=generator)
    ours = Rotation.from_quat(multiply_quaternions(a.as_quat(), b.as_quat())).as_matrix()
    np.testing.assert_allclose(ours, (a * b).as_matrix(), atol=1e-14)
    vectors = generator.normal(size=(50, 3))
    np.testing.assert_allclose(rotate_vectors(a.as_quat(), vectors), a.apply(vectors), atol=1e-14)
    back = rotate_vectors(invert_quaternions(a.as_quat()), a.apply(vectors))
    np.testing.assert_allclose(back, vectors, atol=1e-14)


def test_two_bone_arm_by_hand():
    quarter_z, quarter_y = [0, 0, np.sqrt(0.5), np.sqrt(0.5)], [0, np.sqrt(0.5), 0, np.sqrt(0.5)]
    still = [0.0, 0.0, 0.0, 1.0]
    rotations = np.array(
        [[still, still, still], [quarter_z, still, still], [quarter_z, quarter_y, still]]
    )
    expected = np.array(
        [
            [[0, 1.4, 0], [0.3, 1.4, 0], [0.55, 1.4, 0]],
            # the shoulder turned a quarter about z: the arm points up
            [[0, 1.4, 0], [0, 1.7, 0], [0, 1.95, 0]],
            # then the elbow a quarter about its own y: x goes to -z, which is also the world's
            [[0, 1.4, 0], [0, 1.7, 0], [0, 1.7, -0.25]],
        ]
    )
    np.testing.assert_allclose(skeleton_positions(ARM, rotations), expected, atol=1e-7)
    moved = skeleton_positions(ARM, rotations, np.array([[1.0, 2.0, 3.0]] * 3))
    np.testing.assert_allclose(moved, np.add(expected, [1.0, 0.6, 3.0]), atol=1e-6)


def test_forward_kinematics_against_matrix_chain(generator):
    parents = (-1, 0, 1, 1, 3, 0, 5)
    rotations = Rotation.random(4 * 7, rng=generator).as_quat().reshape(4, 7, 4)
    translations = generator.normal(size=(4, 7, 3))
    positions, world = forward_kinematics(parents, translations, rotations)
    for frame in range(4):
        matrices: list[np.ndarray] = []
        for joint, parent in enumerate(parents):
            local = np.eye(4)
            local[:3, :3] = Rotation.from_quat(rotations[frame, joint]).as_matrix()
            local[:3, 3] = translations[frame, joint]
            matrices.append(local if parent < 0 else matrices[parent] @ local)
            np.testing.assert_allclose(positions[frame, joint], matrices[-1][:3, 3], atol=1e-13)
    np.testing.assert_allclose(world_rotations(parents, rotations), world, atol=1e-15)
    np.testing.assert_allclose(
        local_translations(parents, positions, world), translations, atol=1e-13
    )


def test_forward_kinematics_refuses_shapes_that_disagree():
    with pytest.raises(ValueError, match="do not belong together"):
        forward_kinematics((-1, 0), np.zeros((3, 3, 3)), np.zeros((3, 2, 4)))


def test_skeleton_without_offsets_is_refused():
    with pytest.raises(ValueError, match="no offsets"):
        skeleton_positions(Skeleton("bare", ("a",), (-1,)), np.zeros((1, 1, 4)))


def test_heading_brings_right_to_left_onto_x():
    yaw = np.radians([0.0, 90.0, -135.0])
    left = np.stack([np.cos(yaw), [0.1, 0.0, -0.2], -np.sin(yaw)], axis=-1)
    angles = heading_angles(np.zeros((3, 3)), left)
    assert angles is not None
    turned = turn_about_vertical(left, angles)
    expected = np.array([[1, 0.1, 0], [1, 0, 0], [1, -0.2, 0]])
    np.testing.assert_allclose(turned, expected, atol=1e-15)
    # turning by +90 degrees about y takes z to x
    np.testing.assert_allclose(
        turn_about_vertical(np.array([[0.0, 0.0, 1.0]]), np.array([np.pi / 2])),
        [[1, 0, 0]],
        atol=1e-15,
    )


def test_heading_of_an_upright_line_is_the_last_one_known():
    left = np.array([[0, 1.0, 0], [0, 0, -1.0], [0, 1.0, 0], [1.0, 0, 0]])
    angles = heading_angles(np.zeros((4, 3)), left)
    assert angles is not None
    np.testing.assert_allclose(angles, [-np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0])
    assert heading_angles(np.zeros((2, 3)), np.array([[0, 1.0, 0]] * 2)) is None


@pytest.mark.parametrize(
    "file", ["zeggs/067_Speech_2_x_1_0.bvh", "trinity/NaturalTalking_030_2_1From5.bvh"]
)
def test_pymotion_finds_the_same_positions(shared, tmp_path, file):
    path = shared / "data" / "real" / file
    ours = read_bvh(path)
    # pymotion closes an end site only when it has seen it in its own spelling
    (tmp_path / "a.bvh").write_text(path.read_text().replace("End site", "End Site"))
    theirs = read_elsewhere(tmp_path / "a.bvh")
    shown = [ours.skeleton.index[name] for name in theirs.names]
    np.testing.assert_allclose(ours.positions[:, shown], theirs.positions_world / 100, atol=1e-5)
