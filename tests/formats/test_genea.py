"""GENEA 2022 and 2023: names, speakers, splits, the other side of a dialogue, hostile metadata."""

import re

import numpy as np
import pytest

from cospeech.errors import CospeechError, InputFileError
from cospeech.formats.genea import find_genea_takes
from cospeech.formats.mocap import read_take, take_sources
from tests.fabricated.mocap import (
    TWH_BODY,
    bursts,
    put_bvh,
    put_text,
    put_wav,
    spoken,
    swinging,
    write_genea_2022,
    write_genea_2023,
)


def test_2022(tmp_path):
    write_genea_2022(
        tmp_path,
        {"trn_2022_v1_000": 3, "trn_2022_v1_001": 12, "val_2022_v1_000": 3, "tst_2022_v1_000": 4},
    )
    takes = find_genea_takes(tmp_path)
    assert [(take.id, take.speaker, take.split) for take in takes] == [
        ("trn_2022_v1_000", "twh_03", "train"),
        ("trn_2022_v1_001", "twh_12", "train"),
        ("tst_2022_v1_000", "twh_04", "test"),
        ("val_2022_v1_000", "twh_03", "val"),
    ]
    assert [take.annotations["fingers"] for take in takes] == [True, False, False, True]
    recording = read_take(takes[0])
    assert recording.interlocutor is None
    assert (recording.motion.fps, recording.motion.skeleton.name) == (30.0, "genea2023")
    assert [w.text for w in recording.speech.words] == [
        w.text for w in spoken("trn_2022_v1_000", 4.0)
    ]
    # 44.1 kHz comes in, and the arm is 0.53 m from shoulder to wrist in metres
    assert len(recording.speech.waveform) == 64_000
    joints = recording.motion.skeleton.index
    arm = recording.motion.positions[
        0, [joints["b_l_arm"], joints["b_l_forearm"], joints["b_l_wrist"]]
    ]
    lengths = np.linalg.norm(np.diff(arm, axis=0), axis=1)
    np.testing.assert_allclose(lengths, [0.28, 0.25], atol=1e-5)
    assert "warnings" not in recording.annotations
    assert "CC BY-NC" in recording.licence


def with_position_channels_everywhere(text):
    """The published files' channels: all six on every joint, positions repeating the offset."""
    head, rows = text.split("MOTION")
    offsets = re.findall(r"OFFSET (.+)\n\s*CHANNELS", head)
    positions = "Xposition Yposition Zposition"
    turns = re.search(r"CHANNELS 3 (.+)", head)[1]
    head = re.sub(r"CHANNELS .+", f"CHANNELS 6 {positions} {turns}", head)
    first, second, third, *frames = rows.splitlines()
    full = []
    for numbers in map(str.split, frames):
        row = numbers[:6]
        for joint, offset in enumerate(offsets[1:]):
            row += [*offset.split(), *numbers[6 + 3 * joint : 9 + 3 * joint]]
        full.append(" ".join(row))
    return head + "MOTION" + "\n".join([first, second, third, *full]) + "\n"


def test_position_channels_replace_the_offset(tmp_path):
    """docs/facts/genea.md, section 1: the challenge's converter added them, so that every bone came
    out doubled."""
    write_genea_2022(tmp_path, {"trn_2022_v1_000": 3})
    before = read_take(find_genea_takes(tmp_path)[0]).motion
    (path,) = tmp_path.rglob("*.bvh")
    text = with_position_channels_everywhere(path.read_text())
    assert text.count("CHANNELS 6") == len(before.skeleton) - len(before.skeleton.end_sites) > 10
    path.write_text(text)
    after = read_take(find_genea_takes(tmp_path)[0]).motion
    np.testing.assert_allclose(after.positions, before.positions, atol=1e-5)


def test_2023_keeps_the_interlocutor(tmp_path):
    write_genea_2023(
        tmp_path, {"trn_2023_v0_000": (3, 5), "val_2023_v0_000": (5, 3), "tst_2023_v0_000": (4, 5)}
    )
    takes = {take.id: take for take in find_genea_takes(tmp_path)}
    assert sorted(takes) == ["trn_2023_v0_000", "tst_2023_v0_000", "val_2023_v0_000"]
    recording = read_take(takes["trn_2023_v0_000"])
    assert (recording.speaker, recording.split) == ("twh_03", "train")
    assert recording.annotations["interlocutor_speaker"] == "twh_05"
    assert recording.source.startswith("trn_2023_v0_000_main-agent.bvh + ")
    said = [w.text for w in spoken("trn_2023_v0_000_interloctr", 4.0)]
    heard = [w.text for w in spoken("trn_2023_v0_000_main-agent", 4.0)]
    assert said != heard
    assert [w.text for w in recording.interlocutor.words] == said
    assert [w.text for w in recording.speech.words] == heard
    assert len(recording.interlocutor.waveform) == len(recording.speech.waveform)
    loud = bursts("trn_2023_v0_000_interloctr", 4.0, 44_100).std()
    assert recording.interlocutor.waveform.std() == pytest.approx(loud, rel=0.5)
    # what the finder says of the files is what a store's fingerprint is made of
    names = [path.name for path in takes["trn_2023_v0_000"].files]
    assert names[3:] == [
        "trn_2023_v0_000_interloctr.wav", "trn_2023_v0_000_interloctr.tsv", "metadata.csv",
    ]  # fmt: skip


def test_test_motion_that_was_kept_back_is_left_out(tmp_path):
    write_genea_2023(tmp_path, {"trn_2023_v0_000": (3, 5), "tst_2023_v0_000": (4, 5)})
    sources = {source.id: source for source in take_sources(find_genea_takes(tmp_path))}
    (dropped,) = sources["tst_2023_v0_000"].read()
    assert dropped.kind == "no motion in the release"
    assert "kept the motion of its test recordings back" in dropped.reason
    again = tmp_path / "again"
    write_genea_2023(again, {"tst_2023_v0_000": (4, 5)}, held_back=False)
    (take,) = find_genea_takes(again)
    assert read_take(take).split == "test"


def test_an_empty_transcript_is_one_who_does_not_speak(tmp_path):
    root = write_genea_2023(tmp_path, {"trn_2023_v0_139": (3, 5)})
    (path,) = root.rglob("*main-agent.tsv")
    path.write_text("")
    (take,) = find_genea_takes(root)
    assert read_take(take).speech.words == ()


def test_zip_files_unpacked_side_by_side(tmp_path):
    write_genea_2023(tmp_path / "genea2023_trn", {"trn_2023_v0_000": (3, 5)})
    write_genea_2023(tmp_path / "genea2023_val", {"val_2023_v0_000": (5, 3)})
    assert [take.split for take in find_genea_takes(tmp_path)] == ["train", "val"]


def test_without_metadata_the_speaker_is_unknown(tmp_path, caplog):
    write_genea_2022(tmp_path, {"trn_2022_v1_000": 3})
    (tmp_path / "trn" / "trn_metadata.csv").unlink()
    (take,) = find_genea_takes(tmp_path)
    assert (take.speaker, dict(take.annotations)) == ("unknown", {})
    assert "1 of 1 recordings have no line in a metadata.csv" in caplog.text


def test_a_header_may_name_the_columns_of_2022(tmp_path):
    write_genea_2022(tmp_path, {"trn_2022_v1_000": 3})
    put_text(
        tmp_path / "trn" / "trn_metadata.csv",
        "userid,fname,fingers\n7,trn_2022_v1_000,finger_excl\n",
    )
    (take,) = find_genea_takes(tmp_path)
    assert (take.speaker, take.annotations["fingers"]) == ("twh_07", False)


HEADER = "prefix,main-agent_id,main-agent_has_fingers,interloctr_id,interloctr_has_fingers\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        (HEADER + "trn_2023_v0_000,one,fingers_incl,2,fingers_incl\n", "line 2: 'one' is not a sp"),
        (HEADER + "trn_2023_v0_000,1\n", "line 2: 2 values where column 3"),
        (HEADER + f"trn_2023_v0_000,{'9' * 5000},fingers_incl,2,x\n", "is not a speaker's number"),
        (HEADER + "../../etc/passwd,1,fingers_incl,2,x\n", "'../../etc/passwd' is no recording"),
        (HEADER.replace("main-agent_id", "main"), "no column 'main-agent_id'"),
        ("trn_2023_v0_000,finger_incl,²\n", "'²' is not a speaker's number"),
        (
            "trn_2023_v0_000,finger_incl,1\ntrn_2023_v0_000,finger_incl,2\n",
            "line 2: trn_2023_v0_000 has another speaker",
        ),
    ],
)
def test_hostile_metadata_is_refused_with_its_place(tmp_path, text, message):
    write_genea_2023(tmp_path, {"trn_2023_v0_000": (3, 5)})
    (path,) = tmp_path.rglob("metadata.csv")
    path.write_text(text)
    with pytest.raises(InputFileError, match=message):
        find_genea_takes(tmp_path)


def test_two_copies_and_none(tmp_path):
    write_genea_2022(tmp_path / "a", {"trn_2022_v1_000": 3})
    write_genea_2022(tmp_path / "b", {"trn_2022_v1_000": 3})
    with pytest.raises(CospeechError, match="two files are recording trn_2022_v1_000"):
        find_genea_takes(tmp_path)
    put_bvh(tmp_path / "c" / "x.bvh", swinging(TWH_BODY, "x", 1.0, 30))
    put_wav(tmp_path / "c" / "x.wav", bursts("x", 1.0))
    with pytest.raises(CospeechError, match="no GENEA recording below"):
        find_genea_takes(tmp_path / "c")


def test_two_editions_are_not_mixed(tmp_path):
    write_genea_2022(tmp_path, {"val_2022_v1_000": 3})
    write_genea_2023(tmp_path, {"trn_2023_v0_000": (3, 5)})
    with pytest.raises(CospeechError, match="holds the editions 2022 and 2023, which overlap"):
        find_genea_takes(tmp_path)
