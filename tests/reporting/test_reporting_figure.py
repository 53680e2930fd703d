import numpy as np
import pytest

from cospeech.errors import CospeechError
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.reporting.figure import check_drawable, figure_of
from cospeech.reporting.framing import extents, facing
from cospeech.reporting.joint_names import side_of, wrists
from cospeech.reporting.projection import Camera, ground_path


@pytest.fixture
def still(rest):
    """Makes a clip in which nothing moves."""

    def make(frames=30, fps=15.0):
        return Motion(UPPER_BODY, fps, np.repeat(rest[None], frames, axis=0))

    return make


@pytest.mark.parametrize(
    ("joint", "side"),
    [
        ("left_wrist", "left"),
        ("LeftHandThumb1", "left"),
        ("l_elbow", "left"),
        ("LThumb", "left"),
        ("Hand_L", "left"),
        ("mixamorig:RightArm", "right"),
        ("rightforearm", "right"),
        ("Spine", None),
        ("LowerBack", None),
        ("RootLeaf", None),
    ],
)
def test_side_of_a_joint_in_any_spelling(joint, side):
    assert side_of(joint) == side


def test_upper_body_parts(still):
    figure = figure_of(still())
    names = (*UPPER_BODY.joints, "skull")
    parts = {(names[limb.upper], names[limb.lower]): limb.part for limb in figure.limbs}
    assert parts == {
        ("spine", "neck"): "body",
        ("neck", "skull"): "body",
        ("skull", "nose"): "body",
        ("neck", "left_shoulder"): "body",
        ("left_shoulder", "left_elbow"): "left_arm",
        ("left_elbow", "left_wrist"): "left_arm",
        ("neck", "right_shoulder"): "body",
        ("right_shoulder", "right_elbow"): "right_arm",
        ("right_elbow", "right_wrist"): "right_arm",
    }
    assert [(names[ball.point], ball.part) for ball in figure.balls] == [
        ("skull", "body"),
        ("left_wrist", "left_arm"),
        ("right_wrist", "right_arm"),
    ]


def test_skull_centre_lies_between_neck_and_crown(still, rest):
    points = figure_of(still()).points(rest)
    np.testing.assert_allclose(points[10], [0, 0.5 + 0.62 * 0.3, 0], atol=1e-6)


def test_mocap_skeleton_has_thin_fingers_and_a_body_coloured_collar_bone():
    joints = ("Hips", "Spine", "LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand")
    joints += ("LeftHandIndex1", "LeftHandIndex2", "LeftUpLeg", "LeftForeFoot")
    skeleton = Skeleton("mocap", joints, (-1, 0, 1, 2, 3, 4, 5, 6, 0, 8))
    positions = np.zeros((2, 10, 3), dtype=np.float32)
    positions[:, :, 0] = np.cumsum([0, 0.2, 0.2, 0.2, 0.3, 0.3, 0.1, 0.04, 0.5, 0.1])
    limbs = {joints[limb.lower]: limb for limb in figure_of(Motion(skeleton, 30, positions)).limbs}
    assert limbs["LeftArm"].part == "body"
    assert limbs["LeftForeArm"].part == limbs["LeftHandIndex2"].part == "left_arm"
    assert limbs["LeftForeFoot"].part == "legs"
    assert limbs["LeftHandIndex2"].radius < 0.5 * limbs["LeftForeArm"].radius


def test_real_mocap_wrists_and_no_bones_inside_the_skull(shared):
    from cospeech.motion.bvh import read_bvh

    motion = read_bvh(shared / "data/real/zeggs/067_Speech_2_x_1_0.bvh").slice(0, 60)
    names = motion.skeleton.joints
    assert {side: names[i] for side, i in wrists(motion.skeleton).items()} == {
        "left": "LeftHand",
        "right": "RightHand",
    }
    figure = figure_of(motion)
    assert figure.skull is not None
    assert names[figure.skull.below] == "Head"
    drawn = {names[limb.lower] for limb in figure.limbs}
    assert not any(name.startswith("HeadEnd") for name in drawn)
    assert {"LeftHandPinky3", "RightToeBase", "Neck1"} <= drawn
    # feet stand on the floor, give or take a shoe
    lowest = motion.positions[:, :, 1].min()
    assert -0.05 < extents({"a": motion})["a"].floor - lowest < 0.05


@pytest.mark.parametrize("angle", [0.0, 0.7, -2.5])
def test_facing_is_the_angle_the_body_was_turned_by(still, angle):
    turn = np.array(
        [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    )
    motion = Motion(UPPER_BODY, 15, (still().positions @ turn.T).astype(np.float32))
    assert facing(motion) == pytest.approx(angle, abs=1e-5)


def test_camera_puts_the_left_arm_on_the_viewers_right_and_keeps_everything_in_the_cell(still):
    motion = still()
    camera = Camera(motion, (640, 480), extents({"a": motion})["a"])
    seen = camera.project(motion.positions[0], 0)
    assert seen.pixels[6, 0] > seen.pixels[9, 0] + 50
    assert seen.pixels[3, 1] < seen.pixels[0, 1]
    assert (seen.pixels > 0).all()
    assert (seen.pixels < [640, 480]).all()
    # one metre across at distance d is focal / d pixels: by similar triangles
    focal = 240 / np.tan(np.radians(15))
    np.testing.assert_allclose(seen.scale, focal / seen.depth)


def test_camera_follows_travel_slowly(still):
    motion = still(frames=300)
    moved = motion.positions.copy()
    moved[150:, :, 0] += 3.0
    path = ground_path(Motion(UPPER_BODY, 15.0, moved))
    assert path[0, 0] == 0
    assert path[-1, 0] == pytest.approx(3.0)
    # at the jump, half of the four seconds around it have moved: 30 of 61 frames
    assert path[149, 0] == pytest.approx(3.0 * 30 / 61, abs=0.06)


def test_motion_that_is_not_finite_names_track_frame_and_joint(still):
    positions = still().positions.copy()
    positions[7, 6, 1] = np.nan
    with pytest.raises(CospeechError, match=r"'generated', frame 7, joint left_wrist"):
        check_drawable("generated", Motion(UPPER_BODY, 15, positions))
    with pytest.raises(CospeechError, match="no frames"):
        check_drawable("generated", still(frames=0))


def test_equal_poses_of_two_tracks_are_drawn_at_equal_heights(still):
    low = still()
    high = low.positions.copy()
    high[20:, 6, 1] = 1.5
    room = extents({"recorded": low, "generated": Motion(UPPER_BODY, 15, high)})
    assert room["recorded"] == room["generated"]
    assert room["recorded"].floor == pytest.approx(-0.1 - 0.06)
    assert room["recorded"].height == pytest.approx(1.5 + 0.16)
