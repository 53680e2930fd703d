"""Joint velocities as the body sees them, by hand."""

import numpy as np
import pytest
import torch

from cospeech.errors import CospeechError
from cospeech.formats.uci_phases import UCI_SKELETON
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.velocities import BodyJoints, body_positions, velocities, wrists

WRISTS = BodyJoints(("left_wrist", "right_wrist"), "spine")


def test_velocities_by_hand():
    positions = torch.tensor([[[0.0, 0, 0]], [[0.3, 0.0, 0.4]], [[0.3, 0.1, 0.4]]])
    expected = [[6.0, 0, 8, 10], [0, 2, 0, 2]]
    torch.testing.assert_close(
        velocities(positions, 20.0, speeds=True), torch.tensor(expected), atol=1e-4, rtol=0
    )
    torch.testing.assert_close(
        velocities(positions, 20.0, speeds=False), torch.tensor(expected)[:, :3]
    )


def test_velocities_have_a_slope_where_a_joint_stands_still():
    positions = torch.zeros(3, 2, 3, requires_grad=True)
    velocities(positions, 20.0, speeds=True).sum().backward()
    assert torch.isfinite(positions.grad).all()


def test_the_body_frame_turns_with_the_hips():
    """A body that turns on its heel: what moves with it stands still, what leads it is forward."""
    skeleton = Skeleton("b", ("spine", "hip_r", "hip_l", "hand"), (-1, 0, 0, 0))
    angles = np.linspace(0, 3, 40)
    forward = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], axis=1)
    left = np.stack([np.cos(angles), 0 * angles, -np.sin(angles)], axis=1)
    travel = np.linspace(0, 2, 40)[:, None] * [1.0, 0.2, 0.5]
    reach = np.linspace(0.2, 0.6, 40)[:, None]
    positions = np.stack(
        [travel, travel - 0.1 * left, travel + 0.1 * left, travel + reach * forward], axis=1
    )
    motion = Motion(skeleton, 20.0, positions.astype(np.float32))
    joints = BodyJoints(("hip_l", "hand"), "spine", ("hip_r", "hip_l"))
    seen = body_positions(motion, joints)
    np.testing.assert_allclose(seen[:, 0], [[0.1, 0, 0]] * 40, atol=1e-6)
    np.testing.assert_allclose(seen[:, 1], reach * [0, 0, 1], atol=1e-6)
    with pytest.raises(CospeechError, match=r"no tail; it has spine, hip_r"):
        body_positions(motion, BodyJoints(("tail",), "spine"))


def test_wrists_of_a_skeleton_with_a_joint_map():
    names = "Hips Spine Spine1 Spine2 Spine3 Neck Neck1 Head LeftShoulder LeftArm LeftForeArm"
    names += " LeftHand RightShoulder RightArm RightForeArm RightHand LeftUpLeg RightUpLeg"
    skeleton = Skeleton("trinity", tuple(names.split()), (-1,) + (0,) * 17)
    found = wrists(skeleton)
    assert found.joints == ("LeftHand", "RightHand")
    assert found.sideways == ("RightUpLeg", "LeftUpLeg")
    assert wrists(UCI_SKELETON) == WRISTS
