import numpy as np
import pytest

from cospeech.corpus.recording import WindowList
from cospeech.corpus.splits import SPLITS, Span
from cospeech.corpus.store_writer import StoreWriter
from cospeech.corpus.window_loader import EpochOrder, WindowLoader
from cospeech.corpus.windows import WindowDataset, WindowSpec
from cospeech.errors import ConfigError, CospeechError
from cospeech.motion.motion import Motion
from cospeech.speech.speech import Speech, Word
from cospeech.speech.vocabulary import frame_aligned_words
from tests.corpora import make_recording, make_store

SPEC = WindowSpec(fps=15, frames=34, seed_frames=4, stride=10)
ALL = frozenset({"positions", "audio", "words", "speakers"})


def test_windows_stay_inside_recordings(tmp_path):
    store = make_store(tmp_path)
    dataset = WindowDataset(store, "train", SPEC, ALL)
    # floor((150 - 34) / 10) + 1 windows in each of four recordings of 150 frames
    assert len(dataset) == 4 * 12
    assert dataset.firsts.max() + SPEC.frames <= 150


def test_a_batch_holds_what_the_recording_holds(tmp_path):
    store = make_store(tmp_path)
    dataset = WindowDataset(store, "train", SPEC, ALL)
    batch = dataset.batch([0, 13])
    np.testing.assert_array_equal(batch.positions[0], store.upper_body(0, 0, 34))
    np.testing.assert_array_equal(batch.positions[1], store.upper_body(1, 10, 44))
    assert batch.audio.shape == (2, 36_267)
    # sample i of the made audio is i / 16000 % 1; the second window starts at 10 / 15 s
    assert batch.audio[1, 0].item() == pytest.approx(10 / 15, abs=1e-4)
    assert batch.speakers.tolist() == [1, 2]
    # "one" at 0.2 s falls on frame floor(0.2 * 15) = 3 of the first window
    assert dataset.store.vocabulary[batch.words[0, 3]] == "one"
    assert batch.words[0, :3].tolist() == [0, 0, 0]


def test_only_what_is_needed_is_read(tmp_path):
    dataset = WindowDataset(make_store(tmp_path), "val", SPEC, frozenset({"positions"}))
    batch = dataset.batch([0])
    assert batch.audio is None
    with pytest.raises(KeyError, match="audio"):
        batch.require("audio")


def test_a_field_that_does_not_exist_is_named(tmp_path):
    with pytest.raises(ConfigError, match="facial_hair"):
        WindowDataset(make_store(tmp_path), "train", SPEC, frozenset({"facial_hair"}))


def test_a_split_too_short_for_a_window_says_so(tmp_path):
    recordings = [make_recording(f"t{i}") for i in range(2)] + [make_recording("t2", seconds=2.0)]
    store = make_store(tmp_path, recordings)
    with pytest.raises(CospeechError, match=r"no test recording holds a window of 34 frames"):
        WindowDataset(store, "test", SPEC, ALL)


def test_an_epoch_is_a_permutation_that_depends_on_seed_and_epoch_alone():
    order = EpochOrder(10, 3, seed=1, shuffle=True, drop_last=False)
    order.set_epoch(4)
    first = np.concatenate(list(order))
    assert sorted(first) == list(range(10))
    again = EpochOrder(10, 3, seed=1, shuffle=True, drop_last=False)
    again.set_epoch(4)
    np.testing.assert_array_equal(np.concatenate(list(again)), first)
    again.set_epoch(5)
    assert not np.array_equal(np.concatenate(list(again)), first)


def test_a_loader_continues_where_its_state_says(tmp_path):
    dataset = WindowDataset(make_store(tmp_path), "train", SPEC, frozenset({"positions"}))
    loader = WindowLoader(dataset, 8, seed=0, shuffle=True, drop_last=True)
    loader.sampler.set_epoch(2)
    straight = [batch.window_ids.tolist() for batch in loader]
    assert len(straight) == len(loader) == 6
    stopped = WindowLoader(dataset, 8, seed=0, shuffle=True, drop_last=True)
    stopped.sampler.set_epoch(2)
    batches = iter(stopped)
    head = [next(batches).window_ids.tolist() for _ in range(2)]
    resumed = WindowLoader(dataset, 8, seed=0, shuffle=True, drop_last=True)
    resumed.load_state_dict(stopped.state_dict())
    resumed.sampler.set_epoch(2)
    assert head + [batch.window_ids.tolist() for batch in resumed] == straight
    # and the epoch after starts at its beginning
    resumed.sampler.set_epoch(3)
    assert len(list(resumed)) == 6


def test_a_state_from_an_epoch_cut_short_does_not_leak_into_the_next(tmp_path):
    dataset = WindowDataset(make_store(tmp_path), "train", SPEC, frozenset({"positions"}))
    loader = WindowLoader(dataset, 8, seed=0, shuffle=True, drop_last=True)
    loader.load_state_dict({"epoch": 0, "next_batch": 2})
    loader.sampler.set_epoch(1)
    assert len(list(loader)) == 6


def test_too_few_windows_for_a_batch_make_one_batch(tmp_path, caplog):
    dataset = WindowDataset(make_store(tmp_path), "val", SPEC, ALL)
    loader = WindowLoader(dataset, 128, seed=0, shuffle=True, drop_last=True)
    assert "12 val windows don't fill one batch of 128" in caplog.text
    (batch,) = list(loader)
    assert sorted(batch.window_ids.tolist()) == list(range(12))
    assert len(loader) == 1


def changed(recording, **values):
    return type(recording)(**{**vars(recording), **values})


def store_of(folder, recordings, upper_body=True):
    with StoreWriter(folder / "s", "s", {}, "0", upper_body=upper_body) as writer:
        for recording in recordings:
            writer.add(recording)
        frames = writer.columns()["frames"]
        spans = {split: [Span(i, 0, frames[i])] for i, split in enumerate(SPLITS)}
        spans["train"] += [Span(i, 0, frames[i]) for i in range(3, len(frames))]
        return writer.finish(spans)


def test_a_published_list_decides_the_windows_it_fits(tmp_path):
    windows = WindowList(15.0, 42, 10, np.array([0, 30, 50]), np.array([0, 31_990, 53_320]))
    store = store_of(tmp_path, [changed(make_recording(f"t{i}"), windows=windows) for i in "abc"])
    dataset = WindowDataset(store, "train", SPEC, ALL)
    assert dataset.recordings.tolist() == [0, 0, 0]
    assert dataset.firsts.tolist() == [0, 30, 50]
    assert dataset.samples.tolist() == [0, 31_990, 53_320]
    # audio comes from where the list says, not from 50 / 15 s = 53,333
    assert dataset.batch([2]).audio[0, 0].item() == pytest.approx(53_320 / 16_000 % 1, abs=1e-4)
    # the list was made for 42 frames every 10: it says nothing of longer windows or other strides
    every_five = WindowDataset(store, "train", WindowSpec(15, 34, 4, 5), ALL)
    assert len(every_five) == (150 - 34) // 5 + 1
    longer = WindowDataset(store, "train", WindowSpec(15, 60, 4, 10), ALL)
    assert len(longer) == (150 - 60) // 10 + 1


def test_words_of_a_batch_are_those_of_the_plain_loop(tmp_path):
    """Against `frame_aligned_words`, window by window, on words that overlap and begin early."""
    rng = np.random.default_rng(3)
    recordings = []
    for i in range(6):
        starts = np.sort(rng.uniform(-0.5, 9.8, 60)).round(2)
        words = tuple(
            Word(f"w{rng.integers(30)}", float(s), float(s + rng.exponential(0.6))) for s in starts
        )
        recordings.append(make_recording(f"t{i}", words=words if i != 4 else ()))
    store = store_of(tmp_path, recordings)
    dataset = WindowDataset(store, "train", WindowSpec(15, 34, 4, 3), frozenset({"words"}))
    order = rng.permutation(len(dataset))
    batch = dataset.batch(order).words.numpy()
    for row, window in zip(batch, order, strict=True):
        begin = dataset.firsts[window] / 15
        words = store.words(int(dataset.recordings[window]))
        inside = words[(words[:, 0] < begin + 34 / 15) & (words[:, 1] > begin)]
        expected = frame_aligned_words(inside[:, 0], inside[:, 2].astype(int), begin, 34, 15)
        np.testing.assert_array_equal(row, expected)
    assert (batch > 0).sum() > 1000


def test_a_word_that_ends_as_the_window_begins_is_not_in_it(tmp_path):
    words = (Word("early", 0.2, 2.0), Word("over", 1.0, 2.0 + 1e-9))
    store = make_store(tmp_path, [make_recording(f"t{i}", words=words) for i in range(3)])
    dataset = WindowDataset(store, "train", WindowSpec(15, 34, 4, 30), frozenset({"words"}))
    assert dataset.firsts[1] == 30  # two seconds
    row = dataset.batch([1]).words[0]
    assert [store.vocabulary[i] for i in row[row > 0]] == ["over"]


def test_recordings_without_sound_are_left_out_where_sound_is_needed(tmp_path):
    silent = Speech(np.zeros(0, dtype=np.float32), None)
    recordings = [make_recording(f"t{i}") for i in range(5)]
    recordings[0] = changed(recordings[0], speech=silent)
    store = store_of(tmp_path, recordings)
    assert set(WindowDataset(store, "train", SPEC, ALL).recordings) == {3, 4}
    everything = WindowDataset(store, "train", SPEC, frozenset({"positions"}))
    assert set(everything.recordings) == {0, 3, 4}


def test_a_corpus_without_sound_says_so_at_the_start(tmp_path):
    silent = Speech(np.zeros(0, dtype=np.float32), None)
    store = store_of(tmp_path, [changed(make_recording(f"t{i}"), speech=silent) for i in range(3)])
    with pytest.raises(
        ConfigError, match="no recording has sound, which is needed for train windows"
    ):
        WindowDataset(store, "train", SPEC, ALL)


def test_keypoints_of_a_picture_are_refused_where_positions_are_needed(tmp_path):
    recordings = []
    for i in range(3):
        motion = make_recording(f"t{i}").motion
        flat = Motion(motion.skeleton, 15.0, motion.positions[..., :2].copy())
        recordings.append(changed(make_recording(f"t{i}"), motion=flat))
    store = store_of(tmp_path, recordings, upper_body=False)
    with pytest.raises(ConfigError, match=r"needs 3-D.*field positions") as caught:
        WindowDataset(store, "train", SPEC, ALL)
    assert "2-D keypoints" in caught.value.hint
    assert len(WindowDataset(store, "train", SPEC, frozenset({"words"}))) == 12
