"""Folders of BVH and audio: finding takes, bringing them to one clock, and naming what is wrong."""

import gzip
import shutil

import numpy as np
import pytest
import soundfile

from cospeech.errors import CospeechError, InputFileError
from cospeech.formats.mocap import ReadingSettings, Take, find_takes, read_take
from cospeech.motion.bvh import read_bvh, read_bvh_skeleton, write_bvh
from cospeech.motion.joint_map import load_joint_map
from cospeech.motion.kinematics import skeleton_positions
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import to_upper_body

BODY = Skeleton(
    "body",
    ("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head", "LeftArm", "LeftForeArm", "LeftHand",
     "RightArm", "RightForeArm", "RightHand", "LeftUpLeg", "RightUpLeg"),
    (-1, 0, 1, 2, 3, 4, 3, 6, 7, 3, 9, 10, 0, 0),
    np.array(
        [[0, 0.9, 0], [0, 0.1, 0], [0, 0.12, 0], [0, 0.13, 0], [0, 0.15, 0], [0, 0.1, 0],
         [0.18, 0.1, 0], [0.28, 0, 0], [0.25, 0, 0], [-0.18, 0.1, 0], [-0.28, 0, 0],
         [-0.25, 0, 0], [0.1, 0, 0], [-0.1, 0, 0]]
    ),
)  # fmt: skip


def put_motion(path, seconds=4.0, fps=15.0, unit_scale=0.01):
    frames = round(seconds * fps)
    rotations = np.zeros((frames, len(BODY), 4), np.float32)
    rotations[..., 3] = 1.0
    path.parent.mkdir(parents=True, exist_ok=True)
    motion = Motion(BODY, fps, skeleton_positions(BODY, rotations), rotations)
    return write_bvh(path, motion, unit_scale=unit_scale)


def put_audio(path, seconds=4.0, rate=16_000):
    path.parent.mkdir(parents=True, exist_ok=True)
    tone = 0.3 * np.sin(2 * np.pi * 220 * np.arange(round(seconds * rate)) / rate)
    soundfile.write(path, tone, rate)


def put(path, text="hello world"):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


TSV = "0.5\t1.0\thello\n1.0\t1.5\tthere\n3.5\t4.2\tworld\n"


def test_takes_in_one_folder(tmp_path):
    put_motion(tmp_path / "b.bvh")
    put_audio(tmp_path / "b.WAV")
    put_audio(tmp_path / "b.flac")
    put(tmp_path / "b.txt")
    put(tmp_path / "b.tsv", TSV)
    put_motion(tmp_path / "a.bvh")
    put_audio(tmp_path / "a.ogg")
    put(tmp_path / "notes.txt")
    put(tmp_path / "._b.bvh", "mac rubbish")
    takes = find_takes(tmp_path)
    assert [take.id for take in takes] == ["a", "b"]
    assert takes[0] == Take("a", tmp_path.name, tmp_path / "a.bvh", (tmp_path / "a.ogg",))
    assert takes[1].audio == tmp_path / "b.WAV"
    assert takes[1].transcripts[0] == tmp_path / "b.tsv"


@pytest.mark.parametrize(
    ("motion", "audio", "words", "speaker"),
    [
        ("Motion/T_1.bvh", "Audio/T_1.wav", "Transcripts/T_1.json", "corpus"),
        ("train/bvh/T_1.bvh", "train/wav/T_1.wav", "train/tsv/T_1.tsv", "train"),
        ("scott/T_1.bvh", "scott/T_1.wav", "scott/T_1.TextGrid", "scott"),
        ("scott/motion/T_1.bvh", "scott/audio/T_1.wav", "scott/text/T_1.vtt", "scott"),
        # a folder of an unforeseen name is matched by the stem, where only one file has it
        ("bvh_of_day_1/T_1.bvh", "lapel_microphone/T_1.wav", "asr/T_1.srt", "bvh_of_day_1"),
    ],
)
def test_layouts_of_the_field(tmp_path, motion, audio, words, speaker):
    root = tmp_path / "corpus"
    for path in (motion, audio, words):
        put(root / path)
    (take,) = find_takes(root)
    assert take == Take("T_1", speaker, root / motion, (root / audio,), (root / words,))


def test_equal_stems_of_two_speakers_stay_apart(tmp_path):
    for who in ("anna", "bert"):
        put(tmp_path / who / "Motion" / "001.bvh")
        put(tmp_path / who / "Audio" / "001.wav")
    takes = find_takes(tmp_path)
    assert [(take.id, take.speaker) for take in takes] == [
        ("anna-001", "anna"),
        ("bert-001", "bert"),
    ]
    for take in takes:
        assert take.motion == tmp_path / take.speaker / "Motion" / "001.bvh"
        assert take.audio == tmp_path / take.speaker / "Audio" / "001.wav"


def test_links_to_folders_elsewhere_are_followed_and_never_in_circles(tmp_path):
    root, elsewhere = tmp_path / "root", tmp_path / "elsewhere"
    put_motion(elsewhere / "deep" / "take.bvh")
    put_audio(elsewhere / "deep" / "take.wav")
    (elsewhere / "again").symlink_to(elsewhere)
    put_motion(root / "own" / "other.bvh")
    put_audio(root / "own" / "other.wav")
    (root / "anna").symlink_to(elsewhere)
    (root / "twice").symlink_to(elsewhere / "deep")
    (root / "copy").symlink_to(root / "own")
    (root / "own" / "up").symlink_to(tmp_path)
    assert [take.id for take in find_takes(root)] == ["other", "take"]


def test_ids_are_plain(tmp_path):
    put(tmp_path / "täke (1).bvh")
    put(tmp_path / "täke (1).wav")
    put(tmp_path / "t_ke (1).bvh")
    put(tmp_path / "t_ke (1).wav")
    assert [take.id for take in find_takes(tmp_path)] == ["t_ke__1_", "t_ke__1_-2"]


@pytest.mark.parametrize(
    ("rule", "speaker"),
    [
        ("folder", "day1"),
        ("prefix", "2"),
        (r"_([a-z]+)_", "scott"),
        (r"^(day\d)/(?P<speaker>\d)_", "2"),
    ],
)
def test_speaker_rules(tmp_path, rule, speaker):
    put(tmp_path / "day1" / "2_scott_0_1.bvh")
    put(tmp_path / "day1" / "2_scott_0_1.wav")
    (take,) = find_takes(tmp_path, speaker=rule)
    assert (take.speaker, take.problem) == (speaker, None)


def test_wrong_speaker_rules(tmp_path):
    put(tmp_path / "a.bvh")
    put(tmp_path / "a.wav")
    (take,) = find_takes(tmp_path, speaker=r"_([a-z]+)_")
    assert take.problem == "the speaker pattern '_([a-z]+)_' does not occur in a.bvh"
    with pytest.raises(CospeechError, match="neither 'folder' nor 'prefix' nor a pattern"):
        find_takes(tmp_path, speaker="stem")
    with pytest.raises(CospeechError, match=r"data\.speaker: .*is no regular expression"):
        find_takes(tmp_path, speaker="(")


def test_what_lacks_a_partner_is_listed_with_the_reason(tmp_path):
    put(tmp_path / "whole.bvh")
    put(tmp_path / "whole.wav")
    put(tmp_path / "Mute.bvh")
    put(tmp_path / "Still.wav")
    problems = {take.id: take.problem for take in find_takes(tmp_path)}
    assert problems == {
        "whole": None,
        "Mute": "no Mute.wav/.flac/.ogg/.mp3 for Mute.bvh; audio found: Still.wav, whole.wav",
        "Still": "no Still.bvh for Still.wav",
    }
    mute = next(take for take in find_takes(tmp_path) if take.id == "Mute")
    with pytest.raises(CospeechError, match=r"take Mute can't be read: no Mute\.wav"):
        read_take(mute)


def test_nothing_there(tmp_path):
    with pytest.raises(CospeechError, match="no take below"):
        find_takes(tmp_path)
    with pytest.raises(CospeechError, match="is not a folder"):
        find_takes(tmp_path / "absent")


def take_of(tmp_path, motion_s=4.0, audio_s=4.0, words=None, fps=15.0, unit_scale=0.01):
    put_motion(tmp_path / "t.bvh", motion_s, fps, unit_scale)
    put_audio(tmp_path / "t.wav", audio_s)
    if words is not None:
        put(tmp_path / "t.tsv", words)
    (take,) = find_takes(tmp_path)
    return take


def test_a_take_is_read_on_one_clock(tmp_path):
    recording = read_take(take_of(tmp_path, 4.0, 4.5, TSV), ReadingSettings(licence="CC0"))
    assert recording.id == "t"
    assert recording.speaker == tmp_path.name
    assert (len(recording.motion), recording.motion.fps) == (60, 15.0)
    assert len(recording.speech.waveform) == 64_000
    assert recording.speech.words is not None
    words = [(word.text, word.start, word.end) for word in recording.speech.words]
    assert words == [("hello", 0.5, 1.0), ("there", 1.0, 1.5), ("world", 3.5, 4.0)]
    assert recording.motion.skeleton.name == "mixamo"
    assert recording.annotations == {"joint_map": "mixamo", "word_timing": "words"}
    assert recording.source == "t.bvh + t.wav + t.tsv"
    assert recording.licence == "CC0"


def test_motion_is_cut_to_shorter_audio_and_words_beyond_are_dropped(tmp_path):
    recording = read_take(take_of(tmp_path, 4.0, 3.4, TSV))
    assert len(recording.motion) == 51
    assert len(recording.speech.waveform) == 54_400
    assert recording.speech.words is not None
    assert [word.text for word in recording.speech.words] == ["hello", "there"]
    assert recording.annotations["warnings"] == [
        "t.tsv: 1 word of 3 left out, after the end of the sound: the words go on to 4.2 s, the"
        " sound to 3.4 s; is it the transcript of this recording?"
    ]


def test_a_second_of_difference_is_a_warning_and_a_fifth_an_error(tmp_path):
    recording = read_take(take_of(tmp_path, 8.0, 9.5))
    assert recording.annotations["warnings"] == [
        "the motion lasts 8.00 s, the audio 9.50 s; the longer was cut"
    ]
    assert recording.speech.duration == recording.motion.duration == 8.0
    with pytest.raises(InputFileError, match="can't be the same take") as caught:
        read_take(take_of(tmp_path, 4.0, 8.0))
    assert "at about 7.5 fps and not 15: set data.frame_rate" in str(caught.value)
    slow = ReadingSettings(frame_rate=7.5)
    assert len(read_take(take_of(tmp_path, 4.0, 8.0), slow).motion) == 60
    with pytest.raises(InputFileError, match="can't be the same take") as caught:
        read_take(take_of(tmp_path, 8.0, 0.05))
    assert "check that both are of one take, and complete" in str(caught.value)


def test_a_transcript_of_another_take_is_a_warning(tmp_path):
    recording = read_take(take_of(tmp_path, words=TSV + "8.0\t9.0\tlate\n"))
    assert recording.annotations["warnings"] == [
        "t.tsv: 1 word of 4 left out, after the end of the sound: the words go on to 9.0 s, the"
        " sound to 4.0 s; is it the transcript of this recording?"
    ]


def test_a_wrong_scale_is_a_warning_that_unit_scale_mends(tmp_path):
    take = take_of(tmp_path, unit_scale=1.0)
    assert "set data.unit_scale" in read_take(take).annotations["warnings"][0]
    assert "warnings" not in read_take(take, ReadingSettings(unit_scale=1.0)).annotations


def test_a_header_that_is_a_row_off_is_one_warning(tmp_path):
    take = take_of(tmp_path)
    take.motion.write_text(take.motion.read_text().replace("Frames: 60", "Frames: 59"))
    recording = read_take(take)
    assert len(recording.motion) == 60
    assert recording.annotations["warnings"] == [
        "t.bvh: the header says 59 frames, 60 rows follow and are read"
    ]


def test_a_vertical_that_is_z_is_a_warning_that_up_axis_mends(tmp_path):
    upright = read_take(take_of(tmp_path)).motion
    take = take_of(tmp_path)
    lines = take.motion.read_text().splitlines()
    start = lines.index(next(line for line in lines if line.startswith("Frame Time"))) + 1
    # the root at (0, -z, y), and lifted by 90 degrees about x: Z X Y channels
    for i in range(start, len(lines)):
        x, y, z, _, _, _, *rest = lines[i].split()
        lines[i] = " ".join([x, str(-float(z)), y, "0", "90", "0", *rest])
    take.motion.write_text("\n".join(lines) + "\n")
    assert "data.up_axis=z" in read_take(take).annotations["warnings"][0]
    recording = read_take(take, ReadingSettings(up_axis="z"))
    assert "warnings" not in recording.annotations
    np.testing.assert_allclose(recording.motion.positions, upright.positions, atol=1e-5)


def test_nan_names_frame_and_joint(tmp_path):
    take = take_of(tmp_path)
    lines = take.motion.read_text().splitlines()
    row = lines[-10].split()
    row[3 + 3 * BODY.index["LeftArm"]] = "nan"
    lines[-10] = " ".join(row)
    take.motion.write_text("\n".join(lines))
    with pytest.raises(InputFileError, match="frame 50, joint LeftArm: 'nan'"):
        read_take(take)


def test_an_unknown_skeleton_names_the_file_and_shows_a_map(tmp_path):
    take = take_of(tmp_path)
    take.motion.write_text(take.motion.read_text().replace("LeftForeArm", "Ulna"))
    with pytest.raises(InputFileError, match=r"t\.bvh: no joint map fits") as caught:
        read_take(take)
    assert "left_elbow: LeftForeArm" in str(caught.value)


def test_a_given_joint_map_is_used(tmp_path):
    settings = ReadingSettings(joint_map=load_joint_map("mixamo"))
    recording = read_take(take_of(tmp_path), settings)
    np.testing.assert_allclose(
        to_upper_body(recording.motion).positions[0, 2], [0, 0.4, 0.12], atol=1e-6
    )


def test_a_header_with_a_wrong_frame_count_offers_the_rate(shared, tmp_path):
    real = shared / "data" / "real" / "beat"
    with gzip.open(real / "2_scott_0_1_1.diffsheg_original.bvh.gz") as packed:
        (tmp_path / "2_scott_0_1_1.bvh").write_bytes(packed.read())
    shutil.copy(real / "2_scott_0_1_1.wav", tmp_path)
    (take,) = find_takes(tmp_path)
    with pytest.raises(InputFileError, match=r"data\.frame_rate=15"):
        read_take(take)
    mended = read_take(take, ReadingSettings(frame_rate=15))
    assert mended.motion.duration == pytest.approx(63.8)


def test_beat_and_zeggs_are_read(shared):
    root = shared / "data" / "real"
    takes = {take.id: take for take in find_takes(root / "beat", speaker=r"^\d+_([a-z]+)_")}
    assert takes["2_scott_0_2_2"].problem == "no 2_scott_0_2_2.bvh for 2_scott_0_2_2.wav"
    scott = read_take(takes["2_scott_0_1_1"])
    assert scott.speaker == "scott"
    assert scott.speech.words is not None
    assert (len(scott.motion), scott.motion.fps, len(scott.speech.words)) == (957, 15.0, 199)
    assert scott.speech.duration == pytest.approx(63.8)
    assert scott.annotations == {"joint_map": "beat", "word_timing": "words"}
    (take,) = find_takes(root / "zeggs")
    actor = read_take(take)
    assert (len(actor.motion), actor.motion.fps, actor.speech.words) == (2065, 30.0, None)
    assert actor.annotations == {"joint_map": "zeggs"}


def test_every_real_bvh_becomes_an_upper_body(shared):
    root = shared / "data" / "real"
    paths = [take.motion for take in find_takes(root) if take.motion is not None]
    assert len(paths) == 13
    for path in paths:
        if path.name == "genea_header.bvh":  # the only one without frames
            assert len(read_bvh_skeleton(path)) == 83 + 27
            continue
        body = to_upper_body(read_bvh(path))
        assert np.isfinite(body.positions).all()
        np.testing.assert_array_equal(body.positions[:, 0], 0)
