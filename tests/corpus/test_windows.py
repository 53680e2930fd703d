import numpy as np
import pytest

from cospeech.corpus.windows import EpochOrder, WindowDataset, WindowLoader, WindowSpec
from cospeech.errors import ConfigError, CospeechError
from tests.corpora import make_recording, make_store

SPEC = WindowSpec(fps=15, frames=34, seed_frames=4, stride=10)
ALL = frozenset({"positions", "audio", "words", "speakers"})


def test_windows_stay_inside_recordings(tmp_path):
    store = make_store(tmp_path)
    dataset = WindowDataset(store, "train", SPEC, ALL)
    # floor((150 - 34) / 10) + 1 windows in each of four recordings of 150 frames
    assert len(dataset) == 4 * 12
    assert dataset.windows[:, 1].max() + SPEC.frames <= 150


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


def test_too_few_windows_for_a_batch_says_what_to_set(tmp_path):
    dataset = WindowDataset(make_store(tmp_path), "val", SPEC, ALL)
    with pytest.raises(ConfigError, match="12 val windows") as caught:
        WindowLoader(dataset, 128, seed=0, shuffle=True, drop_last=True)
    assert "training.batch_size=12" in caught.value.hint
