"""Exponential maps and six numbers: against SciPy, at the hard angles, and back to positions."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cospeech.corpus.synthetic.skeleton import SKELETON
from cospeech.errors import CospeechError
from cospeech.motion.bvh import read_bvh, write_bvh
from cospeech.motion.codecs import ExponentialMapCodec, SixNumberCodec
from cospeech.motion.codecs.exponential_maps import (
    exponential_maps,
    nearest_branch,
    quaternions_of_exponential_maps,
)
from cospeech.motion.codecs.rotations import matrices_of_quaternions
from cospeech.motion.codecs.six_numbers import matrices_of_six_numbers
from cospeech.motion.kinematics import skeleton_positions
from cospeech.motion.upper_body import UPPER_BODY
from tests.fabricated.mocap import TRINITY_BODY, swinging

CODECS = [ExponentialMapCodec, SixNumberCodec]
GESTICULATOR = [
    *(f"Left{joint}" for joint in ("Hand", "ForeArm", "Arm", "Shoulder")),
    *(f"Right{joint}" for joint in ("Hand", "ForeArm", "Arm", "Shoulder")),
    "Head", "Neck1", "Neck", "Spine3", "Spine2", "Spine1", "Spine",
]  # fmt: skip
numbers = st.floats(-1, 1, width=32)
directions = st.tuples(numbers, numbers, numbers).filter(lambda v: np.linalg.norm(v) > 0.1)


def unit(direction):
    return np.asarray(direction, np.float64) / np.linalg.norm(direction)


def random_rotations(joints=24, frames=60, seed=0):
    """Smooth turns of every joint, far beyond pi, as float32 quaternions of either sign."""
    rng = np.random.default_rng(seed)
    times = np.linspace(0, 3, frames)[:, None, None]
    vectors = 4 * np.sin(rng.uniform(0.5, 1.5, (1, joints, 3)) * times + rng.uniform(0, 6, 3))
    quaternions = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_quat().reshape(frames, joints, 4)
    signs = rng.choice([-1, 1], (frames, joints, 1))
    return torch.from_numpy((quaternions * signs).astype(np.float32))


@settings(max_examples=40, deadline=None)
@given(directions, st.floats(0, math.pi))
def test_exponential_maps_are_scipys_rotation_vectors(direction, angle):
    expected = Rotation.from_rotvec(unit(direction) * angle)
    quaternion = torch.from_numpy(expected.as_quat().astype(np.float32))
    vector = exponential_maps(quaternion).double().numpy()
    assert np.linalg.norm(vector) <= math.pi + 1e-6
    assert (Rotation.from_rotvec(vector).inv() * expected).magnitude() < 2e-6


@settings(max_examples=40, deadline=None)
@given(directions, st.floats(0, 7))
def test_vectors_of_any_length_are_the_rotation_scipy_makes_of_them(direction, angle):
    vector = (unit(direction) * angle).astype(np.float32)
    matrix = matrices_of_quaternions(quaternions_of_exponential_maps(torch.from_numpy(vector)))
    np.testing.assert_allclose(matrix, Rotation.from_rotvec(vector).as_matrix(), atol=2e-6)


@settings(max_examples=40, deadline=None)
@given(directions, directions)
def test_six_numbers_give_a_rotation_whatever_they_are(first, second):
    if np.linalg.norm(np.cross(unit(first), unit(second))) < 0.05:
        return
    six = torch.tensor([*first, *second])
    matrix = matrices_of_six_numbers(six).double()
    torch.testing.assert_close(matrix.T @ matrix, torch.eye(3).double(), atol=2e-5, rtol=0)
    assert matrix.det() > 0
    np.testing.assert_allclose(matrix[:, 0], unit(first), atol=1e-6)
    assert matrix[:, 1] @ torch.from_numpy(unit(second)) > 0


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 1e-4, 2.0, math.pi - 1e-6, math.pi])
def test_slopes_are_finite_at_the_hard_angles(angle):
    vector = torch.tensor([0.0, angle, 0.0], requires_grad=True)
    quaternion = quaternions_of_exponential_maps(vector)
    back = exponential_maps(quaternion)
    back[1].backward()
    torch.testing.assert_close(vector.grad, torch.tensor([0.0, 1.0, 0.0]), atol=1e-5, rtol=0)
    # by pi about one direction or about its opposite is the same rotation
    torch.testing.assert_close(back.abs(), vector, atol=1e-6, rtol=0)


def test_a_sequence_takes_the_nearer_branch_at_every_frame():
    vectors = exponential_maps(random_rotations())
    found = nearest_branch(vectors)
    lengths = vectors.norm(dim=-1, keepdim=True)
    other = vectors * (1 - 2 * math.pi / lengths)
    expected = vectors.clone()
    for t in range(1, len(vectors)):
        for joint in range(vectors.shape[1]):
            before = expected[t - 1, joint]
            if (other[t, joint] - before).norm() < (vectors[t, joint] - before).norm():
                expected[t, joint] = other[t, joint]
    assert (expected != vectors).any()
    torch.testing.assert_close(found, expected)
    batched = nearest_branch(torch.stack([vectors, vectors.flip(0)]))
    torch.testing.assert_close(batched[0], expected)


def test_a_turn_through_pi_has_no_jump():
    angles = np.linspace(2.5, 3.8, 40)
    turns = Rotation.from_rotvec(np.outer(angles, unit([1, 2, -1])))
    vectors = exponential_maps(torch.from_numpy(turns.as_quat().astype(np.float32)))[:, None]
    assert vectors.diff(dim=0).norm(dim=-1).max() > 5
    steps = nearest_branch(vectors).diff(dim=0).norm(dim=-1)
    torch.testing.assert_close(
        steps, torch.full_like(steps, angles[1] - angles[0]), rtol=1e-3, atol=0
    )


@pytest.mark.parametrize("codec_class", CODECS)
def test_real_motion_comes_back(codec_class, tmp_path):
    take = read_bvh(write_bvh(tmp_path / "a.bvh", swinging(TRINITY_BODY, "codec", 4.0, 20.0)))
    codec = codec_class(take.skeleton, GESTICULATOR)
    rotations = torch.from_numpy(take.rotations_local)
    features = codec.encode(rotations)
    assert features.shape == (80, codec.size)
    assert codec.size == 15 * codec.values_per_joint
    roots = torch.from_numpy(take.positions[:, 0])
    torch.testing.assert_close(
        codec.decode(features, roots), torch.from_numpy(take.positions), atol=1e-5, rtol=0
    )
    made = codec.motion(features, 20.0, roots)
    posed = skeleton_positions(made.skeleton, made.rotations_local, made.positions[:, 0])
    np.testing.assert_allclose(posed, take.positions, atol=1e-5)


@pytest.mark.parametrize("codec_class", CODECS)
def test_any_rotations_of_any_joint_come_back_in_batches(codec_class):
    rotations = torch.stack([random_rotations(len(SKELETON), 20, seed) for seed in range(2)])
    codec = codec_class(SKELETON, SKELETON.joints)
    decoded = codec.decode(codec.encode(rotations), torch.zeros(2, 20, 3))
    for found, wanted in zip(decoded, rotations, strict=True):
        expected = skeleton_positions(SKELETON, wanted.numpy(), np.zeros((20, 3)))
        np.testing.assert_allclose(found, expected, atol=2e-5)


@pytest.mark.parametrize("codec_class", CODECS)
def test_channels_are_in_the_order_asked_for_and_a_missing_joint_rests(codec_class):
    rotations = random_rotations()
    codec = codec_class(TRINITY_BODY, ["LeftArm", "Tail", "Spine"])
    n = codec.values_per_joint
    features = codec.encode(rotations)
    alone = codec_class(TRINITY_BODY, ["Spine"]).encode(rotations)
    torch.testing.assert_close(features[:, 2 * n :], alone)
    at_rest = codec_class(TRINITY_BODY, ["Hips"]).encode(torch.tensor([[[0.0, 0, 0, 1]] * 24]))
    torch.testing.assert_close(features[:, n : 2 * n], at_rest.expand(60, -1))
    changed = features.clone()
    changed[:, n : 2 * n] += 1
    torch.testing.assert_close(codec.decode(changed), codec.decode(features))


def test_what_is_not_coded_keeps_its_mean_rotation_in_the_checkpoint():
    rotations = torch.from_numpy(swinging(TRINITY_BODY, "mean", 4.0, 20.0).rotations_local)
    codec = ExponentialMapCodec(TRINITY_BODY, ["Spine"])
    codec.fit(rotations)
    other = ExponentialMapCodec(TRINITY_BODY, ["Spine"])
    other.load_state_dict(codec.state_dict())
    arm = TRINITY_BODY.index["LeftArm"]
    found = other.decode_rotations(torch.zeros(1, 3))[0, arm]
    expected = Rotation.from_quat(rotations[:, arm].double().numpy()).mean().as_matrix()
    np.testing.assert_allclose(found, expected, atol=1e-6)


@pytest.mark.parametrize(
    ("skeleton", "lacks"),
    [(UPPER_BODY, "rest offsets"), (replace(TRINITY_BODY, name="b"), "wing")],
)
def test_a_skeleton_that_rotations_can_not_pose_is_refused(skeleton, lacks):
    with pytest.raises(CospeechError, match=f"has no {lacks}"):
        SixNumberCodec(skeleton, ["wing"])


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16, torch.float16, torch.float64])
@pytest.mark.parametrize("codec_class", [ExponentialMapCodec, SixNumberCodec])
def test_rotations_that_come_out_are_unit_and_pose_what_comes_out(codec_class, dtype):
    codec = codec_class(SKELETON, ["LeftArm", "RightForeArm", "Neck"])
    generator = torch.Generator().manual_seed(0)
    features = 2 * torch.randn(50, codec.size, generator=generator)  # some turn by more than pi
    motion = codec.motion(features.to(dtype), 20.0)
    lengths = np.linalg.norm(motion.rotations_local, axis=-1)
    np.testing.assert_allclose(lengths, 1, atol=1e-6)
    posed = skeleton_positions(motion.skeleton, motion.rotations_local)
    apart = posed - motion.positions - (posed - motion.positions)[:, :1]
    assert np.abs(apart).max() < 1e-5
