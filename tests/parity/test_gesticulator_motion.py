"""Rotations, exponential maps, channels and windows against those of Gesticulator's pipeline."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from cospeech.corpus.recording import Recording
from cospeech.corpus.windows import WindowDataset, WindowSpec
from cospeech.methods.gesticulator.module import JOINTS, Gesticulator
from cospeech.motion.bvh import read_bvh
from cospeech.motion.codecs import ExponentialMapCodec
from cospeech.motion.codecs.exponential_maps import (
    exponential_maps,
    nearest_branch,
    quaternions_of_exponential_maps,
)
from cospeech.motion.joint_map import bare_names
from cospeech.motion.kinematics import euler_to_quaternion, quaternion_to_euler
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.speech.speech import Speech
from tests.corpora import REST_POSE, make_store
from tests.parity import formulas
from tests.parity.test_gesticulator_evaluation import POINTS

EXCERPT = "real/trinity/NaturalTalking_030_2_1From5.bvh"
V = formulas.V


def of_at_most_pi(vectors):
    """The same rotations: published vectors come from half-angle products, of up to 2 pi."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(lengths > np.pi, vectors * (1 - 2 * np.pi / lengths), vectors)


def degrees_apart(found, expected):
    return np.abs((found - expected + 180) % 360 - 180)


def turns(order, degrees):
    return torch.from_numpy(euler_to_quaternion(np.radians(degrees), order))


@pytest.mark.parametrize("order", ["ZXY", "XYZ"])
def test_single_rotations(order):
    expected = formulas.expected("gesticulator")
    published = expected[f"euler_to_expmap_{order}"]
    found = exponential_maps(turns(order, formulas.noise((24, 3), 11, 170)))
    assert np.linalg.norm(published, axis=1).max() > np.pi
    np.testing.assert_allclose(found, of_at_most_pi(published), atol=1e-12)

    vectors = formulas.noise((24, 3), 9, 2.9)
    vectors[0] = 0
    quaternions = quaternions_of_exponential_maps(torch.from_numpy(vectors))
    angles = np.degrees(quaternion_to_euler(quaternions.numpy(), order))
    assert degrees_apart(angles, expected[f"expmap_to_euler_{order}"]).max() < 1e-9


@pytest.mark.parametrize("range_of_angles", ["free", "wrapped"])
@pytest.mark.parametrize("case", ["two", "one", "three", "small"])
def test_jumps_at_pi(case, range_of_angles):
    expected, i = formulas.expected("gesticulator"), np.arange(60)
    first = {
        "two": 150 + 60 * np.sin(2 * np.pi * i / 60 + 0.5 * V),
        "one": 150.0 + i,
        "three": 178 + 8 * np.sin(2 * np.pi * i / 40 + 0.2 + 0.5 * V),
        "small": 20 + 15 * np.sin(0.2 * i + 0.5 * V),
    }[case]
    angles = np.stack([first, 10 * np.sin(0.3 * i), 5 * np.cos(0.2 * i)], axis=-1)
    if range_of_angles == "wrapped":
        angles = (angles + 180) % 360 - 180
    vectors = exponential_maps(turns("ZXY", angles))
    entry = f"unroll_{case}_{range_of_angles}"
    np.testing.assert_allclose(vectors, of_at_most_pi(expected[f"{entry}_before"]), atol=1e-12)

    found = nearest_branch(vectors[:, None])[:, 0].numpy()
    published = expected[f"{entry}_gesticulator"]
    if entry == "unroll_one_wrapped":
        # The published rule turns the stretch between two jumps over, and leaves a single jump as
        # it is. Ours goes on, to what the published one gives where the angles weren't wrapped.
        assert np.linalg.norm(np.diff(published, axis=0), axis=1).max() > 6
        published = expected["unroll_one_free_gesticulator"]
    np.testing.assert_allclose(found, published, atol=1e-12)
    assert np.linalg.norm(np.diff(found, axis=0), axis=1).max() < 0.15


@pytest.fixture(scope="module")
def published(shared):
    with np.load(shared / "data/parity/gesticulator/expected.npz") as arrays:
        parts = ("expmap", "inverse", "motion")
        return {name: arrays[name] for name in arrays.files if name.startswith(parts)}


@pytest.fixture(scope="module")
def excerpt(shared):
    """Rotations of the Trinity excerpt without the last frame, which the published code drops."""
    motion = read_bvh(shared / "data" / EXCERPT)
    return motion.skeleton, torch.from_numpy(motion.rotations_local[:-1]).double()


@pytest.fixture(scope="module")
def codec(excerpt):
    return ExponentialMapCodec(excerpt[0], JOINTS)


@pytest.fixture(scope="module")
def features(codec, excerpt):
    return codec.encode(excerpt[1])


def test_the_45_channels_of_a_recording(features, published):
    assert features.shape == (published["expmap_n_frames"], 45)
    names = [f"{joint}_{axis}" for joint in JOINTS for axis in ("alpha", "beta", "gamma")]
    assert names == published["expmap_channels"].tolist()
    frames = published["expmap_frames"]
    np.testing.assert_allclose(features[frames], published["expmap"], atol=1e-6)
    np.testing.assert_allclose(features.mean(0), published["expmap_mean"], atol=1e-6)
    np.testing.assert_allclose(features.std(0, False), published["expmap_std"], atol=1e-6)


def test_forearms_whose_euler_angles_change_branch_hundreds_of_times(features, published):
    columns = [3 * JOINTS.index(j) + k for j in ("LeftForeArm", "RightForeArm") for k in range(3)]
    found = features[:, columns]
    np.testing.assert_allclose(found, published["expmap_forearms"], atol=1e-6)
    before = published["expmap_forearms_before_unroll"].reshape(-1, 2, 3)
    assert (np.linalg.norm(before, axis=-1) > np.pi).sum(axis=0).tolist() == [317, 296]
    np.testing.assert_allclose(found, of_at_most_pi(before).reshape(-1, 6), atol=1e-6)


def test_constant_channels_stay(features, published):
    """The published pipeline keeps 39 of this file's channels; a network takes 45 of any file."""
    kept = published["expmap_channels_after_constants_removed"].tolist()
    dropped = {name.split("_")[0] for name in set(published["expmap_channels"]) - set(kept)}
    assert dropped == {"LeftShoulder", "RightShoulder"}
    still = [
        3 * JOINTS.index(side) + k for side in ("LeftShoulder", "RightShoulder") for k in range(3)
    ]
    assert features[:, still].std(0).max() < 1e-6
    np.testing.assert_allclose(features[0, still], [0, 0, -np.pi / 2, 0, 0, np.pi / 2], atol=1e-6)


def test_the_way_back_to_angles_and_positions(codec, excerpt, features, published):
    skeleton, rotations = excerpt
    upright = rotations[:1].clone()
    upright[:, 0] = torch.tensor([0.0, 0, 0, 1])
    codec.fit(upright)  # the published code freezes other joints in the first frame, hips upright
    names = bare_names(skeleton)
    matrices = codec.decode_rotations(features[:40]).numpy()
    channels = [str(channel).split("_") for channel in published["inverse_channels"]]
    joints = [joint for joint, channel in channels if channel == "Zrotation"]
    assert len(joints) == 56
    for joint in joints:
        columns = [
            channels.index([joint, f"{axis}rotation"]) for axis in "ZXY"
        ]  # the order of the file
        angles = published["inverse_euler"][:, columns]
        quaternions = Rotation.from_matrix(matrices[:, names[joint]]).as_quat()
        found = np.degrees(quaternion_to_euler(quaternions, "ZXY"))
        assert degrees_apart(found, angles).max() < 1e-2, joint
        there = Rotation.from_euler("ZXY", angles, degrees=True).as_quat()
        assert np.abs((there * quaternions).sum(axis=-1)).min() > 1 - 1e-12, joint

    points = 100 * codec.decode(features[:40]).numpy()[:, [names[point] for point in POINTS]]
    np.testing.assert_allclose(points - points[:, :1], published["motion_positions"], atol=1e-5)


def windows_over(folder, frames, spec):
    motion = Motion(UPPER_BODY, 20.0, REST_POSE[None].repeat(frames, axis=0))
    speech = Speech(np.zeros(800 * frames, dtype=np.float32), ())
    takes = [
        Recording(f"take{i}", "ada", speech, motion, source="made", licence="none")
        for i in range(3)
    ]
    return WindowDataset(make_store(folder, takes), "train", spec, frozenset({"positions"}))


def test_windows(tmp_path):
    """Stretches of speech that are windows, and where the three sides of a window differ.

    A published window of 70 frames (dev: 230) is 40 (200) to be made with 10 before and 20 after,
    all of them recorded, so edges of recordings are never made.
    """
    for row, values in enumerate(formulas.expected("gesticulator")["windows"]):
        audio, motion, text, is_dev, count, length, text_length, *places = values.tolist()
        frames = min(audio, -(-motion // 3), 2 * text) // 2 * 2
        spec = WindowSpec(fps=20, frames=length, seed_frames=0, stride=10)
        found = windows_over(tmp_path / str(row), frames, spec)
        assert (len(found), length, text_length) == (count, 230 if is_dev else 70, length // 2)
        first, last = found.firsts[[0, -1]].tolist()
        assert [first, last, first / 2, last / 2, 3 * first, 3 * last] == places


def test_our_windows_reach_to_the_edges_of_a_recording(tmp_path):
    """Context beyond them is silence: 260 frames of which published windows leave 30 unmade."""
    found = windows_over(tmp_path, 260, Gesticulator.window)
    made = {first + 2 + frame for first in found.firsts.tolist() for frame in range(40)}
    assert (min(made), max(made)) == (2, 251)
    assert found.firsts.tolist() == list(range(0, 220, 10))
    assert (Gesticulator.window.past, 1 + Gesticulator.window.ahead) == (10, 20)
    judged = Gesticulator.window.of_split("val")
    assert (judged.frames, judged.stride) == (100, 100)  # published: 200 every 10, overlapping
