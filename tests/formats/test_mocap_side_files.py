"""What lies beside a take and can't be used costs itself, never the take; sound that can't be read
is never taken for no sound."""

import os

import numpy as np
import pytest
import soundfile

from cospeech.doctor import Severity, check_path
from cospeech.errors import ConfigError, InputFileError
from cospeech.formats.mocap import ReadingSettings, Take, Voice, find_takes, read_take, take_sources
from cospeech.motion.phases import PHASES
from cospeech.speech import audio_streams
from tests.formats.test_mocap_reading import put_take, words_of

BLENDSHAPES = '{"names": ["jawOpen"], "frames": [{"weights": [0.1], "time": 0.0}]}'
ELAN = """<ANNOTATION_DOCUMENT><HEADER TIME_UNITS="milliseconds"/>
<TIME_ORDER><TIME_SLOT TIME_SLOT_ID="a" TIME_VALUE="0"/>
<TIME_SLOT TIME_SLOT_ID="b" TIME_VALUE="1000"/></TIME_ORDER>
<TIER TIER_ID="words"><ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="1" TIME_SLOT_REF1="a"
 TIME_SLOT_REF2="b"><ANNOTATION_VALUE>so</ANNOTATION_VALUE></ALIGNABLE_ANNOTATION></ANNOTATION>
</TIER>
<TIER TIER_ID="my tier"><ANNOTATION><ALIGNABLE_ANNOTATION ANNOTATION_ID="2" TIME_SLOT_REF1="a"
 TIME_SLOT_REF2="b"><ANNOTATION_VALUE>P2</ANNOTATION_VALUE></ALIGNABLE_ANNOTATION></ANNOTATION>
</TIER></ANNOTATION_DOCUMENT>"""


def test_a_json_that_is_no_transcript_costs_the_words(tmp_path):
    put_take(tmp_path)
    (tmp_path / "t.json").write_text(BLENDSHAPES)
    recording = read_take(*find_takes(tmp_path))
    assert recording.speech.words is None
    (remark,) = recording.remarks
    assert remark.path == tmp_path / "t.json"
    assert remark.kind == "without a transcript"
    assert str(tmp_path / "t.json") in remark.text
    assert recording.annotations["warnings"] == [remark.text]


def test_where_the_preferred_transcript_can_not_be_used_the_next_is(tmp_path):
    put_take(tmp_path, words="0.2\t0.6\thello\n")
    (tmp_path / "t.TextGrid").write_text("no textgrid")
    (tmp_path / "t.json").write_text(BLENDSHAPES)
    (take,) = find_takes(tmp_path)
    assert [path.name for path in take.transcripts] == ["t.TextGrid", "t.json", "t.tsv"]
    assert set(take.transcripts) <= set(take.files)
    recording = read_take(take)
    assert words_of(recording.speech) == [("hello", 0.2, 0.6)]
    assert [remark.path.name for remark in recording.remarks] == ["t.TextGrid", "t.json"]
    assert all("t.tsv is used as a transcript" in remark.text for remark in recording.remarks)
    assert recording.source == "t.bvh + t.wav + t.tsv"
    assert {remark.kind for remark in recording.remarks} == {
        "a transcript that can't be used; another is"
    }


def put_pipe(path):
    os.mkfifo(path)


def put_link_to_a_device(path):
    path.symlink_to("/dev/zero")


@pytest.mark.parametrize("put", [os.mkdir, put_pipe, put_link_to_a_device])
def test_what_is_no_file_costs_itself_and_nobody_waits_for_it(tmp_path, put):
    put_take(tmp_path)
    for name in ("t.txt", "t.srt", "t.eaf"):
        put(tmp_path / name)
    recording = read_take(*find_takes(tmp_path))
    assert recording.speech.words is None
    assert recording.phases is None
    if put is os.mkdir:  # folders are looked into, never taken for files
        assert recording.remarks == ()
    else:
        assert {remark.path.name for remark in recording.remarks} == {"t.txt", "t.srt", "t.eaf"}
        assert all("is not a file" in remark.text for remark in recording.remarks)
    findings = check_path(tmp_path).findings
    assert not [found for found in findings if found.severity is Severity.ERROR]


@pytest.mark.parametrize("kind", [ZeroDivisionError, MemoryError, RecursionError, KeyError])
def test_a_reader_that_breaks_costs_the_words_alone(tmp_path, monkeypatch, kind):
    def broken(*_):
        raise kind("oh")

    monkeypatch.setattr("cospeech.formats.mocap.side_files.read_transcript_with_timing", broken)
    put_take(tmp_path, words="0.2\t0.6\thello\n")
    recording = read_take(*find_takes(tmp_path))
    assert recording.speech.words is None
    assert [remark.kind for remark in recording.remarks] == ["without a transcript"]


def test_annotations_without_phases_cost_the_phases_and_a_tier_and_labels_mend_it(tmp_path):
    put_take(tmp_path)
    (tmp_path / "t.eaf").write_text(ELAN)
    takes = find_takes(tmp_path)
    recording = read_take(*takes)
    assert recording.phases is None
    (remark,) = recording.remarks
    assert remark.path == tmp_path / "t.eaf"
    assert recording.source == "t.bvh + t.wav"
    assert "data.phase_tier=" in remark.advice
    assert "data.phase_labels=" in remark.advice
    settings = ReadingSettings(phase_tier="my tier", phase_labels={"p2": "stroke"})
    (source,) = take_sources(takes, settings)
    (mended,) = source.read()
    assert mended.remarks == ()
    assert [PHASES[mended.phases[frame]] for frame in (0, 29, 30)] == ["stroke", "stroke", "none"]


def test_phases_far_beyond_the_motion_are_not_used(tmp_path):
    put_take(tmp_path, seconds=4.0)
    path = tmp_path / "t.phases.csv"
    path.write_text("0,1000,preparation\n1000,3500,stroke\n")
    recording = read_take(*find_takes(tmp_path))
    assert recording.phases is None
    (remark,) = recording.remarks
    assert remark.path == path
    assert "milliseconds" in remark.text
    path.write_text("0,1,preparation\n1,20,stroke\n")
    assert read_take(*find_takes(tmp_path)).phases is None
    path.write_text("0,1,preparation\n1,4.5,stroke\n")
    assert read_take(*find_takes(tmp_path)).phases is not None


def test_what_the_other_speaker_lacks_is_not_the_takes_loss(tmp_path):
    for name in ("t", "other"):
        put_take(tmp_path, name)
    take = next(take for take in find_takes(tmp_path) if take.id == "t")
    broken = tmp_path / "o.json"
    broken.write_text(BLENDSHAPES)
    good = tmp_path / "o.tsv"
    good.write_text("0.2\t0.6\thello\n")

    def read(voice):
        return read_take(Take(**vars(take) | {"interlocutor": voice}))

    recording = read(Voice(tmp_path / "other.wav", (broken, good)))
    assert words_of(recording.interlocutor) == [("hello", 0.2, 0.6)]
    recording = read(Voice(tmp_path / "other.wav", (broken,)))
    assert recording.interlocutor.words is None
    assert [remark.path for remark in recording.remarks] == [broken]
    recording = read(Voice(broken))
    assert recording.interlocutor is None
    assert "not used as the other speaker's sound" in recording.remarks[0].text


# Sound --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("missing_audio", ["auto", "skip", "silence"])
def test_sound_that_can_not_be_read_is_never_silence(tmp_path, monkeypatch, missing_audio):
    monkeypatch.setattr(audio_streams, "find_ffmpeg", lambda: None)
    put_take(tmp_path, audio=False)
    (tmp_path / "t.m4a").write_bytes(b"\0\0\0\x20ftypM4A \0\0\0\0" + bytes(100))
    (take,) = find_takes(tmp_path, missing_audio=missing_audio)
    with pytest.raises(InputFileError, match=r"t\.m4a: .*\n.*ffmpeg -i \S*t\.m4a .*t\.wav"):
        read_take(take)


def test_auto_is_silence_only_where_no_file_may_hold_sound(tmp_path):
    put_take(tmp_path, audio=False)
    (take,) = find_takes(tmp_path, missing_audio="auto")
    assert take.problem is None
    (tmp_path / "somebody.wma").write_bytes(b"?")
    take = next(take for take in find_takes(tmp_path, missing_audio="auto") if take.motion)
    assert take.problem == "no t.wav/.flac/.ogg/.mp3 for t.bvh; audio found: somebody.wma"


def test_a_video_without_motion_of_its_name_is_no_take(tmp_path):
    put_take(tmp_path)
    (tmp_path / "rendered.mp4").write_bytes(b"?")
    (tmp_path / "t.mp4").write_bytes(b"?")
    (take,) = find_takes(tmp_path)
    assert take.audio.name == "t.wav"


def test_channels_that_cancel_out_are_remarked_on(tmp_path):
    from tests.fabricated.mocap import bursts, put_wav

    put_take(tmp_path, audio=False)
    put_wav(tmp_path / "t.wav", np.stack([bursts("t", 4.0), -bursts("t", 4.0)], axis=1))
    recording = read_take(*find_takes(tmp_path))
    assert np.abs(recording.speech.waveform).max() > 0.1
    assert [remark.kind for remark in recording.remarks] == ["odd audio file"]


def test_where_the_preferred_sound_can_not_be_read_the_next_is(tmp_path):
    from tests.fabricated.mocap import bursts

    put_take(tmp_path)
    (tmp_path / "t.wav").write_bytes(b"no sound")
    (take,) = find_takes(tmp_path)
    with pytest.raises(InputFileError, match=r"t\.wav: can't be read"):
        read_take(take)
    soundfile.write(tmp_path / "t.flac", bursts("t", 4.0), 16000)
    (take,) = find_takes(tmp_path)
    assert take.audio.name == "t.wav"
    recording = read_take(take)
    assert np.abs(recording.speech.waveform).max() > 0.1
    assert [remark.path.name for remark in recording.remarks] == ["t.wav"]
    assert recording.source == "t.bvh + t.flac"


@pytest.mark.parametrize(
    "name", ["t.mp2", "t.wv", "t.m4b", "t.ts", "t.mxf", "t.ape", "t.mpga", "t.raw", "t.wav.gz"]
)
def test_whatever_may_hold_sound_is_not_taken_for_silence(tmp_path, name):
    put_take(tmp_path, audio=False)
    (tmp_path / name).write_bytes(b"?")
    (take,) = find_takes(tmp_path, missing_audio="auto")
    with pytest.raises(InputFileError, match=name.replace(".", r"\.")) as caught:
        read_take(take)
    assert caught.value.hint


def test_links_to_nothing_cost_their_take(tmp_path):
    put_take(tmp_path, "good")
    put_take(tmp_path, "mute", audio=False)
    (tmp_path / "mute.wav").symlink_to(tmp_path / "gone.wav")
    (tmp_path / "still.bvh").symlink_to(tmp_path / "still.bvh")
    put_take(tmp_path, "other")
    (tmp_path / "still.wav").symlink_to(tmp_path / "other.wav")
    good, mute, _, still = find_takes(tmp_path)
    assert read_take(good).remarks == ()
    with pytest.raises(InputFileError, match=r"mute\.wav: no such audio file"):
        read_take(mute)
    with pytest.raises(InputFileError, match=r"still\.bvh"):
        read_take(still)


def test_a_speaker_pattern_takes_linear_time(tmp_path):
    put_take(tmp_path, "a" * 60)
    (take,) = find_takes(tmp_path, speaker=r"((a+)+)+-")
    assert "does not occur" in take.problem
    with pytest.raises(ConfigError, match=r"(?s)data\.speaker: .*look-around"):
        find_takes(tmp_path, speaker=r"(?<=_)(a)")
