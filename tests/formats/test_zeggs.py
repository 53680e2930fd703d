"""ZeroEGGS: styles, the sequence list, and copies that are left out."""

import pytest

from cospeech.errors import CospeechError, InputFileError
from cospeech.formats.mocap import read_take, take_sources
from cospeech.formats.zeggs import find_zeggs_takes
from tests.fabricated.mocap import put_text, write_zeggs

NAMES = {"001_Neutral_0": False, "005_Neutral_4": True, "067_Speech_2": True}


def test_styles_and_split(tmp_path):
    write_zeggs(tmp_path, NAMES)
    recordings = [read_take(take) for take in find_zeggs_takes(tmp_path)]
    assert [(r.id, r.annotations["style"], r.split) for r in recordings] == [
        ("001_Neutral_0_x_1_0", "Neutral", "train"),
        ("005_Neutral_4_x_1_0", "Neutral", "val"),
        ("067_Speech_2_x_1_0", "Speech", "val"),
    ]
    assert {r.speaker for r in recordings} == {"zeggs"}
    assert {r.motion.fps for r in recordings} == {60.0}
    assert {r.motion.skeleton.name for r in recordings} == {"zeggs"}
    assert {r.speech.words for r in recordings} == {None}
    assert recordings[0].licence == "ZeroEGGS: CC BY-NC-ND 4.0"
    assert "warnings" not in recordings[0].annotations


def test_copies_and_raw_takes_are_left_out(tmp_path):
    copies = ("001_Neutral_0_mirror_x_1_0", "001_Neutral_0_x_0_9", "001_Neutral_0")
    write_zeggs(tmp_path, NAMES, copies=copies)
    sources = {source.id: source for source in take_sources(find_zeggs_takes(tmp_path))}
    assert len(sources) == 6
    reasons = {name: sources[name].read()[0] for name in copies}
    assert [reasons[name].kind for name in copies] == [
        "augmented copy", "augmented copy", "not synchronised",
    ]  # fmt: skip
    assert reasons[copies[1]].reason == (
        "001_Neutral_0_x_0_9.bvh is a copy of 001_Neutral_0, played at another speed (0_9)"
    )


def test_only_raw_takes_are_refused(tmp_path):
    write_zeggs(tmp_path, {}, copies=("001_Neutral_0",))
    with pytest.raises(CospeechError, match="no synchronised ZeroEGGS recording below") as caught:
        find_zeggs_takes(tmp_path)
    assert "clean" in str(caught.value)


def test_without_the_list_the_split_is_unknown(tmp_path, caplog):
    write_zeggs(tmp_path, NAMES)
    (tmp_path / "info.csv").unlink()
    assert {take.split for take in find_zeggs_takes(tmp_path)} == {None}
    assert "no info.csv" in caplog.text


def test_the_list_in_the_folder_above_is_pointed_at(tmp_path, caplog):
    write_zeggs(tmp_path, NAMES)
    find_zeggs_takes(tmp_path / "clean")
    assert f"it lies in the folder above: data.root={tmp_path}" in caplog.text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("anim_bvh,style\n001_Neutral_0.bvh,Neutral\n", "no column 'validation'"),
        ("anim_bvh,validation\n001_Neutral_0.bvh,maybe\n", "line 2: .* is not a sequence and TRUE"),
        ("anim_bvh,validation\n../x.bvh,TRUE\n", "line 2: .* is not a sequence and TRUE"),
        (
            "anim_bvh,validation\n001_Neutral_0.bvh,TRUE\n001_Neutral_0_mirror.bvh,FALSE\n",
            "line 3: 001_Neutral_0 is in both splits",
        ),
    ],
)
def test_broken_lists_name_the_line(tmp_path, text, message):
    write_zeggs(tmp_path, {"001_Neutral_0": False})
    put_text(tmp_path / "info.csv", text)
    with pytest.raises(InputFileError, match=message):
        find_zeggs_takes(tmp_path)


def test_the_real_copy_and_the_real_list(shared):
    (take,) = find_zeggs_takes(shared / "data" / "real" / "zeggs")
    recording = read_take(take)
    assert (recording.split, recording.annotations["style"]) == ("val", "Speech")
    assert (len(recording.motion), recording.motion.fps) == (2065, 30.0)
    assert "the corpus was published at 60" in recording.annotations["warnings"][0]
