"""The UCI Gesture Phase set: fabricated files, and the real ones against their processed twins."""

import csv

import numpy as np
import pytest

from cospeech.errors import ConfigError, CospeechError, InputFileError
from cospeech.formats.uci_phases import (
    UCI_SKELETON,
    find_uci_sources,
    read_uci_recording,
    uci_splits,
)
from cospeech.formats.uci_table import FILE_JOINTS, read_uci_table
from cospeech.motion.phases import FIVE_CLASSES, PHASE_INDEX
from tests.fabricated.uci import STANDING, write_uci_video

VIDEOS = ["a1", "a2", "a3", "b1", "b3", "c1", "c3"]
JOINT = UCI_SKELETON.index


@pytest.fixture(scope="session")
def uci(shared):
    return shared / "data" / "real" / "uci_gesture_phase"


def recording(path, split=None):
    (found,) = read_uci_recording(str(path), split)
    return found


# Fabricated --------------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [5.0, 0.5])
def test_house_axes_and_metres_whatever_the_scale(tmp_path, scale):
    take = recording(write_uci_video(tmp_path, "a1", scale=scale), "val")
    assert (take.id, take.speaker, take.split) == ("a1", "a", "val")
    assert take.annotations["units_per_metre"] == scale
    assert take.motion.fps == 60
    assert len(take.speech.waveform) == 0
    assert take.speech.words is None
    mean = take.motion.positions.mean(axis=0)
    x, y, z = STANDING["spine"]
    np.testing.assert_allclose(mean[JOINT["spine"]], [-x, -y, -z], atol=1e-3)
    x, y, z = STANDING["head"]
    np.testing.assert_allclose(mean[JOINT["head"]], [-x, -y, -z], atol=1e-3)
    assert mean[JOINT["left_wrist"], 0] - mean[JOINT["right_wrist"], 0] == pytest.approx(
        0.4, abs=1e-3
    )
    hand = take.motion.positions[:, JOINT["left_hand"]]
    wrist = take.motion.positions[:, JOINT["left_wrist"]]
    np.testing.assert_allclose((hand - wrist).mean(axis=0), [0, 0, 0.07], atol=1e-3)


def test_time_runs_on_through_minutes_and_the_hour(tmp_path):
    table = read_uci_table(write_uci_video(tmp_path, "a1", rows=2500))
    steps = np.diff(table.times_s)
    assert table.times_s[0] == pytest.approx(59 * 60 + 50, abs=0.05)
    assert table.times_s[-1] > 3600 + 60
    assert set(steps.round(3)) == {0.031, 0.033, 0.047}


def test_frames_have_the_phase_and_the_height_of_their_own_time(tmp_path):
    take = recording(write_uci_video(tmp_path, "a1", rows=900))
    start = read_uci_table(tmp_path / "a1_raw.csv").times_s[0]
    times = start + np.arange(len(take.motion)) / 60
    wanted = (times * 2).astype(int) % 5
    labels = FIVE_CLASSES(take.phases)
    # A frame within a row of a boundary may have the label of the nearest row.
    inside = np.abs((times * 2 + 0.5) % 1 - 0.5) / 2 > 0.025
    assert inside.mean() > 0.85
    np.testing.assert_array_equal(labels[inside], wanted[inside])
    height = 0.3 * np.sin(np.pi * (times * 2 % 5) / 5) ** 2
    measured = take.motion.positions[:, JOINT["right_wrist"], 1] + STANDING["right"][1]
    assert np.abs(measured - height).max() < 0.01


def test_clipped_coordinates_are_interpolated_and_counted(tmp_path):
    path = write_uci_video(tmp_path, "b1", rows=200)
    lines = path.read_text(encoding="utf-8").splitlines()
    for row in range(50, 60):
        lines[row] = ",".join(["0", *lines[row].split(",")[1:]])
    path.write_text("\n".join(lines), encoding="utf-8")
    take = recording(path)
    assert take.annotations["clipped"] == {"left_hand x": 10}
    x = take.motion.positions[:, JOINT["left_hand"], 0]
    assert np.abs(x + STANDING["left"][0]).max() < 0.01  # a clipped 0 would read as 1 m


def test_rows_that_are_not_later_are_left_out(tmp_path, caplog):
    path = write_uci_video(tmp_path, "a1", rows=100)
    lines = path.read_text(encoding="utf-8").splitlines()
    before = read_uci_table(path)
    path.write_text("\n".join([*lines[:41], lines[40], lines[39], *lines[41:]]), encoding="utf-8")
    after = read_uci_table(path)
    np.testing.assert_array_equal(after.times_s, before.times_s)
    np.testing.assert_array_equal(after.values, before.values)
    assert "2 rows were not later" in caplog.text


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("lhx,", "x,", r"line 1: the header is not lhx,"),
        (",Rest", ",Resting still", r"line \d+: 'Resting still' is not a phase"),
        (",Rest", "", r"line \d+: 19 columns, expected 20"),
        ("59500", "59700", r"line 2: the timestamp 59700\d\d is not minute, second, ms"),
        ("1.7", "wide", r"line \d+: 'wide\d*' is not a number"),
        ("1.7", "inf", r"line \d+: 'inf\d*' is not a number"),
    ],
)
def test_what_is_not_a_raw_file(tmp_path, old, new, message):
    path = write_uci_video(tmp_path, "a1", rows=100)
    path.write_text(path.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    with pytest.raises(InputFileError, match=message):
        recording(path)


def test_a_body_of_no_known_scale(tmp_path):
    path = write_uci_video(tmp_path, "a1", rows=100, scale=50.0)
    with pytest.raises(
        InputFileError, match=r"scale .* can't be found: head to spine is .* m at 5"
    ):
        recording(path)


def test_finding_the_files(tmp_path):
    folder = tmp_path / "gesture_phase_dataset"
    folder.mkdir()
    for video in ("b3", "a1", "c1"):
        write_uci_video(folder, video, rows=30)
    (folder / "a1_va3.csv").write_text("1,2,Phase\n")
    sources = find_uci_sources(folder, "leave_user_out", "c")
    assert [source.id for source in sources] == ["a1", "b3", "c1"]
    (take,) = sources[2].read()
    assert (take.id, take.split) == ("c1", "test")
    with pytest.raises(CospeechError, match="nothing is not a folder"):
        find_uci_sources(tmp_path / "nothing", "leave_user_out", "c")
    (tmp_path / "nothing").mkdir()
    with pytest.raises(CospeechError, match="UCI Machine Learning Repository"):
        find_uci_sources(tmp_path / "nothing", "leave_user_out", "c")
    with pytest.raises(CospeechError, match="subfolder gesture_phase_dataset"):
        find_uci_sources(tmp_path, "leave_user_out", "c")


def splits(protocol, held_out):
    found = uci_splits(VIDEOS, protocol, held_out)
    return {split: [v for v in VIDEOS if found[v] == split] for split in ("train", "val", "test")}


def test_protocols():
    assert splits("leave_user_out", "c") == {
        "train": ["a1", "a2", "b1", "b3"], "val": ["a3"], "test": ["c1", "c3"],
    }  # fmt: skip
    assert splits("leave_user_out", "a") == {
        "train": ["b1", "c1", "c3"], "val": ["b3"], "test": ["a1", "a2", "a3"],
    }  # fmt: skip
    assert splits("leave_video_out", "a3") == {
        "train": ["a1", "b1", "b3", "c1", "c3"], "val": ["a2"], "test": ["a3"],
    }  # fmt: skip
    with pytest.raises(ConfigError, match=r"held_out=a3: .* a, b, c"):
        uci_splits(VIDEOS, "leave_user_out", "a3")
    with pytest.raises(ConfigError, match="leave_user_out or leave_video_out"):
        uci_splits(VIDEOS, "random", "a")
    with pytest.raises(ConfigError, match="only 1 video is left"):
        uci_splits(["a1", "b1", "b3"], "leave_user_out", "b")


# Real --------------------------------------------------------------------------------------------


def processed(path) -> tuple[np.ndarray, list[str]]:
    with path.open(encoding="utf-8-sig", newline="") as file:
        rows = list(csv.reader(file))[1:]
    return np.array([[float(x) for x in row[:32]] for row in rows]), [row[32] for row in rows]


@pytest.mark.parametrize("video", VIDEOS)
def test_the_processed_files_follow_from_the_raw_ones(uci, video):
    """docs/facts/uci_gesture_phases.md, section 3, traps 5 and 6: which also proves the decoding of
    times, joints and labels."""
    table = read_uci_table(uci / f"{video}_raw.csv")
    wanted, letters = processed(uci / f"{video}_va3.csv")
    index = {joint: i for i, joint in enumerate(FILE_JOINTS)}
    spine, head = table.values[:, index["spine"]], table.values[:, index["head"]]
    torso = np.linalg.norm(head - spine, axis=1)
    joints = [index[j] for j in ("left_hand", "right_hand", "left_wrist", "right_wrist")]
    q = (table.values[:, joints] - spine[:, None]) / torso[:, None, None]
    milliseconds = table.times_s * 1000
    three = (milliseconds[3:] - milliseconds[:-3])[:, None, None]
    one = (milliseconds[4:] - milliseconds[3:-1])[:, None, None]
    velocity = -10 * (q[3:] - q[:-3]) / three
    acceleration = 10 * (velocity[1:] - velocity[:-1]) / one
    velocity = velocity[1:]
    found = np.concatenate(
        [
            velocity.reshape(-1, 12),
            acceleration.reshape(-1, 12),
            np.linalg.norm(velocity, axis=2),
            np.linalg.norm(acceleration, axis=2),
        ],
        axis=1,
    )
    np.testing.assert_allclose(found, wanted, rtol=0, atol=5.001e-9)  # eight decimals, rounded
    names = {"D": "rest_hold", "P": "preparation", "S": "stroke", "H": "hold", "R": "retract"}
    assert [PHASE_INDEX[names[letter]] for letter in letters] == table.labels[4:].tolist()


@pytest.mark.parametrize(
    ("video", "rows", "seconds", "segments", "rows_of"),
    [
        # docs/facts/uci_gesture_phases.md, section 2: frames of rest, preparation, stroke, hold,
        # retraction
        ("a1", 1747, 65.5, 47, (698, 163, 656, 39, 191)),
        ("a2", 1264, 52.3, 49, (493, 200, 431, 54, 86)),
        ("a3", 1834, 62.4, 68, (662, 279, 535, 150, 208)),
        ("b1", 1073, 35.9, 58, (74, 412, 287, 217, 83)),
        ("b3", 1424, 47.7, 61, (194, 469, 390, 201, 170)),
        ("c1", 1111, 37.2, 51, (286, 236, 262, 193, 134)),
        ("c3", 1448, 48.8, 61, (362, 338, 389, 144, 215)),
    ],
)
def test_the_real_files_hold_what_was_measured(uci, video, rows, seconds, segments, rows_of):
    table = read_uci_table(uci / f"{video}_raw.csv")
    assert len(table.times_s) == rows
    assert table.times_s[-1] - table.times_s[0] == pytest.approx(seconds, abs=0.06)
    assert np.bincount(FIVE_CLASSES(table.labels), minlength=5).tolist() == list(rows_of)
    assert 1 + np.count_nonzero(np.diff(table.labels)) == segments


@pytest.mark.parametrize("video", VIDEOS)
def test_the_real_bodies_are_people_who_face_the_camera(uci, video):
    take = recording(uci / f"{video}_raw.csv")
    positions = {name: take.motion.positions[:, i] for name, i in JOINT.items()}
    torso = np.linalg.norm(positions["head"] - positions["spine"], axis=1)
    assert 0.44 < np.median(torso) < 0.58
    for side in ("left", "right"):
        hand = np.linalg.norm(positions[f"{side}_hand"] - positions[f"{side}_wrist"], axis=1)
        assert 0.05 < np.median(hand) < 0.10
        # The hands are in front of the body.
        assert np.median((positions[f"{side}_wrist"] - positions["spine"])[:, 2]) > 0.1
    assert np.median((positions["head"] - positions["spine"])[:, 1]) > 0.4
    assert np.median((positions["left_wrist"] - positions["right_wrist"])[:, 0]) > 0.05
    assert take.annotations["units_per_metre"] == (0.5 if video == "b3" else 5.0)
    assert take.annotations["clipped"] == ({"left_hand x": 18} if video == "b1" else {})
    assert np.ptp(positions["left_hand"][:, 0]) < 1.0
