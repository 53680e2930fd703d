"""BVH files as recorders, exporters and strangers write them: what is read, what is refused."""

import io
import tracemalloc
import warnings

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cospeech.errors import InputFileError
from cospeech.motion import bvh as bvh_module
from cospeech.motion import bvh_rows
from cospeech.motion.bvh import read_bvh, read_bvh_skeleton

HEADER = """\
HIERARCHY
ROOT Hips
{
  OFFSET 0 90 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Spine
  {
    OFFSET 0 40 2
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT Arm
    {
      OFFSET 25 10 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      End Site
      {
        OFFSET 20 0 0
      }
    }
  }
}
"""
COLUMNS = 12


def rows(count, seed=0):
    numbers = np.random.default_rng(seed).uniform(-60, 60, (count, COLUMNS))
    return "".join(" ".join(f"{x:.4f}" for x in row) + "\n" for row in numbers)


def text(header=HEADER, body=None, frames=315, time="0.0666667"):
    body = rows(315) if body is None else body
    return f"{header}MOTION\nFrames: {frames}\nFrame Time: {time}\n{body}"


def read(content, **options):
    """The motion and what was warned of."""
    told = []
    return read_bvh(io.StringIO(content), warn=told.append, **options), told


# --- headers ------------------------------------------------------------------------------------


def test_a_header_of_no_frames_says_what_follows():
    with pytest.raises(InputFileError) as caught:
        read(text(frames=0))
    message = str(caught.value)
    assert "the header says 0 frames at 15 fps" in message
    assert "315 rows follow" in message
    assert "'Frames: 315'" in message
    assert "data.frame_rate=15" in message
    assert read(text(frames=0), frame_rate=15)[0].duration == 21.0


@pytest.mark.parametrize("frames", ["00", "1", "2", "-1", "1e3", "99999999999", "9" * 5000, "²"])
@pytest.mark.parametrize("time", ["0.0666667", "59", "0.000011", "6.66667E-2"])
def test_no_number_of_the_header_divides_or_grows(frames, time):
    with pytest.raises(InputFileError, match="but 315 rows follow") as caught:
        read(text(frames=frames, time=time))
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize("time", ["1e-400", "1E+999999999", "0." + "0" * 5000 + "1", "sNaN", "inf"])
def test_odd_frame_times_are_named(time):
    with pytest.raises(InputFileError, match="is not a duration in seconds") as caught:
        read(text(time=time))
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize("said", [313, 314, 316, 317])
def test_a_frame_or_two_more_or_fewer_is_one_warning(said):
    motion, told = read(text(frames=said))
    assert (motion.fps, len(motion), motion.duration) == (15.0, 315, 21.0)
    assert told == [f"<text stream>: the header says {said} frames, 315 rows follow and are read"]
    np.testing.assert_array_equal(motion.positions, read(text())[0].positions)


def test_without_a_listener_the_warning_is_logged(caplog):
    read_bvh(io.StringIO(text(frames=314)))
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    assert "314 frames" in caplog.text


@pytest.mark.parametrize("said", [280, 311, 319, 630])
def test_a_header_far_off_is_refused(said):
    with pytest.raises(InputFileError, match=f"the header says {said} frames at 15 fps"):
        read(text(frames=said))


def test_a_long_take_may_miss_a_hundredth():
    still = "0 " * COLUMNS + "\n"
    motion, told = read(text(body=still * 1000, frames=1010))
    assert len(motion) == 1000
    assert len(told) == 1
    with pytest.raises(InputFileError, match="the header says 1011 frames"):
        read(text(body=still * 1000, frames=1011))


@pytest.mark.parametrize("last", ["1 2 3", "1.0 2.0 -", "7\n\n"])
@pytest.mark.parametrize("frames", [315, 316])
def test_a_last_row_that_was_cut_off_is_left_out(last, frames):
    motion, told = read(text(body=rows(315) + last, frames=frames))
    np.testing.assert_array_equal(motion.positions, read(text())[0].positions)
    (warning,) = told
    assert f"the last row is cut off ({len(last.split())} of 12 numbers) and left out" in warning


def test_a_row_that_is_no_row_is_not_cut_off():
    with pytest.raises(InputFileError, match=r"line 339, frame 315, joint Hips: 'the' in column 1"):
        read(text(body=rows(315) + "the end\n"))
    with pytest.raises(InputFileError, match=r"frame 100: 3 numbers"):
        read(text(body=rows(100) + "1 2 3\n" + rows(214)))


# --- numbers ------------------------------------------------------------------------------------


def with_number(number, column):
    lines = rows(20).splitlines()
    words = lines[7].split()
    words[column] = number
    lines[7] = " ".join(words)
    return text(body="\n".join(lines), frames=20)


@pytest.mark.parametrize("column", [0, 4, 11])
@pytest.mark.parametrize("number", ["1e308", "-1e308", "1e30", "1e-320", "1e9", "1e400", "-0"])
def test_odd_numbers_give_motion_or_an_error_and_no_other_warning(number, column):
    far = {"1e308", "-1e308", "1e30", "1e9"} if column == 0 else set()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        if number in {"1e400", *far}:
            with pytest.raises(InputFileError, match="frame 7, joint"):
                read(with_number(number, column))
            return
        motion, _ = read(with_number(number, column))
    assert np.isfinite(motion.positions).all()
    assert np.isfinite(motion.rotations_local).all()


@pytest.mark.parametrize("options", [{"unit_scale": 0.0}, {"up_axis": "x"}, {"frame_rate": -1.0}])
def test_settings_that_are_none_are_refused(options):
    with pytest.raises(ValueError, match=next(iter(options))):
        read(text(), **options)


# --- the hierarchy ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("header", "match"),
    [
        (HEADER.replace("CHANNELS 6", f"CHANNELS {'1' * 5000}"), "line 5: CHANNELS 1111"),
        (HEADER.replace("CHANNELS 6", "CHANNELS ٣"), "line 5: CHANNELS ٣: expected a count"),
        (HEADER.replace("CHANNELS 6", "CHANNELS 06"), "line 5: CHANNELS 06: expected a count"),
        (HEADER.replace("OFFSET 0 90", f"OFFSET {'9' * 5000} 90"), "is not a usable|OFFSET: 999"),
        (HEADER.replace("JOINT Arm", f"JOINT {'A' * 5000}"), "line 10: a name of more than 200"),
        (HEADER.replace("JOINT Arm", "B" * 5000), "line 10: 'BBBB"),
        (HEADER.replace("Xposition", "X" * 5000), "line 5: unknown channel"),
    ],
)
def test_what_is_wrong_is_told_in_a_line_however_long_it_is(header, match):
    with pytest.raises(InputFileError, match=match) as caught:
        read(text(header))
    assert len(str(caught.value)) < 500


def swollen(joints, count):
    flat = "".join(f"JOINT j{i} {{ OFFSET 0 0 0 }}\n" for i in range(joints - 1))
    header = f"HIERARCHY\nROOT r {{ OFFSET 0 0 0 CHANNELS 1 Xposition\n{flat}}}\n"
    return text(header, "0\n" * count, count)


def test_joints_that_nothing_moves_do_not_fill_the_memory():
    with pytest.raises(InputFileError, match="30000 frames of 1300 joints are more than fit"):
        read(swollen(1300, 30_000))
    with pytest.raises(InputFileError, match="more than its 20000 numbers can move"):
        read(swollen(1300, 20_000))
    # a few still joints, or a short take of many, are what exporters write
    assert len(read(swollen(1000, 50))[0].skeleton) == 1000


# --- memory -------------------------------------------------------------------------------------


def test_a_file_read_in_pieces_is_the_same_motion(tmp_path, monkeypatch):
    path = tmp_path / "take.bvh"
    for newline in ("\n", "\r\n", "\r"):
        path.write_bytes(text(body=rows(315) + "\n\n 1 2").replace("\n", newline).encode())
        whole = read_bvh(path)
        with monkeypatch.context() as patch:
            patch.setattr(bvh_rows, "HEAD_BYTES", len(HEADER) + 300)
            patch.setattr(bvh_rows, "BLOCK_BYTES", 100)
            patch.setattr(bvh_module, "POSED_AT_ONCE", 1)
            pieces = read_bvh(path)
            assert len(pieces) == 315
            np.testing.assert_allclose(pieces.positions, whole.positions, atol=1e-6)
            np.testing.assert_allclose(pieces.rotations_local, whole.rotations_local, atol=1e-6)


def test_the_line_of_an_error_is_known_in_every_piece(monkeypatch):
    content = text(body=rows(200) + "\n" + rows(1).replace("\n", " 5\n") + rows(113), frames=314)
    monkeypatch.setattr(bvh_rows, "HEAD_BYTES", len(HEADER) + 300)
    monkeypatch.setattr(bvh_rows, "BLOCK_BYTES", 100)
    with pytest.raises(InputFileError, match="line 225, frame 200: 13 numbers where"):
        read(content)


def test_an_endless_line_is_refused(monkeypatch):
    monkeypatch.setattr(bvh_rows, "HEAD_BYTES", 1000)
    monkeypatch.setattr(bvh_rows, "BLOCK_BYTES", 1000)
    monkeypatch.setattr(bvh_rows, "MAX_LINE_BYTES", 3000)
    with pytest.raises(InputFileError, match="a line of more than 3000 bytes"):
        read(text(body="0 " * 5000))


@pytest.mark.slow
def test_memory_follows_the_motion_and_not_what_it_is_made_through(tmp_path):
    path = tmp_path / "long.bvh"
    block = rows(1000)
    with path.open("w") as file:
        file.write(text(body="", frames=400_000))
        for _ in range(400):
            file.write(block)
    tracemalloc.start()
    motion = read_bvh(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    made = motion.positions.nbytes + motion.rotations_local.nbytes
    assert made == 28 * 4 * 400_000
    # the text is 38 MB and the kinematics of all frames would be 350 MB
    assert peak < made + 120e6


# --- the vertical -------------------------------------------------------------------------------


def z_up_by_its_root(motion_rows):
    """The same motion for a file whose z is up, its skeleton as it was."""
    lift = Rotation.from_euler("x", 90, degrees=True)
    numbers = np.loadtxt(io.StringIO(motion_rows))
    numbers[:, :3] = lift.apply(numbers[:, :3])
    turned = lift * Rotation.from_euler("ZXY", numbers[:, 3:6], degrees=True)
    numbers[:, 3:6] = turned.as_euler("ZXY", degrees=True)
    return "".join(" ".join(f"{x:.9f}" for x in row) + "\n" for row in numbers)


def z_up_by_its_skeleton(motion_rows):
    """The same motion with offsets, positions and rotation axes in z-up coordinates."""
    header = HEADER.replace("OFFSET 0 90 0", "OFFSET 0 0 90").replace(
        "OFFSET 0 40 2", "OFFSET 0 -2 40"
    )
    header = header.replace("OFFSET 25 10 0", "OFFSET 25 0 10")
    lift = Rotation.from_euler("x", 90, degrees=True)
    numbers = np.loadtxt(io.StringIO(motion_rows))
    numbers[:, :3] = lift.apply(numbers[:, :3])
    for first in (3, 6, 9):
        local = Rotation.from_euler("ZXY", numbers[:, first : first + 3], degrees=True)
        turned = lift * local * lift.inv()
        numbers[:, first : first + 3] = turned.as_euler("ZXY", degrees=True)
    return header, "".join(" ".join(f"{x:.9f}" for x in row) + "\n" for row in numbers)


def same_rotations(one, other):
    signs = np.sign((one * other).sum(axis=-1, keepdims=True))
    np.testing.assert_allclose(one, other * signs, atol=1e-5)


def test_a_file_with_z_up_is_turned_to_y_up():
    upright, _ = read(text(body=rows(20), frames=20))
    lying, _ = read(text(body=z_up_by_its_root(rows(20)), frames=20))
    np.testing.assert_allclose(lying.positions[..., 2], upright.positions[..., 1], atol=1e-5)
    turned, _ = read(text(body=z_up_by_its_root(rows(20)), frames=20), up_axis="z")
    np.testing.assert_allclose(turned.positions, upright.positions, atol=1e-5)
    same_rotations(turned.rotations_local, upright.rotations_local)


def test_joint_axes_are_turned_where_the_rest_pose_is_z_up():
    upright, _ = read(text(body=rows(20), frames=20))
    header, body = z_up_by_its_skeleton(rows(20))
    turned, _ = read(text(header, body, 20), up_axis="z")
    np.testing.assert_allclose(turned.positions, upright.positions, atol=1e-5)
    same_rotations(turned.rotations_local, upright.rotations_local)
    np.testing.assert_allclose(turned.skeleton.offsets, upright.skeleton.offsets, atol=1e-9)


def test_the_skeleton_of_a_file_is_read_without_its_rows(tmp_path):
    path = tmp_path / "take.bvh"
    path.write_text(text())
    assert read_bvh_skeleton(path).joints == ("Hips", "Spine", "Arm", "Arm_end")
