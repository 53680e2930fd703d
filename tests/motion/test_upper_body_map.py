"""The joint maps, judged by the published auto-encoder of human upper bodies.

It was trained on Human3.6M and reconstructs real people with a mean error of 0.06 to 0.10; a wrong
joint, axis or side shows as 0.25 and more.
"""

import numpy as np
import pytest
import torch

from cospeech.metrics.encoder import import_published
from cospeech.motion.bvh import read_bvh
from cospeech.motion.motion import Motion, resample_positions
from cospeech.motion.upper_body import (
    UPPER_BODY,
    doubts_about,
    find_joint_map,
    to_upper_body,
)

PEOPLE = {
    "zeggs": "zeggs/067_Speech_2_x_1_0.bvh",
    "beat": "beat/2_scott_0_1_1.bvh",
    "trinity": "trinity/NaturalTalking_030_2_1From5.bvh",
    "cmu": "cmu/18_01.bvh",
}
SHOULDER = UPPER_BODY.index["left_shoulder"]


@pytest.fixture(scope="module")
def encoder(shared):
    checkpoints = shared / "data" / "real" / "checkpoints"
    return import_published(checkpoints / "trimodal_h36m_gesture_autoencoder_34f.bin")


def upper_body_of(shared, corpus):
    path = shared / "data" / "real" / PEOPLE[corpus]
    joint_map = find_joint_map(read_bvh(path).skeleton)
    assert joint_map.name == corpus
    return to_upper_body(read_bvh(path, unit_scale=joint_map.unit_scale), joint_map)


def reconstruction_error(encoder, motion, signs=(1.0, 1.0, 1.0)):
    positions = resample_positions(motion.positions, motion.fps, 15.0) * np.float32(signs)
    windows = torch.from_numpy(positions).unfold(0, 34, 10).movedim(-1, 1)
    features = encoder.to_features(windows)
    return float((encoder.network(features) - features).abs().mean())


@pytest.mark.parametrize("corpus", PEOPLE)
def test_the_published_encoder_recognises_people(shared, encoder, corpus):
    error = reconstruction_error(encoder, upper_body_of(shared, corpus))
    assert 0.06 <= error <= 0.10


@pytest.mark.parametrize("corpus", ["zeggs", "beat", "trinity"])
@pytest.mark.parametrize("signs", [(-1, 1, 1), (1, -1, 1), (1, 1, -1)])
def test_a_flipped_axis_is_not_a_person(shared, encoder, corpus, signs):
    assert reconstruction_error(encoder, upper_body_of(shared, corpus), signs) >= 0.27


def test_exchanged_arms_are_not_a_person(shared, encoder):
    motion = upper_body_of(shared, "zeggs")
    motion.positions[:, 4:] = motion.positions[:, [7, 8, 9, 4, 5, 6]]
    assert reconstruction_error(encoder, motion) > 0.27
    assert "left and right" in doubts_about(motion)[0]


@pytest.mark.parametrize("corpus", PEOPLE)
def test_proportions_and_posture_are_human(shared, corpus):
    motion = upper_body_of(shared, corpus)
    assert doubts_about(motion) == []
    bones = np.linalg.norm(
        motion.positions[:, 1:] - motion.positions[:, list(UPPER_BODY.parents[1:])], axis=-1
    ).mean(axis=0)
    spine, neck, head, shoulder, upper_arm, forearm = bones[:6]
    # Human3.6M's spine joint is 0.21 to 0.30 m below the neck joint
    assert 0.21 < spine < 0.30
    assert 0.10 < neck < 0.25
    assert 0.12 < head < 0.25
    assert 0.12 < shoulder < 0.25
    assert 0.24 < upper_arm < 0.36
    assert 0.18 < forearm < 0.30
    np.testing.assert_allclose(bones[6:], bones[3:6], rtol=0.15)


def test_the_ten_joints_of_the_ten_joints_are_the_same_to_the_bit():
    """Even where rounding has left the spine beside the origin."""
    positions = np.random.default_rng(0).normal(0, 0.3, (5, 10, 3)).astype(np.float32)
    motion = Motion(UPPER_BODY, 15.0, positions)
    np.testing.assert_array_equal(to_upper_body(motion).positions, positions)
