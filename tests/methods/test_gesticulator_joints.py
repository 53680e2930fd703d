"""Which joints Gesticulator makes on skeletons that aren't Trinity's, by hand."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from cospeech.corpus.facts import placeholder_facts
from cospeech.errors import CospeechError
from cospeech.methods.gesticulator import Gesticulator
from cospeech.methods.gesticulator.joints import JOINTS, joints_of
from cospeech.motion.bvh import read_bvh_skeleton
from cospeech.motion.codecs import ExponentialMapCodec
from cospeech.motion.skeleton import Skeleton
from tests.fabricated.mocap import TRINITY_BODY, TWH_BODY, swinging


def without(skeleton, *joints):
    """The same skeleton with the children of some joints on what those hung on."""
    kept = [i for i, joint in enumerate(skeleton.joints) if joint not in joints]

    def above(joint):
        parent = skeleton.parents[joint]
        return parent if parent in kept or parent < 0 else above(parent)

    parents = tuple(-1 if above(i) < 0 else kept.index(above(i)) for i in kept)
    names = tuple(skeleton.joints[i] for i in kept)
    return Skeleton("less", names, parents, skeleton.offsets[kept], joint_map=skeleton.joint_map)


def with_one_above(skeleton, joint, name):
    """The same skeleton with one joint more, between a joint and its parent."""
    names, parents = [*skeleton.joints, name], [*skeleton.parents]
    parents.append(parents[skeleton.index[joint]])
    parents[skeleton.index[joint]] = len(skeleton)
    order = [*range(len(skeleton))]
    order.insert(skeleton.index[joint], len(skeleton))
    return Skeleton(
        "more",
        tuple(names[i] for i in order),
        tuple(-1 if parents[i] < 0 else order.index(parents[i]) for i in order),
        np.concatenate([skeleton.offsets, [[0.01, 0.02, 0.0]]])[order],
        joint_map=skeleton.joint_map,
    )


def test_trinitys_own_skeleton_has_all_of_them():
    assert joints_of(TRINITY_BODY) == JOINTS


def test_prefixed_names_are_the_same_and_what_is_missing_is_none():
    mixamo = without(TRINITY_BODY, "Spine3", "Neck1")
    mixamo = replace(mixamo, joints=tuple(f"mixamorig:{joint}" for joint in mixamo.joints))
    expected = [None if joint in ("Spine3", "Neck1") else joint for joint in JOINTS]
    assert list(joints_of(mixamo)) == expected


def test_other_names_are_found_by_the_joint_map():
    found = dict(zip(JOINTS, joints_of(TWH_BODY), strict=True))
    assert found == {
        "LeftHand": "b_l_wrist", "LeftForeArm": "b_l_forearm", "LeftArm": "b_l_arm",
        "LeftShoulder": "b_l_shoulder", "RightHand": "b_r_wrist", "RightForeArm": "b_r_forearm",
        "RightArm": "b_r_arm", "RightShoulder": "b_r_shoulder", "Head": "b_head",
        "Neck1": "b_neck1", "Neck": "b_neck0", "Spine3": "b_spine3", "Spine2": "b_spine2",
        "Spine1": "b_spine1", "Spine": "b_spine0",
    }  # fmt: skip


def test_of_several_joints_the_one_next_to_the_trunk_is_the_blade_and_to_the_neck_the_second():
    more = with_one_above(TWH_BODY, "b_head", "b_neck2")
    for side in "lr":
        for name in ("twist", "outer"):
            more = with_one_above(more, f"b_{side}_arm", f"b_{side}_{name}")
    found = dict(zip(JOINTS, joints_of(more), strict=True))
    assert (found["LeftShoulder"], found["LeftArm"]) == ("b_l_shoulder", "b_l_arm")
    assert (found["RightShoulder"], found["RightArm"]) == ("b_r_shoulder", "b_r_arm")
    assert (found["Neck"], found["Neck1"], found["Head"]) == ("b_neck0", "b_neck1", "b_head")


def test_a_name_that_means_another_joint_is_not_taken():
    """Early BVH files call the upper arm LeftShoulder, which is the shoulder blade in Trinity's."""
    names = {
        "Spine": "Chest", "Neck": "Neck", "Head": "Head", "Hips": "Hips",
        "LeftShoulder": "LeftCollar", "LeftArm": "LeftShoulder", "LeftForeArm": "LeftElbow",
        "LeftHand": "LeftWrist", "LeftUpLeg": "LeftHip", "LeftLeg": "LeftKnee",
    }  # fmt: skip
    names |= {a.replace("Left", "Right"): b.replace("Left", "Right") for a, b in names.items()}
    classic = without(TRINITY_BODY, "Spine1", "Spine2", "Spine3", "Neck1")
    classic = replace(classic, joints=tuple(names.get(joint, joint) for joint in classic.joints))
    found = dict(zip(JOINTS, joints_of(classic), strict=True))
    assert (found["LeftArm"], found["LeftShoulder"]) == ("LeftShoulder", "LeftCollar")
    assert (found["Spine"], found["Neck"], found["Head"]) == ("Chest", "Neck", "Head")
    bare = without(classic, "LeftCollar", "RightCollar")
    found = dict(zip(JOINTS, joints_of(bare), strict=True))
    assert (found["LeftArm"], found["LeftShoulder"]) == ("LeftShoulder", None)
    codec = ExponentialMapCodec(bare, joints_of(bare))
    rotations = torch.from_numpy(swinging(TRINITY_BODY, "a", 1.0, 20.0).rotations_local)
    features = codec.encode(rotations[:, : len(bare)])
    shoulders = features.unflatten(-1, (15, 3))[:, JOINTS.index("LeftShoulder")]
    assert not shoulders.any()
    assert len(codec.motion(features, 20.0)) == 20


def test_a_skeleton_of_which_nothing_is_known_is_refused_with_what_helps():
    unknown = replace(TRINITY_BODY, joints=tuple(f"j{i}" for i in range(len(TRINITY_BODY))))
    facts = {**placeholder_facts(), "skeleton": unknown.to_dict()}
    with pytest.raises(CospeechError, match=r"no joint map fits") as caught:
        Gesticulator(facts, text="none")
    assert "data.joint_map=my_corpus.yaml" in caught.value.hint


@pytest.mark.parametrize(
    ("file", "lacking"),
    [
        ("beat/2_scott_0_1_1.bvh", set()),
        ("zeggs/067_Speech_2_x_1_0.bvh", set()),
        ("trinity/NaturalTalking_030_2_1From5.bvh", set()),
        ("cmu/18_01.bvh", {"Neck1"}),
        ("genea_twh_skeleton/genea_header.bvh", {"Neck1"}),
        (
            "bandai_namco/dataset-1_bow_normal_001.bvh",
            {"Neck1", "Spine2", "Spine3"},
        ),
    ],
)
def test_which_joints_real_corpora_lack(shared, file, lacking):
    skeleton = read_bvh_skeleton(shared / "data" / "real" / file)
    found = dict(zip(JOINTS, joints_of(skeleton), strict=True))
    assert {joint for joint, own in found.items() if own is None} == lacking
    own = [joint for joint in found.values() if joint is not None]
    assert len(set(own)) == len(own), "two channels for one joint"
    ways = [skeleton.index[joint] for joint in own]
    assert all(skeleton.joints[way] not in skeleton.end_sites for way in ways)
