"""Builds that are killed, resumed, and spread over processes give the same bytes."""

import contextlib
import functools
import json
import shutil

import numpy as np
import pytest

from cospeech.corpus.packing import pack_source
from cospeech.corpus.reading import packed_sources
from cospeech.corpus.recording import WindowList
from cospeech.corpus.source import Dropped, Source
from cospeech.corpus.splits import Span
from cospeech.corpus.store_writer import StoreWriter
from cospeech.errors import CospeechError
from cospeech.speech.speech import Speech, Word
from tests.corpora import make_recording


def read_two(first: int):
    """A source of two recordings, the second with a word of its own, and one thing left out."""
    yield make_recording(f"take{first}", seconds=4, seed=first)
    yield Dropped(
        f"take{first}-b", "it was too short", "short", windows={"pose": 2}, words=("um", "one")
    )
    words = (Word("hello", 0.1, 0.4), Word(f"word{first}", 0.5, 0.8))
    yield make_recording(f"take{first + 1}", speaker="ben", seconds=3, words=words, seed=first + 1)


def read_broken():
    raise CospeechError("no header in line 1")


def sources(count=4):
    return [Source(f"s{i}", functools.partial(read_two, 2 * i), ()) for i in range(count)]


def spans(writer):
    frames = writer.columns()["frames"]
    last = len(frames) - 1
    return {
        "train": [Span(i, 0, n) for i, n in enumerate(frames[:-2])],
        "val": [Span(last - 1, 0, frames[last - 1])],
        "test": [Span(last, 0, frames[last])],
    }


def build(path, packed):
    with StoreWriter(path, "made", {}, "f" * 64) as writer:
        for source in packed:
            writer.append(source)
        return writer.finish(spans(writer))


def contents(path):
    return {file.name: file.read_bytes() for file in sorted(path.iterdir())}


@pytest.fixture(scope="module")
def packed():
    return [pack_source(source, True) for source in sources()]


@pytest.fixture(scope="module")
def whole(packed, tmp_path_factory):
    return contents(build(tmp_path_factory.mktemp("whole") / "s", packed).path)


def test_processes_give_the_same_bytes_in_the_same_order(tmp_path, whole):
    several = packed_sources(sources(), True, workers=3)
    assert contents(build(tmp_path / "s", several).path) == whole


def test_a_killed_build_goes_on_with_the_first_source_not_noted(tmp_path, packed, whole):
    with (
        contextlib.suppress(KeyboardInterrupt),
        StoreWriter(tmp_path / "s", "made", {}, "f" * 64) as writer,
    ):
        writer.append(packed[0])
        writer.append(packed[1])
        raise KeyboardInterrupt
    assert not (tmp_path / "s").exists()
    with StoreWriter(tmp_path / "s", "made", {}, "f" * 64) as again:
        assert again.sources_done == ["s0", "s1"]
        for source in packed[2:]:
            again.append(source)
        assert contents(again.finish(spans(again)).path) == whole
    assert [path.name for path in tmp_path.iterdir()] == ["s"]


def test_what_a_build_killed_at_its_end_was_writing_is_no_part_of_the_store(
    tmp_path, packed, whole
):
    with StoreWriter(tmp_path / "s", "made", {}, "f" * 64) as writer:
        for source in packed:
            writer.append(source)
    (tmp_path / ".s.building" / ".manifest.json.0123abcd.part").write_text("{")
    with StoreWriter(tmp_path / "s", "made", {}, "f" * 64) as again:
        assert contents(again.finish(spans(again)).path) == whole


def test_a_build_killed_anywhere_resumes_to_the_same_bytes(tmp_path, packed, whole):
    """Files end where the kernel happened to have written to: journal and streams independently."""
    rng = np.random.default_rng(0)
    for attempt in range(40):
        path = tmp_path / f"s{attempt}"
        with StoreWriter(path, "made", {}, "f" * 64) as writer:
            for source in packed[:3]:
                writer.append(source)
        cut_off(path, rng)
        with StoreWriter(path, "made", {}, "f" * 64) as again:
            done = len(again.sources_done)
            assert done <= 3
            again.append(packed[done])
        cut_off(path, rng)
        with StoreWriter(path, "made", {}, "f" * 64) as again:
            done = len(again.sources_done)
            for source in packed[done:]:
                again.append(source)
            assert contents(again.finish(spans(again)).path) == whole
        shutil.rmtree(path)


def cut_off(path, rng):
    """What is left of some files when the machine dies; a line's end is where it hurts most."""
    for file in path.with_name(f".{path.name}.building").iterdir():
        if file.name != "build.json" and rng.random() < 0.4:
            data = file.read_bytes()
            kept = len(data) - 1 if rng.random() < 0.3 else rng.integers(len(data) + 1)
            file.write_bytes(data[: max(0, kept)])


def test_a_build_of_other_sources_is_not_continued(tmp_path, packed, whole):
    with StoreWriter(tmp_path / "s", "made", {}, "e" * 64) as other:
        other.append(packed[3])
    assert contents(build(tmp_path / "s", packed).path) == whole


def test_what_was_left_out_is_in_the_manifest(whole):
    skipped = json.loads(whole["manifest.json"])["skipped"]
    assert [item["id"] for item in skipped] == [f"take{i}-b" for i in (0, 2, 4, 6)]
    assert {item["kind"] for item in skipped} == {"short"}
    assert json.loads(whole["manifest.json"])["dropped_windows"] == {"pose": 8}


def test_a_source_that_cannot_be_read_is_noted_and_the_next_one_read(tmp_path):
    broken = Source("bad", read_broken, ())
    store = build(
        tmp_path / "s",
        packed_sources([sources()[0], broken, sources()[1]], True, workers=2),
    )
    (fault,) = [item for item in store.manifest["skipped"] if item["is_fault"]]
    assert (fault["id"], fault["kind"]) == ("bad", "unreadable")
    assert "no header" in fault["reason"]
    assert len(store.recordings) == 4


def test_word_ids_follow_the_order_of_recordings(tmp_path, packed):
    store = build(tmp_path / "s", packed)
    texts = ["one", "two", "three", "um", "hello", "word0", "word2", "word4", "word6"]
    assert store.vocabulary[4:] == texts
    assert [word.text for word in store.speech(Span(3, 0, 45)).words] == ["hello", "word2"]


def test_speakers_are_numbered_in_order_of_their_recordings(tmp_path):
    with StoreWriter(tmp_path / "s", "made", {}, "f") as writer:
        for name in ("zoe", "ada", "zoe", "ben", "cid"):
            writer.add(make_recording(f"{name}{writer.recording_count}", speaker=name))
        store = writer.finish(spans(writer))  # the last two validate and test
    assert store.facts()["speakers"] == ["zoe", "ada"]
    assert store.speaker_ids == {"zoe": 1, "ada": 2}


def test_words_of_a_recording_that_cannot_be_used_are_in_the_vocabulary():
    def read():
        recording = make_recording("bad", words=(Word("lost", 0.1, 0.3),))
        recording.motion.positions[3, 2, 1] = np.nan
        yield recording

    packed = pack_source(Source("bad", read, ()), True)
    assert packed.texts == ["lost"]
    assert packed.faults[0].reason.startswith("recording bad: NaN")


def test_lists_of_different_windows_are_two_corpora(tmp_path):
    def listed(name, frames):
        windows = WindowList(15, frames, 10, np.array([0]), np.array([0]))
        return type(make_recording(name))(**{**vars(make_recording(name)), "windows": windows})

    with StoreWriter(tmp_path / "s", "made", {}, "f") as writer:
        writer.add(listed("a", 42))
        with pytest.raises(CospeechError, match=r"b lists windows of another grid.*34.*42"):
            writer.add(listed("b", 34))


def test_a_word_in_two_spellings_is_one_word(tmp_path):
    words = (Word("Hello,", 0.1, 0.4), Word("hello", 0.5, 0.8), Word("--", 0.9, 1.0))
    with StoreWriter(tmp_path / "s", "made", {}, "f") as writer:
        for i in range(3):
            writer.add(make_recording(f"take{i}", words=words))
        store = writer.finish(spans(writer))
    assert store.vocabulary[4:] == ["hello"]
    assert store.words(0)[:, 2].tolist() == [4, 4]


def test_the_other_side_of_a_dialogue_is_kept_on_the_same_clock(tmp_path):
    def with_other(name):
        recording = make_recording(name)
        other = Speech(np.linspace(-1, 1, 160_000).astype("f4"), (Word("mhm", 2.5, 2.8),))
        return type(recording)(**{**vars(recording), "interlocutor": other})

    with StoreWriter(tmp_path / "s", "made", {}, "f") as writer:
        writer.add(with_other("a"))
        writer.add(make_recording("b"))
        writer.add(make_recording("c"))
        store = writer.finish(spans(writer))
    heard = store.interlocutor(Span(0, 30, 60))
    assert [(word.text, word.start) for word in heard.words] == [("mhm", 0.5)]
    assert heard.waveform[0] == pytest.approx(-1 + 2 * 32_000 / 159_999, abs=1e-4)
    assert store.interlocutor(Span(1, 0, 60)) is None


def test_two_dimensional_motion_keeps_its_width(tmp_path):
    def flat(name):
        recording = make_recording(name)
        motion = recording.motion
        return type(recording)(
            **{
                **vars(recording),
                "motion": type(motion)(motion.skeleton, 15.0, motion.positions[..., :2].copy()),
            }
        )

    with StoreWriter(tmp_path / "s", "made", {}, "f", upper_body=False) as writer:
        for name in "abc":
            writer.add(flat(name))
        store = writer.finish(spans(writer))
    assert (store.dimensions, store.has_upper_body) == (2, False)
    np.testing.assert_array_equal(
        store.motion(1).positions, make_recording("b").motion.positions[..., :2]
    )
    assert store.facts()["mean_direction"] == []


def test_published_windows_are_kept(tmp_path):
    def listed(name):
        windows = WindowList(
            15, 42, 10, np.array([0, 20]), np.array([0, 21_300]), {"motion": 2, "pose": 1}
        )
        return type(make_recording(name))(**{**vars(make_recording(name)), "windows": windows})

    with StoreWriter(tmp_path / "s", "made", {}, "f") as writer:
        for name in "abc":
            writer.add(listed(name))
        store = writer.finish(spans(writer))
    assert store.window_grid == {"fps": 15, "frames": 42, "stride": 10}
    assert store.read(1, "windows").tolist() == [[0, 0], [20, 21_300]]
    assert store.manifest["dropped_windows"] == {"motion": 6, "pose": 3}
