import pytest

from cospeech.corpus.synthetic import SKELETON
from cospeech.errors import CospeechError
from cospeech.formats.berkeley.hands3d import BERKELEY_3D
from cospeech.motion.bvh import read_bvh_skeleton
from cospeech.motion.gesture_joints import gesture_joints
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import UPPER_BODY


def named(joints):
    return dict(zip(joints.roles, joints.body.joints, strict=True))


def test_the_papers_joint_sets_are_found_by_name():
    joints = gesture_joints(SKELETON)
    assert (len(joints.roles), len(joints.arms), len(joints.finger_tips)) == (21, 16, 10)
    found = named(joints)
    assert found["left_shoulder"] == "LeftArm"  # not the clavicle, which is called LeftShoulder
    assert found["right_elbow"] == "RightForeArm"
    assert found["left_thumb_tip"] == "LeftHandThumb3_end"
    assert found["right_pinky_tip"] == "RightHandPinky3_end"
    spine = [found[f"spine_{i}"] for i in range(4)] + [found["neck"]]
    assert spine == ["Spine", "Spine1", "Spine2", "Spine3", "Neck"]
    assert joints.body.reference == "Hips"
    assert joints.body.sideways == ("RightUpLeg", "LeftUpLeg")
    assert joints.roles[joints.evaluation_spine] == "spine_1"


def test_finger_tips_belong_to_the_wrist_of_their_side():
    joints = gesture_joints(SKELETON)
    for tip, wrist in joints.finger_tips:
        assert joints.roles[tip].split("_")[0] == joints.roles[wrist].split("_")[0]
        assert joints.roles[wrist].endswith("wrist")


def test_bones_make_one_tree():
    joints = gesture_joints(SKELETON)
    children = [child for _, child in joints.bones]
    assert len(joints.bones) == len(joints.roles) - 1
    assert sorted(children) == sorted(set(range(21)) - {joints.roles.index("spine_0")})
    by_name = {tuple(joints.roles[i] for i in bone) for bone in joints.bones}
    assert ("left_elbow", "left_wrist") in by_name
    assert ("neck", "right_shoulder") in by_name


def test_without_fingers_the_set_shrinks_and_says_so():
    joints = gesture_joints(UPPER_BODY)
    assert joints.roles == (
        *(f"left_{joint}" for joint in ("shoulder", "elbow", "wrist")),
        *(f"right_{joint}" for joint in ("shoulder", "elbow", "wrist")),
        "spine_0",
        "neck",
    )
    assert joints.finger_tips == ()
    assert joints.body.reference == "spine"


def test_hands_that_are_called_otherwise():
    found = named(gesture_joints(BERKELEY_3D))
    assert found["left_pinky_tip"] == "l_little3"
    assert found["right_index_tip"] == "r_index3"


@pytest.mark.parametrize(
    ("file", "joints", "arms"),
    [
        ("beat/2_scott_0_1_1.bvh", 21, 16),
        ("zeggs/067_Speech_2_x_1_0.bvh", 21, 16),
        ("trinity/NaturalTalking_030_2_1From5.bvh", 21, 16),
        ("genea_twh_skeleton/genea_header.bvh", 21, 16),
        ("cmu/18_01.bvh", 11, 6),
        ("bandai_namco/dataset-1_bow_normal_001.bvh", 9, 6),
    ],
)
def test_on_the_fields_skeletons(file, joints, arms, shared):
    found = gesture_joints(read_bvh_skeleton(shared / "data" / "real" / file))
    assert (len(found.roles), len(found.arms)) == (joints, arms)


def test_an_unknown_skeleton_is_refused():
    with pytest.raises(CospeechError, match="no joint map fits"):
        gesture_joints(Skeleton("rope", ("a", "b"), (-1, 0)))
