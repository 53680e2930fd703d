"""Takes with excerpts, silence, a second speaker, phases and several words to a "word"."""

import pickle
import subprocess
import sys

import numpy as np
import pytest

from cospeech.corpus.recording import Recording
from cospeech.corpus.source import Dropped
from cospeech.errors import ConfigError, CospeechError, InputFileError
from cospeech.formats.mocap import (
    Excerpt,
    ReadingSettings,
    Take,
    Voice,
    find_takes,
    read_take,
    take_sources,
)
from cospeech.formats.mocap.takes import checked_ids
from cospeech.motion.phases import PHASES
from tests.fabricated.mocap import (
    TRINITY_BODY,
    bursts,
    put_bvh,
    put_text,
    put_wav,
    spoken,
    swinging,
    tsv,
)


def put_take(folder, name="t", seconds=4.0, fps=30.0, audio=True, words=None):
    put_bvh(folder / f"{name}.bvh", swinging(TRINITY_BODY, name, seconds, fps))
    if audio:
        put_wav(folder / f"{name}.wav", bursts(name, seconds))
    if words is not None:
        put_text(folder / f"{name}.tsv", words)


def words_of(speech):
    return [(word.text, round(word.start, 3), round(word.end, 3)) for word in speech.words]


def test_motion_without_audio_is_refused_or_read_with_silence(tmp_path):
    put_take(tmp_path, audio=False, seconds=3.1)
    (take,) = find_takes(tmp_path)
    with pytest.raises(CospeechError, match=r"no t\.wav") as caught:
        read_take(take)
    assert "data.missing_audio=silence" in str(caught.value)
    (take,) = find_takes(tmp_path, missing_audio="silence")
    recording = read_take(take)
    assert recording.annotations["silent"] is True
    assert recording.annotations["warnings"] == [
        "no t.wav/.flac/.ogg/.mp3 for t.bvh; audio found: none: silence as long as the motion"
    ]
    assert len(recording.motion) == 93
    assert len(recording.speech.waveform) == 49_600
    assert not recording.speech.waveform.any()
    with pytest.raises(ConfigError, match="choose auto, skip or silence"):
        find_takes(tmp_path, missing_audio="noise")


def test_silence_does_not_excuse_missing_motion(tmp_path):
    put_wav(tmp_path / "t.wav", bursts("t", 1.0))
    (take,) = find_takes(tmp_path, missing_audio="silence")
    with pytest.raises(CospeechError, match=r"no t\.bvh for t\.wav") as caught:
        read_take(take)
    assert "silence" not in str(caught.value)


def test_an_excerpt_is_cut_to_the_sample_and_the_frame(tmp_path):
    put_take(tmp_path, seconds=6.0, words="0.5\t1.4\tbefore\n1.2\t1.8\tacross\n2.0\t2.5\tinside\n")
    (take,) = find_takes(tmp_path)
    excerpt = Excerpt(motion_start=2.0, audio_start=1.5, duration=3.0)
    recording = read_take(Take(**vars(take) | {"excerpt": excerpt}))
    np.testing.assert_array_equal(recording.speech.waveform, bursts("t", 6.0)[24_000:72_000])
    whole = swinging(TRINITY_BODY, "t", 6.0, 30.0)
    assert len(recording.motion) == 90
    for joint in ("LeftHand", "RightHand", "Head"):
        np.testing.assert_allclose(
            recording.motion.positions[:, recording.motion.skeleton.index[joint]],
            whole.positions[60:150, whole.skeleton.index[joint]],
            atol=2e-5,
        )
    assert words_of(recording.speech) == [("across", 0.0, 0.3), ("inside", 0.5, 1.0)]


@pytest.mark.parametrize(
    ("excerpt", "file"), [(Excerpt(motion_start=6.0), "t.bvh"), (Excerpt(audio_start=9.0), "t.wav")]
)
def test_an_excerpt_after_the_end_is_an_error(tmp_path, excerpt, file):
    put_take(tmp_path, seconds=6.0)
    (take,) = find_takes(tmp_path)
    with pytest.raises(InputFileError, match=rf"{file}: recording t starts at \d\.00 s of this"):
        read_take(Take(**vars(take) | {"excerpt": excerpt}))


def test_the_other_speaker_is_on_the_same_clock_and_as_long(tmp_path):
    put_take(tmp_path, "t", seconds=4.0)
    put_wav(tmp_path / "other" / "o.wav", bursts("o", 3.5))
    put_text(tmp_path / "other" / "o.tsv", "1.0\t1.5\tyes\n3.9\t4.4\tright\n4.1\t4.3\tafter\n")
    take = next(take for take in find_takes(tmp_path) if take.id == "t")
    voice = Voice(tmp_path / "other" / "o.wav", (tmp_path / "other" / "o.tsv",))
    recording = read_take(Take(**vars(take) | {"interlocutor": voice}))
    other = recording.interlocutor
    assert other is not None
    assert len(other.waveform) == len(recording.speech.waveform) == 64_000
    np.testing.assert_array_equal(other.waveform[:56_000], bursts("o", 3.5))
    assert not other.waveform[56_000:].any()
    assert words_of(other) == [("yes", 1.0, 1.5), ("right", 3.9, 4.0)]


def test_several_words_in_one_entry_share_its_time_by_their_letters(tmp_path):
    put_take(tmp_path, words="1.0\t1.6\tI am ok.\n")
    (take,) = find_takes(tmp_path)
    # 1, 2 and 2 letters of 0.6 s
    assert words_of(read_take(take).speech) == [
        ("I", 1.0, 1.12),
        ("am", 1.12, 1.36),
        ("ok.", 1.36, 1.6),
    ]


@pytest.mark.parametrize("text", ["", "\n \n"])
def test_an_empty_transcript_means_that_nobody_speaks(tmp_path, text):
    put_take(tmp_path, words=text)
    (take,) = find_takes(tmp_path)
    recording = read_take(take)
    assert recording.speech.words == ()
    assert recording.annotations["warnings"] == ["t.tsv is empty: nobody speaks in this take"]


def test_an_empty_transcript_does_not_hide_another(tmp_path):
    put_take(tmp_path, words="0.2\t0.6\thello\n")
    put_text(tmp_path / "t.TextGrid", "\n" * 500)
    recording = read_take(*find_takes(tmp_path))
    assert words_of(recording.speech) == [("hello", 0.2, 0.6)]
    assert [remark.path.name for remark in recording.remarks] == ["t.TextGrid"]
    put_text(tmp_path / "t.tsv", "no times\n")
    recording = read_take(*find_takes(tmp_path))
    assert recording.speech.words is None


def test_phases_beside_the_motion_become_frame_labels(tmp_path):
    put_take(tmp_path, seconds=4.0, fps=10.0)
    put_text(tmp_path / "t.phases.csv", "start,end,label\n0.5,1.0,preparation\n1.0,2.0,stroke\n")
    (take,) = find_takes(tmp_path)
    assert take.phase_files == (tmp_path / "t.phases.csv",)
    expected = ["none"] * 5 + ["preparation"] * 5 + ["stroke"] * 10 + ["none"] * 20
    whole = read_take(take)
    assert [PHASES[label] for label in whole.phases] == expected
    assert whole.source == "t.bvh + t.wav + t.phases.csv"
    cut = read_take(Take(**vars(take) | {"excerpt": Excerpt(0.7, 0.7, 2.0)}))
    assert [PHASES[label] for label in cut.phases] == expected[7:27]


def test_a_rate_other_than_the_published_one_is_said(tmp_path):
    put_take(tmp_path, fps=15.0)
    (take,) = find_takes(tmp_path)
    assert "warnings" not in read_take(take).annotations
    recording = read_take(Take(**vars(take) | {"published_rate": 120.0}))
    assert recording.annotations["warnings"] == [
        "t.bvh is at 15 fps, the corpus was published at 120: a derived copy?"
    ]


def test_sources_say_what_they_read_and_travel_to_other_processes(tmp_path):
    put_take(tmp_path, "a", words=tsv(spoken("a", 4.0)))
    put_take(tmp_path, "b")
    put_take(tmp_path, "mute", audio=False)
    takes = find_takes(tmp_path)
    takes.append(Take("copy", "x", None, (tmp_path / "a.wav",), (), "a copy", "augmented copy"))
    sources = take_sources(takes, ReadingSettings(licence="CC0"))
    assert [source.id for source in sources] == ["a", "b", "mute", "copy"]
    assert [path.name for path in sources[0].files] == ["a.bvh", "a.wav", "a.tsv"]
    read = pickle.loads(pickle.dumps(sources[0].read))
    (recording,) = read()
    assert isinstance(recording, Recording)
    assert (recording.id, recording.licence) == ("a", "CC0")
    with pytest.raises(CospeechError, match="take mute can't be read"):
        sources[2].read()
    (dropped,) = sources[3].read()
    assert isinstance(dropped, Dropped)
    assert (dropped.id, dropped.reason, dropped.kind) == ("copy", "a copy", "augmented copy")


def test_two_files_of_one_name_are_refused(tmp_path):
    put_take(tmp_path / "one")
    put_take(tmp_path / "two")
    takes = [Take("t", "x", take.motion) for take in find_takes(tmp_path)]
    with pytest.raises(CospeechError, match=r"two files are recording t: .*one.t\.bvh and"):
        checked_ids(takes)


def test_readers_do_without_torch():
    code = (
        "import sys; from cospeech.formats import beat, genea, mocap, trinity, zeggs;"
        " print('torch' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_every_real_folder_is_read(shared):
    root = shared / "data" / "real"
    frames = {}
    for folder in ("bandai_namco", "cmu", "trinity", "beat", "zeggs"):
        for take in find_takes(root / folder, missing_audio="silence"):
            if take.problem is None:
                recording = read_take(take)
                frames[take.id] = (
                    len(recording.motion),
                    recording.annotations.get("silent", False),
                )
                assert recording.speech.duration == pytest.approx(
                    recording.motion.duration, abs=0.04
                )
    assert len(frames) == 7 + 1 + 2 + 1 + 1
    assert frames["18_01"] == (303, True)
    assert frames["NaturalTalking_030_2_1From5"] == (1359, True)
    assert frames["2_scott_0_1_1"] == (957, False)
    assert frames["067_Speech_2_x_1_0"] == (2065, False)
