"""Offsets from parents, by hand and against the bones of real joint sets."""

import pytest
import torch

from cospeech.errors import CospeechError
from cospeech.motion.codecs.parent_relative import ParentRelative, parents_of
from cospeech.motion.gesture_joints import FINGERS, gesture_joints
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import UPPER_BODY


def roles(spine=5, fingers=True):
    sides = [
        [f"{side}_{joint}" for joint in ("shoulder", "elbow", "wrist")]
        + [f"{side}_{finger}_tip" for finger in FINGERS if fingers]
        for side in ("left", "right")
    ]
    return (*sides[0], *sides[1], *(f"spine_{i}" for i in range(spine - 1)), "neck", "nose", "head")


def fingered():
    names = ["Hips", "Spine", "Spine1", "Spine2", "Neck", "Head"]
    parents = [-1, 0, 1, 2, 3, 4]
    for side in ("Left", "Right"):
        names += [f"{side}UpLeg", f"{side}Shoulder", f"{side}Arm", f"{side}ForeArm", f"{side}Hand"]
        at = len(names)
        parents += [0, 3, at - 4, at - 3, at - 2]
        for finger in ("Thumb", "Index", "Middle", "Ring", "Pinky"):
            parents += [at - 1, len(names)]
            names += [f"{side}Hand{finger}1", f"{side}Hand{finger}2"]
    return Skeleton("made", tuple(names), tuple(parents))


@pytest.mark.parametrize("skeleton", [UPPER_BODY, fingered()])
def test_the_tree_is_that_of_the_gesture_joints_and_the_head(skeleton):
    joints = gesture_joints(skeleton)
    all_roles = (*joints.roles, "nose", "head")
    parents = parents_of(all_roles)
    neck = all_roles.index("neck")
    bones = {*joints.bones, (neck, len(joints.roles)), (neck, len(joints.roles) + 1)}
    assert {(parent, i) for i, parent in enumerate(parents) if parent >= 0} == bones
    assert all_roles[parents.index(-1)] == "spine_0"


def test_offsets_by_hand():
    names = ("left_wrist", "left_elbow", "left_shoulder", "spine_0", "neck", "head")
    relative = ParentRelative(names)
    positions = torch.tensor(
        [[3.0, 1, 0], [3, 0, 0], [1, 0, 0], [0, -2, 0.5], [0, 0, 0], [0, 0.25, 0]]
    )
    offsets = relative.to_offsets(positions)
    expected = [[0, 1, 0], [2, 0, 0], [1, 0, 0], [0, -2, 0.5], [0, 2, -0.5], [0, 0.25, 0]]
    assert offsets.tolist() == expected
    assert relative.to_positions(offsets).tolist() == positions.tolist()


@pytest.mark.parametrize("spine", [1, 2, 3, 5])
@pytest.mark.parametrize("fingers", [True, False])
def test_round_trip(spine, fingers):
    names = roles(spine, fingers)
    relative = ParentRelative(names)
    positions = torch.randn(2, 7, len(names), 3, generator=torch.Generator().manual_seed(0))
    offsets = relative.to_offsets(positions)
    assert offsets.shape == positions.shape
    torch.testing.assert_close(relative.to_positions(offsets), positions, rtol=0, atol=1e-6)
    # Whatever the order of the roles, and for single poses too.
    shuffled = [names.index(name) for name in sorted(names)]
    other = ParentRelative(sorted(names))
    torch.testing.assert_close(other.to_offsets(positions[0, 0, shuffled]), offsets[0, 0, shuffled])
    torch.testing.assert_close(
        other.to_positions(offsets[0, 0, shuffled]), positions[0, 0, shuffled]
    )


def test_moving_the_root_moves_everything_and_one_offset_only():
    relative = ParentRelative(roles())
    positions = torch.randn(4, len(roles()), 3)
    moved = relative.to_offsets(positions + torch.tensor([0.5, 0, 0]))
    changed = (moved - relative.to_offsets(positions)).abs().amax(dim=(0, 2)) > 1e-5
    assert [name for name, is_it in zip(roles(), changed, strict=True) if is_it] == ["spine_0"]


def test_gradients_pass_along_the_bones():
    relative = ParentRelative(("left_shoulder", "left_elbow", "neck"))
    offsets = torch.zeros(3, 3, requires_grad=True)
    relative.to_positions(offsets)[1].sum().backward()
    assert offsets.grad.tolist() == [[1, 1, 1]] * 3


def test_strange_joints_are_named():
    with pytest.raises(CospeechError, match="'tail' has no place"):
        parents_of(("neck", "tail"))
    with pytest.raises(CospeechError, match="'left_elbow' has no parent 'left_shoulder' among"):
        parents_of(("neck", "left_elbow"))
    with pytest.raises(CospeechError, match="'head' has no parent 'neck'"):
        parents_of(("spine_0", "head"))
