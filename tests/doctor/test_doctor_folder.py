"""Raw folders: planted faults in files, and the layouts."""

import os
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
import soundfile

from cospeech.doctor import Check, Severity, check_path
from cospeech.doctor.layouts import find_layout
from cospeech.errors import ConfigError, CospeechError
from cospeech.formats.mocap import ReadingSettings
from cospeech.motion.bvh import write_bvh
from tests.doctor.planted import (
    moved_words,
    the_error,
    the_warning,
    with_words,
    write_folder,
    write_words,
)
from tests.fabricated.berkeley import write_2d
from tests.fabricated.mocap import (
    write_beat,
    write_genea_2022,
    write_trinity_raw,
    write_trinity_release,
    write_zeggs,
)
from tests.fabricated.sound import save_wav


@pytest.fixture(scope="module")
def clean(takes, tmp_path_factory):
    folder = tmp_path_factory.mktemp("clean")
    write_folder(folder, takes[:4])
    return folder


@pytest.fixture
def folder(clean, tmp_path):
    """A copy to break."""
    for path in clean.iterdir():
        os.link(path, tmp_path / path.name)
    return tmp_path


def replaced(path):
    """The path, no longer shared with the clean folder."""
    path.unlink()
    return path


def test_a_clean_folder_passes(clean, takes):
    checkup = check_path(clean)
    assert checkup.findings == []
    assert (checkup.layout, checkup.recordings) == ("mocap", 4)
    assert checkup.seconds == pytest.approx(sum(take.speech.duration for take in takes[:4]))


@pytest.mark.slow
def test_processes_find_the_same(folder, takes):
    write_words(replaced(folder / f"{takes[1].id}.tsv"), moved_words(takes[1], 0.6))
    one, two = check_path(folder, workers=1), check_path(folder, workers=2)
    assert one.findings == two.findings
    the_error(two.findings, Check.TRANSCRIPT)


def test_missing_files(folder, takes):
    replaced(folder / f"{takes[0].id}.wav")
    replaced(folder / f"{takes[1].id}.bvh")
    (folder / "train_split.csv").write_text(
        "name,split\n" + "".join(f"{take.id},train\n" for take in takes)
    )
    findings = check_path(folder).findings
    assert {f.check for f in findings} == {Check.MISSING}
    assert {f.severity for f in findings} == {Severity.WARNING}
    by_file = {f.file.rpartition("/")[2]: f for f in findings}
    assert set(by_file) == {f"{takes[0].id}.bvh", f"{takes[1].id}.wav", "train_split.csv"}
    listed = by_file["train_split.csv"].problem
    assert "2 recordings that it names are not in the folder" in listed
    assert f"{takes[4].id}, {takes[5].id}" in listed
    assert "line 6" in listed


def test_a_missing_transcript(takes, tmp_path):
    write_folder(tmp_path, takes)
    replaced(tmp_path / f"{takes[2].id}.tsv")
    finding = the_warning(check_path(tmp_path).findings, Check.MISSING)
    assert takes[2].id in finding.file
    assert "no transcript" in finding.problem


def test_unreadable_files(folder, takes):
    replaced(folder / f"{takes[0].id}.bvh").write_text("HIERARCHY\nROOT Hips\n{\n")
    finding = the_error(check_path(folder).findings, Check.UNREADABLE)
    assert finding.file == str(folder / f"{takes[0].id}.bvh")
    for text in (b"RIFF", b""):
        (folder / f"{takes[0].id}.bvh").unlink(missing_ok=True)
        os.link(folder / f"{takes[1].id}.bvh", folder / f"{takes[0].id}.bvh")
        replaced(folder / f"{takes[0].id}.wav").write_bytes(text)
        finding = the_error(check_path(folder).findings, Check.UNREADABLE)
        assert finding.file == str(folder / f"{takes[0].id}.wav")


def test_nan_in_files(folder, takes):
    path = folder / f"{takes[0].id}.bvh"
    lines = path.read_text().splitlines()
    rows = lines.index("MOTION") + 3
    lines[rows + 300] = "nan" + lines[rows + 300][lines[rows + 300].index(" ") :]
    replaced(path).write_text("\n".join(lines) + "\n")
    finding = the_error(check_path(folder).findings, Check.NOT_A_NUMBER, 5.0)
    assert finding.file == str(path)


def test_nan_in_sound(folder, takes):
    waveform = takes[0].speech.waveform.copy()
    waveform[48000] = np.nan
    path = replaced(folder / f"{takes[0].id}.wav")
    soundfile.write(path, waveform, 16000, subtype="FLOAT")
    finding = the_error(check_path(folder).findings, Check.NOT_A_NUMBER, 3.0)
    assert finding.file == str(path)


@pytest.mark.parametrize("extra_s", [1.5, 9.0])
def test_audio_longer_than_motion(folder, takes, extra_s):
    tail = np.random.default_rng(0).normal(0, 2e-4, round(extra_s * 16000))
    path = replaced(folder / f"{takes[0].id}.wav")
    save_wav(path, np.concatenate([takes[0].speech.waveform, tail]))
    finding = the_error(check_path(folder).findings, Check.LENGTHS, takes[0].motion.duration)
    assert finding.file == str(folder / f"{takes[0].id}.bvh")
    assert f"{extra_s:.2f} s of audio are without the other" in finding.problem


def test_a_wrong_frame_rate(folder, takes):
    motion = takes[0].motion
    wrong = replace(motion, fps=50.0)
    write_bvh(replaced(folder / f"{takes[0].id}.bvh"), wrong)
    finding = the_error(check_path(folder).findings, Check.DRIFT)
    assert "60" in finding.next_step
    assert "60 fps read at 50" in finding.problem or "ratio of 1.2000" in finding.problem


@pytest.mark.parametrize("said", [50, 999_999_999])
def test_frames_that_are_not_there_are_what_the_reader_calls_them(folder, takes, said):
    path = folder / f"{takes[1].id}.bvh"
    content = re.sub(r"Frames: *\d+", f"Frames: {said}", path.read_text())
    replaced(path).write_text(content)
    of_it = [finding for finding in check_path(folder).findings if finding.file == str(path)]
    assert [finding.check for finding in of_it] == [Check.UNREADABLE]
    assert "rows follow" in of_it[0].problem
    settings = ReadingSettings(frame_rate=takes[1].motion.fps)
    told = check_path(folder, settings=settings).findings
    assert not [finding for finding in told if finding.file == str(path)]


def test_a_clock_that_runs_fast(takes, tmp_path):
    """Each take alone is 0.08 s short, which is a tail; together they tell."""
    stretched = [replace(take, motion=replace(take.motion, fps=60 * 1.004)) for take in takes]
    write_folder(tmp_path, stretched)
    finding = the_error(check_path(tmp_path).findings, Check.DRIFT)
    assert "in all 6 recordings" in finding.problem
    rate = float(finding.next_step.rpartition("=")[2])
    assert rate == pytest.approx(60, abs=0.01)


def test_metres_in_a_file_of_centimetres(folder, takes):
    write_bvh(replaced(folder / f"{takes[0].id}.bvh"), takes[0].motion, unit_scale=1.0)
    finding = the_error(check_path(folder).findings, Check.UNITS)
    assert finding.file == str(folder / f"{takes[0].id}.bvh")
    assert "data.unit_scale=1 " in finding.next_step
    mended = check_path(folder, settings=ReadingSettings(unit_scale=1.0))
    assert str(folder / f"{takes[0].id}.bvh") not in {
        finding.file for finding in mended.findings if finding.check is Check.UNITS
    }


def test_left_and_right_joints_renamed(folder, takes):
    path = folder / f"{takes[0].id}.bvh"
    text = path.read_text()
    text = text.replace("Left", "\0").replace("Right", "Left").replace("\0", "Right")
    replaced(path).write_text(text)
    finding = the_error(check_path(folder).findings, Check.SIDES)
    assert finding.file == str(path)
    assert "elbows bend backwards" in finding.problem
    assert "the nose is behind" in finding.problem


def test_words_after_the_end_of_the_file(folder, takes):
    words = [*takes[0].speech.words, *moved_words(takes[0], takes[0].speech.duration)]
    path = folder / f"{takes[0].id}.tsv"
    write_words(replaced(path), words)
    findings = [finding for finding in check_path(folder).findings if finding.file == str(path)]
    (finding,) = (one for one in findings if one.check is Check.UNREADABLE)
    assert "goes on to" in finding.problem
    assert "lie outside" in finding.problem


def test_findings_are_about_the_files_that_are_used(folder, takes):
    """A preferred transcript and sound that can't be read lie beside them."""
    name = takes[0].id
    (folder / f"{name}.TextGrid").write_text("no textgrid")
    sound, rate = soundfile.read(folder / f"{name}.wav")
    soundfile.write(folder / f"{name}.flac", sound.clip(-0.4, 0.4), rate)
    replaced(folder / f"{name}.wav").write_bytes(b"no sound")
    words = folder / f"{name}.tsv"
    write_words(replaced(words), moved_words(takes[0], 0.6))
    findings = [one for one in check_path(folder).findings if f"{name}." in one.file]
    broken = {one.file for one in findings if one.check is Check.UNREADABLE}
    assert broken == {str(folder / f"{name}.TextGrid"), str(folder / f"{name}.wav")}
    assert the_error(findings, Check.TRANSCRIPT).file == str(words)
    (clipped,) = (one for one in findings if one.check is Check.CLIPPED)
    assert clipped.file == str(folder / f"{name}.flac")


def test_transcripts_under_each_others_name(folder, takes):
    names = [folder / f"{takes[i].id}.tsv" for i in (0, 3)]
    for name, take in zip(names, (takes[3], takes[0]), strict=True):
        write_words(replaced(name), take.speech.words)
    findings = check_path(folder).findings
    errors = [f for f in findings if f.severity is Severity.ERROR]
    assert {f.file for f in errors} == {str(name) for name in names}
    assert all(f.check is Check.TRANSCRIPT for f in errors)
    assert str(names[1]) in errors[0].problem


def test_a_copy_under_another_name(folder, takes):
    for suffix in ("bvh", "wav", "tsv"):
        shutil.copy(folder / f"{takes[0].id}.{suffix}", folder / f"again.{suffix}")
    finding = the_warning(check_path(folder).findings, Check.DUPLICATE)
    assert "the same audio and motion" in finding.problem
    assert takes[0].id in finding.problem


def test_limit_takes_evenly(clean, takes):
    checkup = check_path(clean, limit=2)
    assert checkup.recordings == 2
    ends = takes[0].speech.duration + takes[3].speech.duration
    assert checkup.seconds == pytest.approx(ends)


def test_text_without_times_is_not_judged(folder, takes):
    for take in takes[:4]:
        replaced(folder / f"{take.id}.tsv")
        text = " ".join(word.text for word in take.speech.words)
        (folder / f"{take.id}.txt").write_text(text)
    assert check_path(folder).findings == []


def test_a_shifted_words_file_is_one_finding(folder, takes):
    late = with_words(takes[0], moved_words(takes[0], 2.5))
    write_words(replaced(folder / f"{takes[0].id}.tsv"), late.speech.words)
    finding = the_error(check_path(folder).findings, Check.TRANSCRIPT)
    assert re.match(r"the words come 2\.(49|5.) s too late", finding.problem)


@pytest.mark.parametrize(
    ("files", "layout"),
    [
        (["lmdb_train/data.mdb"], "ted"),
        (["lmdb_val_cache/data.mdb"], "ted"),
        (["frames_df_10_19_19.csv", "oliver/keypoints_simple/a.txt"], "berkeley2d"),
        (["train_oliver_noduplication_data.npz"], "berkeley3d"),
        (["a1_raw.csv", "a1_va3.csv"], "uci_phases"),
        (["trn/bvh/trn_2022_v1_001.bvh", "trn/wav/trn_2022_v1_001.wav"], "genea"),
        (["Motion/Recording_001.bvh", "Audio/Recording_001.wav"], "trinity"),
        (["clean/067_Speech_2_x_1_0.bvh"], "zeggs"),
        (["2/2_scott_0_1_1.bvh", "2/2_scott_0_1_1.wav"], "beat"),
        (["mine.bvh", "mine.wav"], "mocap"),
        (["mine.wav"], "mocap"),
    ],
)
def test_layouts_are_known_by_their_names(tmp_path, files, layout):
    for name in files:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    assert find_layout(tmp_path).name == layout


def test_what_is_no_corpus(tmp_path):
    with pytest.raises(CospeechError, match="nothing that is known"):
        check_path(tmp_path)
    with pytest.raises(CospeechError, match="not a folder"):
        check_path(tmp_path / "absent")
    with pytest.raises(ConfigError, match="choose one of ted, "):
        check_path(tmp_path, layout="vhs")


def test_published_layouts_pass(tmp_path):
    write_trinity_release(tmp_path / "trinity", seconds=8.0)
    write_genea_2022(tmp_path / "genea", {"trn_2022_v1_001": 1, "val_2022_v1_002": 2}, seconds=8.0)
    write_zeggs(tmp_path / "zeggs", {"001_Neutral_0": False, "002_Neutral_1": True}, seconds=8.0)
    write_beat(tmp_path / "beat", ("2_scott_0_1_1", "1_wayne_0_1_1"), seconds=8.0)
    write_2d(tmp_path / "berkeley2d")
    for layout, recordings in (
        ("trinity", 6), ("genea", 2), ("zeggs", 2), ("beat", 2), ("berkeley2d", 12),
    ):  # fmt: skip
        checkup = check_path(tmp_path / layout)
        assert (checkup.layout, checkup.recordings) == (layout, recordings)
        bad = [f for f in checkup.findings if f.severity is not Severity.NOTE]
        assert [f for f in bad if f.file.rpartition("/")[2] != "info.csv"] == []


def test_raw_trinity_takes_without_their_offsets(tmp_path):
    write_trinity_raw(tmp_path, 4, 0.5, 1.5, seconds=8.0)
    checkup = check_path(tmp_path)
    unreadable = [f for f in checkup.findings if f.check is Check.UNREADABLE]
    assert "no offset table" in unreadable[0].problem
    assert checkup.layout == "mocap"


def test_the_teds_own_fixture_is_read(shared):
    checkup = check_path(shared / "data/ted_legacy_fixture")
    assert (checkup.layout, checkup.recordings) == ("ted", 9)
    # Its sound is made of noise that does not follow the words.
    errors = {f.check for f in checkup.findings if f.severity is Severity.ERROR}
    assert errors <= {Check.TRANSCRIPT}


@pytest.mark.parametrize("corpus", ["beat", "zeggs", "trinity", "bandai_namco", "cmu"])
def test_real_recordings_have_no_errors(shared, corpus):
    checkup = check_path(shared / "data/real" / corpus)
    assert [f for f in checkup.findings if f.severity is Severity.ERROR] == []
    assert checkup.recordings >= 1
    jumps = [f for f in checkup.findings if f.check is Check.JUMP]
    if corpus == "zeggs":  # the fingers are thrown 0.3 m off for two frames
        assert jumps[0].problem.startswith("RightHand")
        assert jumps[0].time_s == pytest.approx(67.2, abs=0.05)


def test_the_uci_set_is_read(shared):
    checkup = check_path(shared / "data/real/uci_gesture_phase")
    assert (checkup.layout, checkup.recordings) == ("uci_phases", 7)
    assert not [f for f in checkup.findings if f.severity is Severity.ERROR]
