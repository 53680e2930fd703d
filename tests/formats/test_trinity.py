"""Trinity Speech-Gesture: names, splits and their overlap, and raw takes brought into step."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from cospeech.errors import ConfigError, CospeechError, InputFileError
from cospeech.formats.mocap import Excerpt, read_take
from cospeech.formats.trinity import (
    TEST,
    TRAINING,
    challenge_split,
    find_trinity_takes,
    released_split,
)
from cospeech.formats.trinity_offsets import read_offsets
from tests.fabricated.mocap import (
    bursts,
    put_text,
    spoken,
    write_trinity_raw,
    write_trinity_release,
)

FACTS = Path(__file__).resolve().parents[2] / "docs" / "facts"


def all_names():
    return [f"NaturalTalking_{n}" for n in (*TRAINING.values(), *TEST.values())]


def test_the_renaming_table_is_one_to_one():
    assert len(TRAINING) == 23
    assert len(TEST) == 10
    assert len(set(all_names())) == 33


def test_the_renaming_table_is_the_one_of_the_facts():
    text = (FACTS / "trinity_and_gesticulator.md").read_text(encoding="utf-8")
    for title, table in (("train", TRAINING), ("test", TEST)):
        (row,) = re.findall(rf"^\| GENEA {title} → Trinity \| (.+) \|$", text, re.MULTILINE)
        pairs = (pair.split("→") for pair in row.split())
        assert table == {int(number): name for number, name in pairs}


def test_the_released_split_is_gesticulators():
    names = sorted(all_names())
    by_split = {
        s: [n[15:] for n in names if released_split(n) == s] for s in ("train", "val", "test")
    }
    assert by_split["val"] == ["001", "002"]
    assert by_split["test"] == ["004", "005"]
    # docs/facts/trinity_and_gesticulator.md, section 1: 19 takes are trained on
    assert [int(n) for n in by_split["train"]] == [7, 8, *range(10, 20), 21, 22, 23, 25, 26, 27, 30]
    assert all(released_split(n) is None for n in names if n.endswith("_2"))


def test_the_challenge_split_keeps_its_test_recordings_out():
    names = all_names()
    by_split = {s: [n for n in names if challenge_split(n) == s] for s in ("train", "val", "test")}
    assert {split: len(found) for split, found in by_split.items()} == {
        "train": 21,
        "val": 2,
        "test": 10,
    }
    assert challenge_split("NaturalTalking_021") == "test"
    assert challenge_split("NaturalTalking_021_2") == "train"
    assert challenge_split("NaturalTalking_099") is None


def test_the_release_is_read_under_its_trinity_names(tmp_path, caplog):
    write_trinity_release(tmp_path)
    takes = {take.id: take for take in find_trinity_takes(tmp_path)}
    splits = {name.removeprefix("NaturalTalking_"): take.split for name, take in takes.items()}
    assert splits == {
        "001": "val", "004": "test", "021": "train", "021_2": None, "027": "train", "027_2": None,
    }  # fmt: skip
    assert (
        "NaturalTalking_021, NaturalTalking_027: the released split trains on a test" in caplog.text
    )
    assert [n for n, take in takes.items() if take.warnings] == [
        "NaturalTalking_021",
        "NaturalTalking_027",
    ]
    recording = read_take(takes["NaturalTalking_004"])
    assert (recording.speaker, recording.split) == ("trinity_1", "test")
    assert recording.annotations == {
        "genea_2020": "Recording_020", "joint_map": "trinity", "word_timing": "words",
    }  # fmt: skip
    assert "research only" in recording.licence
    assert recording.motion.fps == 60.0
    assert [word.text for word in recording.speech.words] == [
        word.text for word in spoken("Recording_020", 4.0)
    ]
    overlapping = read_take(takes["NaturalTalking_027"])
    assert overlapping.annotations["genea_2020"] == "TestSeq010"
    assert "test recording of the GENEA Challenge 2020" in overlapping.annotations["warnings"][0]
    assert caplog.text.count("test recording of the GENEA Challenge 2020") == 1, "once for all"


def test_a_split_of_ones_own_has_no_published_split_and_no_warning(tmp_path, caplog):
    write_trinity_release(tmp_path)
    takes = find_trinity_takes(tmp_path, split_rule=None)
    assert len(takes) == 6
    assert {take.split for take in takes} == {None}
    assert not caplog.records


def test_the_challenge_rule_has_no_overlap_and_no_warning(tmp_path, caplog):
    write_trinity_release(tmp_path)
    takes = {take.id: take for take in find_trinity_takes(tmp_path, split_rule="challenge")}
    assert {name[15:]: take.split for name, take in takes.items()} == {
        "001": "val", "004": "train", "021": "test", "021_2": "train",
        "027": "test", "027_2": "train",
    }  # fmt: skip
    assert not caplog.records
    assert not any(take.warnings for take in takes.values())


def test_a_split_list_goes_before_the_rule_and_is_warned_of_by_itself(tmp_path, caplog):
    write_trinity_release(tmp_path)
    path = put_text(
        tmp_path / "mine.csv",
        "id,split\nNaturalTalking_021,train\nNaturalTalking_027,test\nNaturalTalking_001,val\n",
    )
    takes = {take.id[15:]: take for take in find_trinity_takes(tmp_path, split_list=path)}
    splits = {name: take.split for name, take in takes.items() if take.split}
    assert splits == {"001": "val", "021": "train", "027": "test"}
    assert [name for name, take in takes.items() if take.warnings] == ["021"]
    assert takes["021"].tables == (path,)
    assert "NaturalTalking_021: the split list mine.csv trains on a test recording" in caplog.text
    assert "released" not in caplog.text.split("data.split_rule")[0]
    caplog.clear()
    path.write_text("id,split\nNaturalTalking_001,train\nNaturalTalking_027,test\n")
    assert not any(take.warnings for take in find_trinity_takes(tmp_path, split_list=path))
    assert not caplog.records


@pytest.mark.parametrize("filled", [True, False])
def test_files_renamed_by_gesticulators_scripts_are_the_same(tmp_path, filled):
    """It calls second parts ``27_2``: the zeros in front fill up to three characters in all."""
    write_trinity_release(tmp_path / "a")
    for path in [*(tmp_path / "a").rglob("*.*")]:
        number = int(path.stem[-3:])
        table = TRAINING if path.stem.startswith("Recording") else TEST
        name = table[number] if filled else table[number].lstrip("0").zfill(3)
        target = tmp_path / "b" / path.parent.name / f"NaturalTalking_{name}{path.suffix}"
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target)
    original = find_trinity_takes(tmp_path / "a")
    renamed = find_trinity_takes(tmp_path / "b")
    for before, after in zip(original, renamed, strict=True):
        assert (before.id, before.split, before.speaker) == (after.id, after.split, after.speaker)


def test_the_release_goes_before_raw_takes_beside_it(tmp_path):
    write_trinity_release(tmp_path / "GENEA_Challenge_2020_data_release", (16,), ())
    write_trinity_raw(tmp_path, 4, 0.5, 0.5)
    (take,) = find_trinity_takes(tmp_path)
    assert take.id == "NaturalTalking_001"
    assert take.path.stem == "Recording_016"


def test_a_recording_outside_the_table_has_a_problem(tmp_path):
    write_trinity_release(tmp_path, (16, 24), ())
    problems = [take.problem for take in find_trinity_takes(tmp_path)]
    assert problems == [None, "Recording_024.bvh is not in the release's table of recordings"]


def test_raw_takes_without_a_table_are_refused(tmp_path):
    write_trinity_raw(tmp_path, 4, 0.5, 0.5)
    with pytest.raises(CospeechError, match=r"no offset table \(offsets\.csv or Align") as caught:
        find_trinity_takes(tmp_path)
    assert "data.layout=synchronised" in str(caught.value)
    (take,) = find_trinity_takes(tmp_path, layout="synchronised")
    assert (take.id, take.excerpt) == ("NaturalTalking_004", Excerpt())


@pytest.mark.parametrize("table", ["offsets.csv", "AlignmentTimes.csv"])
def test_a_planted_offset_is_removed_to_the_sample(tmp_path, table):
    # 90 rows of the motion at 120 fps and 19752 samples of the audio come before the shared part
    motion, audio = write_trinity_raw(tmp_path, 4, motion_lead=0.75, audio_lead=1.2345)
    text = {
        "offsets.csv": "NaturalTalking_004,0,-1,-22,-90,120,1.2345\n",
        "AlignmentTimes.csv": "Take,AudioStart,MotionStart\n4,1.2345,0.75\n",
    }
    put_text(tmp_path / table, text[table])
    (take,) = find_trinity_takes(tmp_path)
    assert take.tables == (tmp_path / table,)
    recording = read_take(take)
    assert (recording.id, recording.split, recording.motion.fps) == (
        "NaturalTalking_004",
        "test",
        120.0,
    )
    np.testing.assert_array_equal(recording.speech.waveform, audio)
    assert len(recording.motion) == len(motion)
    for joint in ("LeftHand", "RightHand"):
        np.testing.assert_allclose(
            recording.motion.positions[:, recording.motion.skeleton.index[joint]],
            motion.positions[:, motion.skeleton.index[joint]],
            atol=2e-5,
        )
    assert "warnings" not in recording.annotations


def test_a_take_in_two_pieces_becomes_two_recordings(tmp_path):
    write_trinity_raw(tmp_path, 27, motion_lead=0.5, audio_lead=0.25, seconds=8.0, fps=60.0)
    put_text(
        tmp_path / "offsets.csv",
        "NaturalTalking_027,0,90,-15,-30,60,0.25\nNaturalTalking_027,120,-1,-15,-30,60,0.25\n",
    )
    first, second = (read_take(take) for take in find_trinity_takes(tmp_path))
    assert [first.id, second.id] == ["NaturalTalking_027", "NaturalTalking_027_2"]
    assert [first.split, second.split] == ["train", None]
    assert [len(first.motion), len(second.motion)] == [180, 240]
    audio = bursts("NaturalTalking_027", 8.0)
    np.testing.assert_array_equal(first.speech.waveform, audio[:48_000])
    np.testing.assert_array_equal(second.speech.waveform, audio[64_000:])


def test_frame_rates_of_raw_takes_changed_after_take_21(tmp_path):
    write_trinity_raw(tmp_path, 21, 0, 0, fps=120.0)
    write_trinity_raw(tmp_path, 22, 0, 0, fps=120.0)
    put_text(tmp_path / "AlignmentTimes.csv", "Take,AudioStart,MotionStart\n21,0,0\n22,0,0\n")
    first, second = (read_take(take) for take in find_trinity_takes(tmp_path))
    # 21 is tested on by the challenge, which is its only warning
    assert all("fps" not in warning for warning in first.annotations["warnings"])
    assert first.motion.fps == second.motion.fps == 120.0
    assert second.annotations["warnings"] == [
        "NaturalTalking_022.bvh is at 120 fps, the corpus was published at 60: a derived copy?"
    ]


def test_part_two_is_another_speaker(tmp_path):
    root = tmp_path / "Trinity Speech-Gesture II"
    write_trinity_raw(root, 3, 0, 0)
    put_text(root / "AlignmentTimes.csv", "Take,AudioStart,MotionStart\n3.0,0,0\n")
    (take,) = find_trinity_takes(tmp_path)
    assert (take.id, take.speaker, take.published_rate) == ("Trinity2_003", "trinity_2", 120.0)
    assert take.split is None


def test_motion_cut_at_the_clap_is_refused(tmp_path):
    write_trinity_raw(tmp_path, 4, 0, 0)
    (tmp_path / "Motion").rename(tmp_path / "BVH_from_clap")
    put_text(tmp_path / "AlignmentTimes.csv", "Take,AudioStart,MotionStart\n4,1,2\n")
    with pytest.raises(CospeechError, match="holds motion cut at the clap"):
        find_trinity_takes(tmp_path)


def test_takes_that_the_table_lacks_have_a_problem(tmp_path):
    write_trinity_raw(tmp_path, 4, 0, 0)
    put_text(tmp_path / "offsets.csv", "NaturalTalking_005,0,-1,0,0,120,0\n")
    (take,) = find_trinity_takes(tmp_path)
    assert take.problem == "take 4 is not in the offset table offsets.csv"
    with pytest.raises(CospeechError, match="the challenge split is one of the GENEA 2020"):
        find_trinity_takes(tmp_path, split_rule="challenge")


def test_offsets_by_hand(tmp_path):
    """Rows as in the published table: at 30 fps and in rows of the BVH file."""
    path = put_text(
        tmp_path / "o.csv",
        "NaturalTalking_001,0,-1,-3537,-14149,120,118.52\n"
        "NaturalTalking_021,0,3300,-335,-1339,120,10.948\n"
        "NaturalTalking_021,3900,-1,-350,-1398,120,10.948\n",
    )
    excerpts = read_offsets(path).excerpts
    assert excerpts[1] == [Excerpt(14_149 / 120, 118.52, None)]
    first, second = excerpts[21]
    assert (first.motion_start, first.audio_start, first.duration) == (1339 / 120, 10.948, 110.0)
    # 3900 frames at 30 fps are 15600 rows and 130 s
    assert second.motion_start == (15_600 + 1398) / 120
    assert second.audio_start == pytest.approx(140.948)
    assert second.duration is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("NaturalTalking_001,0,-1,-3,nan,120,1\n", "line 1: 'nan' is not a number"),
        ("NaturalTalking_001,0,-1,-3,-12,0,1\n", "is not name, start, stop"),
        ("NaturalTalking_001,0,-1,-3\n", "4 values where column 5 is wanted"),
        ("NaturalTalking_001,0,-1,3,12,120,1\n", r"starts at -0\.1 s of the motion"),
        ("NaturalTalking_001,90,30,-3,-12,120,1\n", "lasts -2 s"),
        ("NaturalTalking_001,0,-1,-3,-1e99,120,1\n", "starts at"),
        ("intro,0,-1,-3,-12,120,1\n", "'intro' is no take"),
        ("Take,AudioStart,MotionStart\n1,-1,0\n", "line 2: -1 s is not a place in a take"),
        ("Take,AudioStart,MotionEnd\n1,1,0\n", "no column 'motionstart'"),
    ],
)
def test_broken_offsets_name_the_line(tmp_path, text, message):
    with pytest.raises(InputFileError, match=message):
        read_offsets(put_text(tmp_path / "o.csv", text))


def test_wrong_arguments_and_folders(tmp_path):
    with pytest.raises(ConfigError, match="choose released or challenge"):
        find_trinity_takes(tmp_path, split_rule="paper")
    with pytest.raises(ConfigError, match="choose auto, synchronised or raw"):
        find_trinity_takes(tmp_path, layout="new")
    put_text(tmp_path / "else.bvh", "")
    with pytest.raises(CospeechError, match="no Trinity recording below"):
        find_trinity_takes(tmp_path, layout="synchronised")


def test_the_real_excerpt_is_a_second_part(shared):
    root = shared / "data" / "real" / "trinity"
    with pytest.raises(CospeechError, match="no Trinity recording below"):
        # its name says that it is every fifth frame of a take: no published file
        find_trinity_takes(root, layout="synchronised", missing_audio="silence")
