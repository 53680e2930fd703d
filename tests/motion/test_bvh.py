"""BVH reading and writing: spellings, errors, hostile files and round trips of real recordings."""

import gzip
import io
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cospeech.errors import CospeechError, InputFileError
from cospeech.motion import bvh as bvh_module
from cospeech.motion import bvh_rows
from cospeech.motion.bvh import read_bvh, read_bvh_skeleton, write_bvh
from cospeech.motion.bvh_hierarchy import MAX_DEPTH, MAX_JOINTS
from cospeech.motion.kinematics import skeleton_positions
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton

HEADER = """\
HIERARCHY
ROOT Hips
{
  OFFSET 1.0 90.0 0.0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Arm
  {
    OFFSET 10.0 0.0 0.0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 20.0 0.0 0.0
    }
  }
}
"""
ROWS = "0 100 0 0 0 0 0 0 0\n5 100 0 0 0 0 90 0 0\n0 100 0 0 0 90 0 0 0\n"
EXPECTED = np.array(
    [
        [[0, 1, 0], [0.1, 1, 0], [0.3, 1, 0]],
        [[0.05, 1, 0], [0.15, 1, 0], [0.15, 1.2, 0]],
        [[0, 1, 0], [0, 1, -0.1], [0, 1, -0.3]],
    ]
)
REAL = [
    "zeggs/067_Speech_2_x_1_0.bvh",
    "beat/2_scott_0_1_1.bvh",
    "trinity/NaturalTalking_030_2_1From5.bvh",
    "trinity/MODEL_OUTPUT_gesticulator_jeremy_howard.bvh",
    "cmu/18_01.bvh",
    "bandai_namco/dataset-1_bow_normal_001.bvh",
    "bandai_namco/dataset-1_byebye_happy_001.bvh",
    "bandai_namco/dataset-2_wave-right-hand_normal_001.bvh",
]


def text(header=HEADER, rows=ROWS, frames=3, time="0.0333333"):
    return f"{header}MOTION\nFrames: {frames}\nFrame Time: {time}\n{rows}"


def read(content, **options):
    return read_bvh(io.StringIO(content), **options)


def test_positions_and_rotations_by_hand():
    motion = read(text())
    assert motion.skeleton.joints == ("Hips", "Arm", "Arm_end")
    assert motion.skeleton.parents == (-1, 0, 1)
    assert motion.skeleton.end_sites == {"Arm_end"}
    assert motion.fps == 30.0
    assert motion.positions.dtype == np.float32
    np.testing.assert_allclose(motion.positions, EXPECTED, atol=1e-7)
    assert motion.skeleton.offsets is not None
    np.testing.assert_allclose(motion.skeleton.offsets[0], [0.01, 0.9, 0.0])
    half = np.sqrt(0.5)
    assert motion.rotations_local is not None
    np.testing.assert_allclose(motion.rotations_local[1, 1], [0, 0, half, half], atol=1e-7)


def test_inches_are_scaled():
    motion = read(text(), unit_scale=0.0254)
    np.testing.assert_allclose(motion.positions[0, 0], [0, 2.54, 0], atol=1e-6)


VARIANTS = {
    "crlf": text().replace("\n", "\r\n"),
    "cr": text().replace("\n", "\r"),
    "byte order mark": "\ufeff" + text(),
    "tabs": text().replace("  ", "\t").replace(" 0", "\t0"),
    "trailing blank lines": text() + "\n  \n\t\n\n",
    "blank lines between rows": text().replace("\n5", "\n\n5"),
    "no newline at the end": text().rstrip("\n"),
    "brace on the same line": re.sub(r"\n\s*\{", " {", text()),
    "closing braces on one line": re.sub(r"\}\s*\n\s*\}", "} }", text()),
    "lower-case end site": text().replace("End Site", "end site"),
    "named end site": text().replace("End Site", "End Site Arm_end"),
    "lower-case keywords": text().replace("JOINT", "Joint").replace("CHANNELS", "Channels"),
    "lower-case channels": text().replace("Xposition", "xposition"),
    "exponents": text().replace("5 100", "5.0e+0 1E2"),
    "spaces before the colon": text().replace("Frames:", "Frames :"),
    "channels before offset": text(
        HEADER.replace("    OFFSET 10.0 0.0 0.0\n", "").replace(
            "    End", "    OFFSET 10.0 0 0\n    End"
        )
    ),
    "six-channel joint": text(
        HEADER.replace("CHANNELS 3 Z", "CHANNELS 6 Xposition Yposition Zposition Z").replace(
            "OFFSET 10.0", "OFFSET 77.0"
        ),
        "0 100 0 0 0 0 10 0 0 0 0 0\n5 100 0 0 0 0 10 0 0 90 0 0\n0 100 0 0 0 90 10 0 0 0 0 0\n",
    ),
    "rotation before position": text(
        HEADER.replace(
            "Xposition Yposition Zposition Zrotation Xrotation Yrotation",
            "Zrotation Xrotation Yrotation Xposition Yposition Zposition",
        ),
        "0 0 0 0 100 0 0 0 0\n0 0 0 5 100 0 90 0 0\n0 0 90 0 100 0 0 0 0\n",
    ),
    "other rotation order": text(
        HEADER.replace("Zrotation Xrotation Yrotation", "Yrotation Xrotation Zrotation"),
        "0 100 0 0 0 0 0 0 0\n5 100 0 0 0 0 0 0 90\n0 100 0 90 0 0 0 0 0\n",
    ),
    "one-channel joint": text(
        HEADER.replace("3 Zrotation Xrotation Yrotation", "1 Zrotation"),
        "0 100 0 0 0 0 0\n5 100 0 0 0 0 90\n0 100 0 0 0 90 0\n",
    ),
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_spelling_gives_the_same_motion(variant, tmp_path):
    path = tmp_path / "take.bvh"
    path.write_bytes(VARIANTS[variant].encode())
    motion = read_bvh(path)
    assert motion.skeleton.joints == ("Hips", "Arm", "Arm_end")
    np.testing.assert_allclose(motion.positions, EXPECTED, atol=1e-7)


def test_a_rotation_with_two_orders_multiplies_in_channel_order():
    motion = read(text(rows="0 0 0 30 40 50 10 20 60\n", frames=1))
    root = Rotation.from_euler("ZXY", [30, 40, 50], degrees=True)
    arm = root * Rotation.from_euler("ZXY", [10, 20, 60], degrees=True)
    elbow = root.apply([0.1, 0, 0])
    np.testing.assert_allclose(motion.positions[0, 1], elbow, atol=1e-7)
    np.testing.assert_allclose(motion.positions[0, 2], elbow + arm.apply([0.2, 0, 0]), atol=1e-7)


def test_end_sites_of_one_parent_get_different_names():
    twice = HEADER.replace("    End Site", "    End Site\n{ OFFSET 1 2 3 }\n    End Site")
    assert read(text(twice)).skeleton.joints == ("Hips", "Arm", "Arm_end", "Arm_end2")


@pytest.mark.parametrize(
    ("time", "fps"),
    [
        ("0.033333", 30.0),
        ("0.0333", 30.0),
        ("0.0333333333333333", 30.0),
        ("3.33333e-2", 30.0),
        ("0.0083333", 120.0),
        ("0.008333", 120.0),
        ("0.016667", 60.0),
        ("0.05", 20.0),
        ("0.083333333", 12.0),
        ("0.03336667", 1 / 0.03336667),
        ("0.03", 1 / 0.03),
    ],
)
def test_rounded_frame_times_mean_whole_rates(time, fps):
    assert read(text(time=time)).fps == pytest.approx(fps, abs=1e-9)


# --- errors -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "match"),
    [
        ("", "starts with the word HIERARCHY"),
        ("Kaydara FBX Binary", "starts with the word HIERARCHY"),
        ("HIERARCHY\n", "no ROOT joint"),
        (HEADER.replace("ROOT Hips", "ROOT"), r"line 2: a joint without a name"),
        (HEADER.replace("Hips\n{", "Hips\n"), r"line 2: expected '\{' after Hips"),
        (HEADER.rstrip().rstrip("}"), "brace of joint Hips is never closed"),
        (HEADER + "}\n", "'}' is not expected"),
        (HEADER.replace("JOINT Arm", "JOINT Hips"), "line 6: a second joint called 'Hips'"),
        (HEADER + HEADER.removeprefix("HIERARCHY"), "line 17: a second ROOT"),
        (HEADER.replace("OFFSET 10.0", "OFFSET ten"), "line 8: OFFSET: 'ten' is not a number"),
        (HEADER.replace("OFFSET 10.0", "OFFSET nan"), "line 8: OFFSET: nan is not a usable"),
        (HEADER.replace("    OFFSET 10.0 0.0 0.0\n", ""), "line 6: joint Arm has no OFFSET"),
        (HEADER.replace("CHANNELS 3 Z", "CHANNELS 3 Q"), "line 9: unknown channel 'Qrotation'"),
        (HEADER.replace("CHANNELS 3", "CHANNELS 2"), "line 9: 'YROTATION' is not expected"),
        (HEADER.replace("CHANNELS 3", "CHANNELS 99"), "line 9: CHANNELS 99"),
        (
            HEADER.replace("Xrotation Yrotation\n    E", "Zrotation Yrotation\n    E"),
            "listed twice",
        ),
        (HEADER, "no MOTION line"),
        (HEADER + "MOTION\n", "line 17: the MOTION part is empty"),
        (HEADER + "MOTION\nFrame: 3\n", "there must be 'Frames: N'"),
        (text(rows=""), "no rows of numbers"),
        (text(time="abc"), "frame time 'abc'"),
        (text(time="0"), "frame time '0'"),
        (text(time="nan"), "frame time 'nan'"),
        (text(time="-0.03"), "frame time"),
        (text(frames="many"), "the header says many, but 3 rows follow"),
        (text(frames=2), "the header says 2 frames"),
        (text(frames=10**30), "but 3 rows follow"),
        (
            text(rows=ROWS.replace("5 100", "nan 100")),
            r"line 20, frame 1, joint Hips: 'nan' in col",
        ),
        (text(rows=ROWS.replace("0 90 0 0", "0 90 inf 0")), r"line 20, frame 1, joint Arm: 'inf'"),
        (
            text(rows=ROWS.replace("5 100", "5,100")),
            r"(?s)line 20, frame 1, joint Hips: '5,100'.*decimal commas",
        ),
        (text(rows=ROWS.replace("5 100", "5")), r"line 20, frame 1: 8 numbers .* 9 channels"),
        (text(rows="\n" + ROWS + "0 0 0"), r"line 23, frame 3: 3 numbers"),
        (text(rows="1 2 3\n" * 3), r"line 19, frame 0: 3 numbers"),
        # one short and one long row must not be read across the line end
        (text(rows="0 " * 8 + "\n" + "0 " * 10 + "\n"), "line 19, frame 0: 8 numbers"),
        (text(rows=ROWS.replace("5 100", "1e300 100")), "frame 1, joint Hips: .*too large"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(content, match):
    with pytest.raises(InputFileError, match=match):
        read(content)


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(InputFileError, match=r"nowhere\.bvh: can't be read"):
        read_bvh(tmp_path / "nowhere.bvh")
    with pytest.raises(InputFileError, match="can't be read"):
        read_bvh(tmp_path)


def test_a_wrong_frame_count_is_overruled_by_frame_rate():
    content = text(frames=24, time="0.0083333")
    with pytest.raises(InputFileError, match=r"24 frames at 120 fps .* 3 rows follow") as caught:
        read(content)
    assert "frame_rate=15" in str(caught.value)
    assert "data.frame_rate=15" in str(caught.value)
    motion = read(content, frame_rate=15)
    assert (motion.fps, len(motion)) == (15, 3)
    with pytest.raises(ValueError, match="positive"):
        read(content, frame_rate=0)


def test_published_beat_file_names_its_true_rate(shared):
    path = shared / "data/real/beat/2_scott_0_1_1.diffsheg_original.bvh.gz"
    with gzip.open(path, "rt") as stream, pytest.raises(InputFileError) as caught:
        read_bvh(stream)
    assert "7669 frames at 120 fps (63.9 s), but 957 rows follow" in str(caught.value)
    assert "data.frame_rate=15;" in str(caught.value)
    with gzip.open(path, "rt") as stream:
        motion = read_bvh(stream, frame_rate=15)
    derived = read_bvh(shared / "data/real/beat/2_scott_0_1_1.bvh")
    assert motion.duration == derived.duration == pytest.approx(63.8)
    np.testing.assert_array_equal(motion.positions[1:], derived.positions[1:])


def test_a_file_without_frames_is_a_skeleton(shared):
    path = shared / "data/real/genea_twh_skeleton/genea_header.bvh"
    skeleton = read_bvh_skeleton(path)
    assert len(skeleton) - len(skeleton.end_sites) == 83
    assert skeleton.joints[:3] == ("body_world", "b_root", "b_spine0")
    assert skeleton.offsets is not None
    np.testing.assert_allclose(skeleton.offsets[1], [0, 0.91593, 0])
    with pytest.raises(InputFileError, match="skeleton but no frames") as caught:
        read_bvh(path)
    assert "read_bvh_skeleton" in str(caught.value)
    assert read_bvh_skeleton(io.StringIO(HEADER)).joints == ("Hips", "Arm", "Arm_end")


# --- hostile files ----------------------------------------------------------------------------


def nested(depth):
    opened = "".join(f"JOINT j{i} {{ OFFSET 0 0 0\n" for i in range(depth))
    return f"HIERARCHY\nROOT r {{ OFFSET 0 0 0 CHANNELS 1 Xrotation\n{opened}" + "}" * (depth + 1)


def test_deep_nesting_and_many_joints_are_bounded():
    assert len(read(text(nested(MAX_DEPTH - 1) + "\n", "0\n", 1)).skeleton) == MAX_DEPTH
    with pytest.raises(InputFileError, match="not a person"):
        read(text(nested(100_000) + "\n", "0\n", 1))
    flat = "".join(f"JOINT j{i} {{ OFFSET 0 0 0 }}\n" for i in range(MAX_JOINTS))
    with pytest.raises(InputFileError, match="not a person"):
        read(f"HIERARCHY\nROOT r {{ OFFSET 0 0 0\n{flat}}}\n")


def test_size_is_checked_before_memory_is_taken(tmp_path, monkeypatch):
    path = tmp_path / "big.bvh"
    path.write_text(text())
    monkeypatch.setattr(bvh_rows, "MAX_FILE_BYTES", 100)
    with pytest.raises(InputFileError, match="more than a BVH file may have"):
        read_bvh(path)
    monkeypatch.setattr(bvh_rows, "MAX_FILE_BYTES", 2**30)
    monkeypatch.setattr(bvh_module, "MAX_JOINT_FRAMES", 8)
    with pytest.raises(InputFileError, match="3 frames of 3 joints are more than"):
        read_bvh(path)


def test_one_endless_line_is_an_error():
    with pytest.raises(InputFileError, match="line 19, frame 0: 300000 numbers"):
        read(text(rows="0 " * 300_000, frames=1))


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_damaged_files_give_motion_or_a_named_error(data):
    damaged = bytearray(text().encode())
    for _ in range(data.draw(st.integers(1, 6))):
        place = data.draw(st.integers(0, len(damaged) - 1))
        if data.draw(st.booleans()):
            damaged[place] = data.draw(st.integers(0, 255))
        else:
            del damaged[place : place + data.draw(st.integers(1, 40))]
    try:
        motion = read(bytes(damaged).decode("latin-1"))
    except InputFileError:
        return
    assert np.isfinite(motion.positions).all()


# --- writing ----------------------------------------------------------------------------------


@pytest.mark.parametrize("order", ["ZXY", "XYZ", "ZYX"])
@pytest.mark.parametrize("file", REAL)
def test_real_recordings_survive_writing(shared, tmp_path, file, order):
    motion = read_bvh(shared / "data" / "real" / file)
    again = read_bvh(write_bvh(tmp_path / "copy.bvh", motion, rotation_order=order))
    assert again.skeleton.joints == motion.skeleton.joints
    assert again.skeleton.parents == motion.skeleton.parents
    assert again.skeleton.end_sites == motion.skeleton.end_sites
    assert again.fps == motion.fps
    assert again.skeleton.offsets is not None
    assert motion.skeleton.offsets is not None
    np.testing.assert_allclose(again.skeleton.offsets, motion.skeleton.offsets, atol=1e-8)
    moved_mm = 1000 * np.linalg.norm(again.positions - motion.positions, axis=-1).max()
    assert moved_mm < 0.01
    assert again.rotations_local is not None
    assert motion.rotations_local is not None
    between = Rotation.from_quat(again.rotations_local.reshape(-1, 4)) * (
        Rotation.from_quat(motion.rotations_local.reshape(-1, 4)).inv()
    )
    assert np.degrees(between.magnitude()).max() < 1e-4


def test_only_joints_that_move_on_their_parent_get_position_channels(shared, tmp_path):
    motion = read_bvh(shared / "data/real/bandai_namco/dataset-1_bow_normal_001.bvh")
    written = write_bvh(tmp_path / "bow.bvh", motion).read_text()
    assert written.count("CHANNELS 6") == 2  # joint_Root and Hips; the file had 22
    assert written.count("CHANNELS 3") == 20


def test_joints_are_written_depth_first(tmp_path):
    skeleton = Skeleton(
        "broad",
        ("root", "left", "right", "left_tip", "right_tip"),
        (-1, 0, 0, 1, 2),
        np.array([[0, 0, 0], [0.1, 0, 0], [-0.1, 0, 0], [0.1, 0.2, 0], [-0.1, 0.3, 0.0]]),
    )
    rotations = Rotation.random(10, rng=np.random.default_rng(0)).as_quat().reshape(2, 5, 4)
    positions = skeleton_positions(skeleton, rotations, np.array([[0, 1.0, 0], [0, 1.1, 0]]))
    motion = Motion(skeleton, 15.0, positions, rotations.astype(np.float32))
    again = read_bvh(write_bvh(tmp_path / "a.bvh", motion))
    assert again.skeleton.joints == ("root", "left", "left_tip", "right", "right_tip")
    same = [again.skeleton.index[name] for name in skeleton.joints]
    np.testing.assert_allclose(again.positions[:, same], positions, atol=1e-6)


def test_what_cannot_be_written_leaves_the_old_file(tmp_path):
    path = tmp_path / "take.bvh"
    path.write_text("precious")
    motion = read(text())
    bare = Motion(motion.skeleton, 30.0, motion.positions)
    with pytest.raises(CospeechError, match="no joint rotations"):
        write_bvh(path, bare)
    broken = motion.positions.copy()
    broken[1, 1, 1] = np.nan
    with pytest.raises(CospeechError, match="empty or has NaN"):
        write_bvh(path, Motion(motion.skeleton, 30.0, broken, motion.rotations_local))
    assert motion.rotations_local is not None
    two = Skeleton("two", ("a", "b"), (-1, -1), np.zeros((2, 3)))
    with pytest.raises(CospeechError, match="one root"):
        write_bvh(path, Motion(two, 30.0, motion.positions[:, :2], motion.rotations_local[:, :2]))
    assert path.read_text() == "precious"
    assert list(tmp_path.iterdir()) == [path]
