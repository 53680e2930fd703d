import json

import numpy as np
import pytest

from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.corpus.store_writer import StoreWriter
from cospeech.errors import CospeechError, InputFileError
from cospeech.speech.speech import Word
from tests.corpora import REST_POSE, make_recording, make_store


def test_what_goes_in_comes_out(tmp_path):
    words = (Word("Hello", 0.5, 0.9), Word("world", 1.0, 1.4))
    recordings = [make_recording(f"take{i}", words=words, seed=i) for i in range(3)]
    store = make_store(tmp_path, recordings)
    for i, recording in enumerate(recordings):
        assert store.recordings[i].id == recording.id
        stored = store.motion(i)
        np.testing.assert_array_equal(stored.positions, recording.motion.positions)
        assert stored.skeleton.joints == recording.motion.skeleton.joints
        speech = store.speech(Span(i, 0, 150))
        np.testing.assert_allclose(speech.waveform, recording.speech.waveform, atol=1 / 32767)
        assert speech.words == (Word("hello", 0.5, 0.9), Word("world", 1.0, 1.4))
    assert store.vocabulary[4:] == ["hello", "world"]


def test_upper_body_has_the_spine_at_the_origin(tmp_path):
    store = make_store(tmp_path)
    upper = store.upper_body(0)
    assert upper.shape == (150, 10, 3)
    np.testing.assert_allclose(upper[:, 0], 0, atol=1e-6)
    np.testing.assert_allclose(upper[:, 1], np.tile(REST_POSE[1], (150, 1)), atol=1e-5)


def test_statistics_are_of_the_training_split_alone(tmp_path):
    store = make_store(tmp_path)
    train = np.concatenate([store.upper_body(span.recording) for span in store.splits["train"]])
    train = train.astype(np.float64)
    bones = train[:, 1:] - train[:, [0, 1, 2, 1, 4, 5, 1, 7, 8]]
    lengths = np.linalg.norm(bones, axis=-1)
    np.testing.assert_allclose(store.facts()["bone_lengths"], lengths.mean(0), rtol=1e-5)
    directions = (bones / lengths[..., None]).mean(0).reshape(-1)
    np.testing.assert_allclose(store.facts()["mean_direction"], directions, atol=1e-6)


def test_a_window_read_copies_nothing(tmp_path):
    store = make_store(tmp_path)
    window = store.read(1, "upper_body", 10, 20)
    base = window
    while base.base is not None and not isinstance(base, np.memmap):
        base = base.base
    assert isinstance(base, np.memmap)
    assert window.shape == (10, 30)


def test_audio_past_the_end_is_mirrored(tmp_path):
    store = make_store(tmp_path)
    audio = store.audio(0, 160_000 - 3, 6)
    np.testing.assert_array_equal(audio[3:], audio[:3][::-1])


def test_a_folder_without_a_manifest_is_no_store(tmp_path):
    with pytest.raises(InputFileError, match="not a store"):
        Store(tmp_path)


def test_a_stream_cut_short_is_found_at_opening(tmp_path):
    store = make_store(tmp_path)
    audio = store.path / "audio.bin"
    audio.write_bytes(audio.read_bytes()[:-2])
    with pytest.raises(InputFileError, match=r"audio\.bin.*holds 1919998 bytes.*says 1920000"):
        Store(store.path)


def test_another_schema_is_refused_with_the_way_out(tmp_path):
    store = make_store(tmp_path)
    path = store.path / "manifest.json"
    path.write_text(json.dumps({**store.manifest, "schema": 99}))
    with pytest.raises(InputFileError, match="schema 99") as caught:
        Store(store.path)
    assert "rebuilt" in caught.value.hint


def test_nan_motion_names_frame_and_joint(tmp_path):
    recording = make_recording("bad")
    recording.motion.positions[7, 6, 1] = np.nan
    with (
        pytest.raises(CospeechError, match=r"bad.*frame 7, joint left_wrist"),
        StoreWriter(tmp_path / "s", "s", {}, "0") as writer,
    ):
        writer.add(recording)


def test_a_word_that_ends_before_it_begins_is_read_with_no_duration(tmp_path):
    words = (Word("one", 1.0, 1.5), Word("two", 2.0, 1.9), Word("three", 3.0, 3.5))
    recordings = [make_recording(name, words=words) for name in "abc"]
    speech = make_store(tmp_path, recordings).speech(Span(0, 0, 150))
    assert [word.end - word.start for word in speech.words] == [0.5, 0.0, 0.5]


def test_a_transcript_without_words_differs_from_none(tmp_path):
    silent = make_recording("silent", words=())
    untold = make_recording("untold")
    untold = type(untold)(
        **{**untold.__dict__, "speech": type(untold.speech)(untold.speech.waveform, None)}
    )
    store = make_store(tmp_path, [silent, untold, make_recording("c")])
    assert store.speech(Span(0, 0, 30)).words == ()
    assert store.speech(Span(1, 0, 30)).words is None


def test_a_span_has_its_own_clock(tmp_path):
    store = make_store(tmp_path)
    speech = store.speech(Span(0, 30, 60))  # 2 s to 4 s
    assert len(speech.waveform) == 32_000
    assert speech.waveform[8000] == pytest.approx(0.5, abs=1e-3)
    assert [(word.text, round(word.start, 3)) for word in speech.words] == [
        ("two", 0.2),
        ("three", 0.7),
        ("one", 1.2),
        ("two", 1.7),
    ]


def test_who_does_not_train_has_no_id(tmp_path):
    recordings = [make_recording(f"t{i}", speaker="ada") for i in range(3)]
    recordings.append(make_recording("t3", speaker="zoe"))
    store = make_store(tmp_path, recordings)  # the last two are validation and test
    assert store.speaker_ids["ada"] == 1
    assert "zoe" not in store.speaker_ids


def test_a_spans_speech_asks_for_no_more_frames_than_it_has(tmp_path):
    """43 frames last 45,866.7 samples; one more sample would be covered by a 44th frame."""
    store = make_store(tmp_path)
    for frames in range(34, 150):
        speech = store.speech(Span(0, 0, frames))
        assert int(np.ceil(len(speech.waveform) / 16_000 * 15)) == frames
