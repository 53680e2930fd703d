"""Joint maps: which one is found, what it does by hand, and what is said when none fits."""

import json
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cospeech.errors import CospeechError, InputFileError
from cospeech.formats.ted import expressive
from cospeech.motion.bvh import read_bvh, read_bvh_skeleton
from cospeech.motion.gesture_joints import gesture_joints
from cospeech.motion.joint_map import (
    EVALUATION_JOINTS,
    JointBlend,
    JointMap,
    JointSource,
    bare_names,
    find_joint_map,
    load_joint_map,
)
from cospeech.motion.kinematics import skeleton_positions, turn_about_vertical
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import UPPER_BODY, doubts_about, to_upper_body
from cospeech.motion.velocities import wrists

PACKAGED = sorted(
    file.name.removesuffix(".yaml")
    for file in (files("cospeech.motion") / "joint_maps").iterdir()
    if file.name.endswith(".yaml")
)


def skeleton_for(joint_map, name="any"):
    joints = sorted(joint_map.required)
    return Skeleton(name, tuple(joints), (-1,) + (0,) * (len(joints) - 1))


def test_the_field_is_covered():
    assert set(PACKAGED) == {
        "bandai_namco", "beat", "berkeley3d", "classic", "classic_chests", "cmu", "cmu_cgspeed",
        "genea2023", "human36m", "human36m_32", "mixamo", "ted", "ted_expressive", "trinity",
        "zeggs",
    }  # fmt: skip


@pytest.mark.parametrize("name", PACKAGED)
def test_each_packaged_map_finds_its_own_skeleton(name):
    joint_map = load_joint_map(name)
    assert find_joint_map(skeleton_for(joint_map)).name == name
    assert len({source for source in joint_map.joints}) == 10


@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("zeggs/067_Speech_2_x_1_0.bvh", "zeggs"),
        ("beat/2_scott_0_1_1.bvh", "beat"),
        ("trinity/NaturalTalking_030_2_1From5.bvh", "trinity"),
        ("trinity/MODEL_OUTPUT_gesticulator_jeremy_howard.bvh", "trinity"),
        ("genea_twh_skeleton/genea_header.bvh", "genea2023"),
        ("cmu/18_01.bvh", "cmu"),
        ("bandai_namco/dataset-1_call_normal_001.bvh", "bandai_namco"),
        ("bandai_namco/dataset-2_wave-right-hand_normal_001.bvh", "bandai_namco"),
    ],
)
def test_real_skeletons_are_told_apart(shared, file, name):
    assert find_joint_map(read_bvh_skeleton(shared / "data" / "real" / file)).name == name


def test_rest_pose_of_talking_with_hands_faces_forward(shared):
    skeleton = read_bvh_skeleton(shared / "data/real/genea_twh_skeleton/genea_header.bvh")
    still = np.zeros((1, len(skeleton), 4), np.float32)
    still[..., 3] = 1
    motion = Motion(skeleton, 30.0, skeleton_positions(skeleton, still), still)
    body = to_upper_body(motion)
    assert doubts_about(body) == []
    at = dict(zip(EVALUATION_JOINTS, body.positions[0], strict=True))
    # the sums of the file's offsets from b_spine2, in metres
    np.testing.assert_allclose(at["neck"], [0, 0.311771, 0.0152592], atol=1e-6)
    np.testing.assert_allclose(at["left_shoulder"], [0.19166068, 0.20427280, 0.01717969], atol=1e-6)
    assert at["left_wrist"][0] > 0.5
    assert at["right_wrist"][0] < -0.5


def test_namespaces_do_not_matter():
    joint_map = load_joint_map("mixamo")
    plain = skeleton_for(joint_map)
    prefixed = Skeleton("m", tuple(f"mixamorig:{name}" for name in plain.joints), plain.parents)
    assert find_joint_map(prefixed).name == "mixamo"
    positions = np.random.default_rng(0).normal(size=(3, len(plain), 3)).astype(np.float32)
    still = np.tile(np.array([0, 0, 0, 1], np.float32), (3, len(plain), 1))
    np.testing.assert_array_equal(
        to_upper_body(Motion(prefixed, 30.0, positions, still)).positions,
        to_upper_body(Motion(plain, 30.0, positions, still)).positions,
    )


@pytest.mark.parametrize(
    "prefix", ["mixamorig:", "mixamorig1:", "mixamorig1_", "mixamorig", "Character1_", "Bip01 ",
               "Actor.", "rig|skeleton|", "GRP-2-"],
)  # fmt: skip
@pytest.mark.parametrize("root", ["", "Reference"])
def test_what_all_names_begin_with_does_not_matter(prefix, root):
    """Of all joints, or of all but a root of its own name; end sites may be called anything."""
    mixamo = load_joint_map("mixamo")
    names = [prefix + name for name in sorted(mixamo.required)]
    joints = ([root] if root else []) + names + ["End Site"]
    parents = (-1,) + (0,) * (len(joints) - 1)
    skeleton = Skeleton("m", tuple(joints), parents, end_sites=frozenset(["End Site"]))
    assert find_joint_map(skeleton).name == "mixamo"
    assert bare_names(skeleton)["LeftArm"] == joints.index(prefix + "LeftArm")
    assert bare_names(skeleton)[prefix + "LeftArm"] == joints.index(prefix + "LeftArm")


@pytest.mark.parametrize(
    "joints",
    [
        ("Root", "LHip", "LKnee", "LFoot"),
        ("Root", "Spine", "Spine1", "Spine2"),
        ("Root", "abc", "abd"),
        ("Root", "Arm"),
        ("Root",),
    ],
)
def test_real_names_are_not_eaten(joints):
    skeleton = Skeleton("s", joints, (-1,) + (0,) * (len(joints) - 1))
    assert bare_names(skeleton) == {joint: i for i, joint in enumerate(joints)}


def classic(chests, below_neck):
    """Hips, Chest ... Chest<n>, Neck, Head and arms by the names of early BVH files."""
    trunk = ["Hips", "Chest", *(f"Chest{i}" for i in range(2, chests + 1))]
    joints, parents, offsets = list(trunk), list(range(-1, chests)), [[0, 0.1, 0]] * len(trunk)
    joints += ["Neck", "Head", "Head_end"]
    parents += [chests, chests + 1, chests + 2]
    offsets = [*offsets, [0, below_neck, 0], [0, 0.1, 0.02], [0, 0.18, 0]]
    for side, sign in (("Left", 1), ("Right", -1)):
        above = [chests, len(joints), len(joints) + 1, len(joints) + 2]
        joints += [f"{side}{name}" for name in ("Collar", "Shoulder", "Elbow", "Wrist")]
        parents += above
        arm = [[0.03, 0.1, 0.02], [0.15, 0, 0], [0.28, 0, 0], [0.25, 0, 0]]
        offsets += [[sign * x, y, z] for x, y, z in arm]
        joints.append(f"{side}Hip")
        parents.append(0)
        offsets.append([sign * 0.09, -0.05, 0])
    ends = frozenset(["Head_end"])
    return Skeleton("bvh", tuple(joints), tuple(parents), np.array(offsets), ends)


@pytest.mark.parametrize(
    ("chests", "name", "spine"),
    [(1, "classic", "Chest"), (2, "classic_chests", "Chest2"), (4, "classic_chests", "Chest2")],
)
def test_the_classic_names(chests, name, spine):
    skeleton = classic(chests, 0.14)
    joint_map = find_joint_map(skeleton)
    assert joint_map.name == name
    assert joint_map.joints[0] == JointSource(spine)
    assert joint_map.unit_scale == 0.01
    still = np.zeros((1, len(skeleton), 4), np.float32)
    still[..., 3] = 1
    body = to_upper_body(Motion(skeleton, 15.0, skeleton_positions(skeleton, still), still))
    assert doubts_about(body) == []
    at = dict(zip(EVALUATION_JOINTS, body.positions[0], strict=True))
    above = max(0, chests - 2) * 0.1  # of Chest, or Chest2, to the last of them
    np.testing.assert_allclose(at["neck"], [0, 0.14 + above, 0], atol=1e-6)
    np.testing.assert_allclose(at["head"], [0, 0.14 + above + 0.28, 0.02], atol=1e-6)
    np.testing.assert_allclose(at["left_elbow"], [0.46, 0.1 + above, 0.02], atol=1e-6)


CGSPEED = {
    "Hips": ("", 0, 0, 0), "LHipJoint": ("Hips", 0, 0, 0), "RHipJoint": ("Hips", 0, 0, 0),
    "LeftUpLeg": ("LHipJoint", 1.8, -1.7, 0.8), "RightUpLeg": ("RHipJoint", -1.7, -1.7, 0.8),
    "LowerBack": ("Hips", 0, 0, 0), "Spine": ("LowerBack", 0, 2.0, -0.2),
    "Spine1": ("Spine", 0, 2.1, 0), "Neck": ("Spine1", 0, 0, 0), "Neck1": ("Neck", 0, 1.7, 0),
    "Head": ("Neck1", 0, 1.6, -0.3), "LeftShoulder": ("Spine1", 0, 0, 0),
    "LeftArm": ("LeftShoulder", 3.4, 1.2, 0), "LeftForeArm": ("LeftArm", 5.0, 0, 0),
    "LeftHand": ("LeftForeArm", 3.5, 0, 0), "RightShoulder": ("Spine1", 0, 0, 0),
    "RightArm": ("RightShoulder", -3.4, 1.2, 0), "RightForeArm": ("RightArm", -5.0, 0, 0),
    "RightHand": ("RightForeArm", -3.5, 0, 0),
}  # fmt: skip
"""Joints of CMU's motion in the cgspeed conversion, with lengths as they are in it (ASF units)."""


def test_the_cgspeed_conversion_of_cmu():
    names = list(CGSPEED)
    parents = tuple(names.index(parent) if parent else -1 for parent, *_ in CGSPEED.values())
    offsets = np.array([offset for _, *offset in CGSPEED.values()], float)
    joint_map = find_joint_map(Skeleton("bvh", tuple(names), parents))
    assert joint_map.name == "cmu_cgspeed"
    skeleton = Skeleton("bvh", tuple(names), parents, offsets * joint_map.unit_scale)
    still = np.zeros((1, len(names), 4), np.float32)
    still[..., 3] = 1
    body = to_upper_body(Motion(skeleton, 120.0, skeleton_positions(skeleton, still), still))
    assert doubts_about(body) == []
    at = dict(zip(EVALUATION_JOINTS, body.positions[0], strict=True))
    # 2.1 and 1.7 units of 1/0.45 inch
    np.testing.assert_allclose(at["neck"], [0, 3.8 * 0.0254 / 0.45, 0], atol=1e-4)
    arm = np.linalg.norm(at["left_elbow"] - at["left_shoulder"])
    assert arm == pytest.approx(5 * 0.0254 / 0.45, abs=1e-4)


def test_the_nearest_map_is_the_one_that_finds_most():
    skeleton = classic(1, 0.4)
    joints = tuple("Hand" if joint == "LeftWrist" else joint for joint in skeleton.joints)
    with pytest.raises(CospeechError) as caught:
        find_joint_map(Skeleton("mine", joints, skeleton.parents))
    assert "The nearest, classic, finds spine, neck, nose, head, left_shoulder" in str(caught.value)
    assert "it also needs: LeftWrist." in str(caught.value)
    with pytest.raises(CospeechError, match="None of the packaged maps finds"):
        find_joint_map(Skeleton("robot", ("base", "claw"), (-1, 0)))


def test_thousands_of_joints_are_not_all_listed():
    joints = tuple(f"{'j' * 190}{i}" for i in range(4000))
    with pytest.raises(CospeechError, match="and 3900 more") as caught:
        find_joint_map(Skeleton("many", joints, (-1,) + (0,) * 3999))
    assert len(str(caught.value)) < 10_000


@pytest.mark.parametrize("name", PACKAGED)
def test_a_map_survives_a_manifest(name):
    joint_map = load_joint_map(name)
    assert JointMap.from_dict(json.loads(json.dumps(joint_map.to_dict()))) == joint_map


@pytest.mark.parametrize(
    "values", [None, [], {}, {"name": 3}, {"name": "x"}, {"name": "x", "joints": 1}]
)
def test_a_damaged_map_of_a_manifest_is_an_error(values):
    with pytest.raises(InputFileError, match="joint map"):
        JointMap.from_dict(values)


def test_a_skeleton_carries_the_map_that_was_chosen():
    """Before any that fits by its names, through a manifest and into everything that asks."""
    plain = classic(4, 0.14)
    changed = replace(load_joint_map("classic_chests"), name="mine", hips=None)
    changed = replace(changed, joints=(JointSource("Chest3"), *changed.joints[1:]))
    skeleton = replace(plain, joint_map=changed)
    skeleton = Skeleton.from_dict(json.loads(json.dumps(skeleton.to_dict())))
    assert skeleton.joint_map == changed
    assert find_joint_map(skeleton) == changed
    assert wrists(skeleton).reference == "Chest3"
    assert wrists(skeleton).sideways is None
    assert (
        gesture_joints(skeleton).body.joints[gesture_joints(skeleton).evaluation_spine] == "Chest3"
    )
    without = {key: value for key, value in plain.to_dict().items() if key != "joint_map"}
    assert find_joint_map(Skeleton.from_dict(without)).name == "classic_chests"
    with pytest.raises(CospeechError, match="joint map mine needs Chest3"):
        find_joint_map(replace(classic(2, 0.2), joint_map=changed))


def person(yaw_degrees, travel=(0.0, 0.0, 0.0)):
    """A person with arms hanging, turned and moved, on Human3.6M's joint names."""
    names = ("Spine", "Thorax", "Nose", "Head", "LShoulder", "LElbow", "LWrist",
             "RShoulder", "RElbow", "RWrist", "LHip", "RHip")  # fmt: skip
    points = np.array(
        [[0, 1.2, 0], [0, 1.45, 0], [0, 1.6, 0.08], [0, 1.72, 0.02], [0.2, 1.4, 0],
         [0.22, 1.1, 0], [0.2, 0.9, 0.15], [-0.2, 1.4, 0], [-0.22, 1.1, 0], [-0.2, 0.9, 0.15],
         [0.1, 0.95, 0], [-0.1, 0.95, 0]]
    )  # fmt: skip
    yaw = np.radians(np.asarray(yaw_degrees, float))
    turned = turn_about_vertical(np.tile(points, (len(yaw), 1, 1)), yaw) + np.array(travel)
    skeleton = Skeleton("person", names, (-1,) + (0,) * 11)
    return Motion(skeleton, 15.0, turned.astype(np.float32)), points


def test_travel_and_heading_are_removed():
    motion, points = person([0, 40, 180, -100], travel=(2.0, 0.3, -1.0))
    body = to_upper_body(motion)
    assert body.skeleton is UPPER_BODY
    assert body.positions.dtype == np.float32
    assert body.rotations_local is None
    expected = points[:10] - points[0]
    np.testing.assert_allclose(body.positions, np.tile(expected, (4, 1, 1)), atol=1e-6)
    assert doubts_about(body) == []


def test_offsets_turn_with_their_joint():
    joint_map = JointMap(
        "test",
        tuple(
            JointSource("Head", (0.0, 0.02, 0.12)) if name == "nose" else JointSource("Hips")
            for name in EVALUATION_JOINTS
        ),
    )
    skeleton = Skeleton("s", ("Hips", "Head"), (-1, 0), np.array([[0, 0, 0], [0, 0.5, 0]]))
    # the body turned a quarter to its left (z -> x), then the head nodded by 30 degrees (z -> -y)
    quarter, nod = (
        Rotation.from_euler("y", 90, degrees=True),
        Rotation.from_euler("x", 30, degrees=True),
    )
    rotations = np.stack([quarter.as_quat(), nod.as_quat()])[None]
    motion = Motion(skeleton, 30.0, skeleton_positions(skeleton, rotations), rotations.astype("f4"))
    nose = to_upper_body(motion, joint_map).positions[0, 2]
    cosine, sine = np.cos(np.radians(30)), 0.5
    by_hand = [0.12 * cosine + 0.02 * sine, 0.5 + 0.02 * cosine - 0.12 * sine, 0.0]
    np.testing.assert_allclose(nose, by_hand, atol=1e-7)
    with pytest.raises(CospeechError, match="places nose by a joint's rotation"):
        to_upper_body(Motion(skeleton, 30.0, motion.positions), joint_map)


def test_a_joint_between_and_beyond_others(tmp_path):
    lines = [f"  {name}: neck" for name in EVALUATION_JOINTS if name not in ("nose", "head")]
    lines += ["  nose: {weights: {r_ear: 0.5, l_ear: 0.5}}"]
    lines += ["  head: {weights: {r_ear: 0.9, l_ear: 0.9, neck: -0.8}}"]
    path = tmp_path / "ears.yaml"
    path.write_text("joints:\n" + "\n".join(lines))
    joint_map = load_joint_map(path)
    assert joint_map.joints[2] == JointBlend((("r_ear", 0.5), ("l_ear", 0.5)))
    assert joint_map.required == {"neck", "r_ear", "l_ear"}
    skeleton = Skeleton("s", ("neck", "r_ear", "l_ear", "other"), (-1, 0, 0, 0))
    nan = [np.nan] * 3
    positions = np.array([[[5, 1, 0], [4.9, 1.1, 0.02], [5.1, 1.1, 0.02], nan]], np.float32)
    # only the joints named count, and where the body is doesn't
    body = to_upper_body(Motion(skeleton, 15.0, positions), joint_map).positions[0]
    np.testing.assert_allclose(body[2], [0, 0.1, 0.02], atol=1e-6)
    np.testing.assert_allclose(body[3], [0, 0.18, 0.036], atol=1e-6)
    with pytest.raises(CospeechError, match="joint map ears needs l_ear"):
        to_upper_body(
            Motion(Skeleton("s", ("neck", "r_ear"), (-1, 0)), 15.0, positions[:, :2]), joint_map
        )


# Mean directions of the TED set (docs/facts/trimodal.md, section 3.2) in house axes.
TED_NECK_TO_NOSE = np.array([0.002, 0.866, 0.434])
TED_NOSE_TO_HEAD = np.array([0.004, 0.876, -0.412])


def test_nose_and_head_of_expressive_clips_are_where_the_ted_set_has_them(shared):
    """Ten real clips, as directions; the face's bones get lengths that fit an adult's head.

    Eyes 63 mm and ears 145 mm apart, with the clips' own mean directions, give 61 mm from the nose
    to an eye and 112 mm from there to the ear.
    """
    lengths = {1: 0.26, 2: 0.22, 3: 0.22, 4: 0.36, 6: 0.33, 5: 0.36, 7: 0.33, 38: 0.18}
    lengths |= {39: 0.061, 40: 0.061, 41: 0.112, 42: 0.112}
    # the published order of directions: spine, shoulders, left arm and hand, right ones, face
    children = [1, 2, 3, 4, 6, *range(8, 23), 5, 7, *range(23, 38), *range(38, 43)]
    files = sorted((shared / "data/real/ted_culture").glob("*.npz"))
    assert len(files) == 10
    bodies = []
    for file in files:
        with np.load(file) as arrays:
            directions = arrays["human_dir_vec"].reshape(-1, 42, 3)
        poses = np.zeros((len(directions), 43, 3))
        for child, direction in zip(children, directions.swapaxes(0, 1), strict=True):
            parent = expressive.SKELETON.parents[child]
            poses[:, child] = poses[:, parent] + lengths.get(child, 0.04) * direction
        motion = Motion(expressive.SKELETON, 15.0, expressive.house_positions(poses))
        assert find_joint_map(motion.skeleton).name == "ted_expressive"
        body = to_upper_body(motion)
        assert doubts_about(body) == []
        bodies.append(body.positions)
    at = dict(zip(EVALUATION_JOINTS, np.concatenate(bodies).swapaxes(0, 1), strict=True))

    def degrees_between(bone, expected):
        mean = (bone / np.linalg.norm(bone, axis=1, keepdims=True)).mean(axis=0)
        cosine = mean @ expected / np.linalg.norm(mean) / np.linalg.norm(expected)
        return np.degrees(np.arccos(cosine))

    nose, head = at["nose"] - at["neck"], at["head"] - at["nose"]
    assert degrees_between(nose, TED_NECK_TO_NOSE) < 10
    assert degrees_between(head, TED_NOSE_TO_HEAD) < 10
    # the published lengths are 0.18 and 0.14
    assert 0.12 < np.linalg.norm(nose, axis=1).mean() < 0.20
    assert 0.10 < np.linalg.norm(head, axis=1).mean() < 0.18


def test_doubts_name_their_cause():
    motion, _ = person([0.0])
    body = to_upper_body(motion)

    def doubts(positions):
        return " ".join(doubts_about(Motion(UPPER_BODY, 15.0, positions.astype(np.float32))))

    assert doubts(body.positions) == ""
    assert "vertical may not be y (data.up_axis=z" in doubts(body.positions[..., [0, 2, 1]])
    assert "vertical may not be y" in doubts(body.positions * [1, -1, 1])
    assert "left and right" in doubts(body.positions * [-1, 1, 1])
    assert "nose is behind" in doubts(body.positions * [1, 1, -1])
    assert "0.00301 m long" in doubts(body.positions * 0.01)
    assert "set data.unit_scale" in doubts(body.positions * 0.01)


def test_an_unknown_skeleton_gets_its_joints_and_a_template():
    skeleton = Skeleton("robot", ("base", "Spine", "claw"), (-1, 0, 1))
    with pytest.raises(CospeechError) as caught:
        find_joint_map(skeleton)
    message = str(caught.value)
    assert "Its joints: base, Spine, claw" in message
    assert "also needs:" in message
    for name in EVALUATION_JOINTS:
        assert f"  {name}: " in message


def test_the_template_is_a_map(tmp_path):
    with pytest.raises(CospeechError) as caught:
        find_joint_map(Skeleton("robot", ("base",), (-1,)))
    assert caught.value.hint is not None
    template = caught.value.hint[caught.value.hint.index("joints:\n") :]
    path = tmp_path / "my_corpus.yaml"
    path.write_text(template)
    joint_map = load_joint_map(path)
    assert joint_map.name == "my_corpus"
    assert joint_map.joints[2] == JointSource("Head", (0.0, 0.02, 0.12))
    assert joint_map.hips == ("RightUpLeg", "LeftUpLeg")


ALIASES = "a0: &a0 [x]\n" + "".join(f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, 9))
GOOD = "joints:\n" + "".join(f"  {name}: j\n" for name in EVALUATION_JOINTS)


@pytest.mark.parametrize(
    ("content", "match"),
    [
        ("", "needs the key 'joints'"),
        ("[1, 2]", "needs the key 'joints'"),
        ("joints: {spine: a}", "exactly the ten evaluation joints"),
        (GOOD + "nose: x", "unknown keys: nose"),
        (GOOD.replace("nose: j", "nose: [1]"), "nose: expected a joint name"),
        (GOOD.replace("nose: j", "nose: {joint: j, offset: [0, 1]}"), "nose: expected"),
        (GOOD.replace("nose: j", "nose: {joint: j, offset: [0, 1, .nan]}"), "nose: expected"),
        (GOOD.replace("nose: j", "nose: {joint: j, ofset: [0, 1, 2]}"), "nose: expected"),
        (GOOD.replace("nose: j", "nose: {weights: {j: 0.5, k: 0.6}}"), "sum to 1"),
        (GOOD.replace("nose: j", "nose: {weights: {j: one}}"), "nose: expected"),
        (GOOD.replace("nose: j", "nose: {weights: {j: .nan}}"), "nose: expected"),
        (GOOD.replace("nose: j", "nose: {weights: {}}"), "nose: expected"),
        (GOOD.replace("nose: j", "nose: {weights: [j, k]}"), "nose: expected"),
        (GOOD.replace("nose: j", "nose: {weights: {j: 1}, joint: j}"), "nose: expected"),
        (GOOD + "hips: [a, b]", "'hips' must be"),
        (GOOD + "markers: Hips", "'markers' must be a list"),
        (GOOD + "unit_scale: -1", "'unit_scale' must be"),
        ("joints: {", "not valid yaml"),
        ("!!python/object/apply:os.system ['true']", "has a yaml tag"),
        (ALIASES, r"line 2: has yaml aliases"),
        (GOOD + "about: 2024-13-45", "2024-13-45 is a date"),
        (GOOD + f"unit_scale: {'9' * 400}", "number of more than 30 digits"),
        (GOOD.replace("nose: j", f"nose: {{joint: j, offset: [0, 1, {'9' * 400}]}}"), "30 digits"),
        (GOOD.replace("nose: j", "nose: {joint: j, offset: [0, 1, 1.0e+300]}"), "nose: expected"),
        (GOOD.replace("nose: j", "nose: {joint: j, offset: [0, 1, true]}"), "nose: expected"),
        (GOOD.replace("nose: j", "nose: {joint: [j], offset: [0, 1, 2]}"), "nose: expected"),
        (GOOD.replace("nose: j", "nose: {joint: {a: {b: c}}}"), "nose: expected"),
        (GOOD.replace("nose: j", "nose: {weights: {j: 1.0e+300, k: -1.0e+300}}"), "nose: expected"),
        (GOOD.replace("nose: j", "nose: {weights: {j: true}}"), "nose: expected"),
        (GOOD.replace("nose: j", "nose: true"), "nose: expected"),
        (GOOD.replace("nose: j", "nose: 1.5"), "nose: expected"),
        (GOOD + "hips: {right: [a], left: b}", "'hips' must be"),
        (GOOD + "hips: {right: {a: b}, left: b}", "'hips' must be"),
        (GOOD + "markers: [[a]]", "'markers' must be a list"),
        (GOOD + "markers: [null]", "'markers' must be a list"),
        (GOOD + "unit_scale: true", "'unit_scale' must be"),
        (GOOD + "unit_scale: .inf", "'unit_scale' must be"),
        (GOOD + "unit_scale: 1.0e-300", "'unit_scale' must be"),
        (GOOD + "1: 2\n? [a]\n: 3", "not valid yaml"),
        (GOOD + "1: 2\nnull: 4", "unknown keys: 1, None"),
        (GOOD + "".join(f"{'k' * 500}{i}: 1\n" for i in range(100)), r"unknown keys: .* \.\.\."),
        (GOOD + "  " + "x" * 1000 + ": j", "exactly the ten evaluation joints; see xxxx"),
        ("joints: " + "[" * 5000, "nested more than"),
        ("#" * 2**17, "too long"),
    ],
)
def test_broken_maps_are_refused(tmp_path, content, match):
    path = tmp_path / "broken.yaml"
    path.write_text(content)
    with pytest.raises(InputFileError, match=match) as caught:
        load_joint_map(path)
    assert len(str(caught.value)) < 2000


def test_names_that_do_not_exist(tmp_path):
    with pytest.raises(CospeechError, match=r"called 'trinty'; there are .*trinity"):
        load_joint_map("trinty")
    with pytest.raises(InputFileError, match="can't be read"):
        load_joint_map(tmp_path / "absent.yaml")
    (tmp_path / "folder.yaml").mkdir()
    with pytest.raises(InputFileError, match="is not a file"):
        load_joint_map(tmp_path / "folder.yaml")
    motion, _ = person([0.0])
    with pytest.raises(CospeechError, match="joint map ted needs head"):
        to_upper_body(motion, load_joint_map("ted"))


def test_hips_that_are_never_apart():
    motion, _ = person([0.0, 0.0])
    motion.positions[:, 10:] = 0
    with pytest.raises(CospeechError, match="heading is unknown"):
        to_upper_body(motion)


@pytest.mark.parametrize(
    "corpus", ["dataset-1_bow_normal_001", "dataset-2_wave-right-hand_normal_001"]
)
def test_a_head_with_other_axes_still_looks_forward(shared, corpus):
    body = to_upper_body(read_bvh(shared / f"data/real/bandai_namco/{corpus}.bvh"))
    assert doubts_about(body) == []
    face = body.positions[0, 2] - (body.positions[0, 1] + body.positions[0, 3]) / 2
    assert face[2] > 0.05
    assert abs(face[0]) < 0.04
