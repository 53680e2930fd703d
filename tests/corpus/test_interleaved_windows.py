"""Windows at 20 fps, against the embedded corpus's own frames."""

from dataclasses import replace

import numpy as np
import pytest

from cospeech.corpus.features.joints import UNLABELLED
from cospeech.corpus.features.positions import evaluation_frames
from cospeech.corpus.recording import Recording
from cospeech.corpus.splits import SPLITS, Span
from cospeech.corpus.store_writer import StoreWriter
from cospeech.corpus.synthetic import synthesise
from cospeech.corpus.windows import WindowDataset, WindowSpec
from cospeech.errors import ConfigError, CospeechError
from cospeech.formats.uci_phases import UCI_SKELETON
from cospeech.motion.gesture_joints import gesture_joints
from cospeech.motion.motion import Motion
from cospeech.motion.velocities import body_positions
from cospeech.speech.feature_sets.opensmile import opensmile_features
from cospeech.speech.speech import Speech
from tests.corpora import make_recording, make_store
from tests.multi_adversary_runs import labelled_recording

SPEC = WindowSpec(fps=20, frames=100, seed_frames=0, stride=50, run=2, interleaved=True)
ALL = frozenset({"joints", "acoustics", "phases", "positions", "speakers"})


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    recordings = list(synthesise(3, seed=5, speakers=2))
    with StoreWriter(tmp_path_factory.mktemp("s") / "s", "s", {}, "0") as writer:
        for recording in recordings:
            writer.add(recording)
        frames = writer.columns()["frames"]
        spans = {
            "train": [Span(0, 0, frames[0])],
            "val": [Span(1, 0, frames[1] // 2)],
            "test": [Span(1, frames[1] // 2, frames[1])],
        }
        return writer.finish(spans)


def test_a_run_is_consecutive_windows_of_one_interleave(store):
    dataset = WindowDataset(store, "train", SPEC, ALL)
    motion = store.motion(0)
    joints = gesture_joints(motion.skeleton)
    positions = body_positions(motion, joints.body)
    sound = store.read(0, "audio")[:, 0] / np.float32(32767)
    features = opensmile_features(sound.astype(np.float32))
    labels = store.phases(0)
    per_interleave = len(motion) // 3
    runs_of_first = (per_interleave + (len(motion) % 3 > 0) - 200) // 50 + 1
    for run in (0, 3, runs_of_first, len(dataset) - 1):
        batch = dataset.batch([run])
        start = dataset.describe(2 * run)["start_s"]
        first = round(start * 60)
        native = first + 3 * np.arange(200)
        assert batch.joints.shape == (2, 100, 21, 3)
        np.testing.assert_array_equal(batch.joints.reshape(200, 21, 3), positions[native])
        np.testing.assert_array_equal(batch.phases.reshape(200), labels[native])
        frames = np.rint(native / 60 * 100).astype(int).clip(max=len(features) - 1)
        np.testing.assert_allclose(batch.acoustics.reshape(200, 27), features[frames], atol=1e-4)
        assert batch.speakers.tolist() == [1, 1]
    # three interleaves: windows begin at every frame of the 60 fps motion, modulo 3
    firsts = {round(start * 60) % 3 for start in dataset.starts_s[::2]}
    assert firsts == {0, 1, 2}


def test_the_upper_body_covers_the_same_time_at_the_evaluation_rate(store):
    spec = WindowSpec(fps=20, frames=100, seed_frames=0, stride=100)
    dataset = WindowDataset(store, "val", spec, frozenset({"positions"}))
    assert evaluation_frames(100, 20) == 75  # 99 / 20 s hold floor(74.25) + 1 frames of 1 / 15 s
    batch = dataset.batch([0, 1])
    np.testing.assert_array_equal(batch.positions[0], store.upper_body(1, 0, 75))
    np.testing.assert_array_equal(batch.positions[1], store.upper_body(1, 75, 150))


def test_between_stored_frames_the_upper_body_is_interpolated(store):
    dataset = WindowDataset(store, "train", SPEC, frozenset({"positions"}))
    run = next(i for i, start in enumerate(dataset.starts_s[::2]) if round(start * 60) == 1)
    upper = store.upper_body(0, 0, 76)
    expected = 0.75 * upper[:75] + 0.25 * upper[1:76]  # 1 / 60 s is a quarter of a frame
    np.testing.assert_allclose(dataset.batch([run]).positions[0], expected, atol=1e-6)


def test_windows_stay_inside_their_split(store):
    for split in ("val", "test"):
        dataset = WindowDataset(store, split, SPEC, frozenset({"joints"}))
        (span,) = store.splits[split]
        starts = dataset.starts_s[::2]
        assert starts.min() >= span.start / 15 - 1e-9
        assert (starts + 199 / 20).max() < span.stop / 15 + 1 / 20


def test_too_short_a_split_says_what_to_change(store):
    long = WindowSpec(fps=20, frames=100, seed_frames=0, stride=50, run=40, interleaved=True)
    with pytest.raises(
        CospeechError, match=r"no val recording.*40 windows in a row \(200 s\)"
    ) as e:
        WindowDataset(store, "val", long, ALL)
    assert "model.run=1" in e.value.hint


def test_what_the_corpus_lacks_is_named(tmp_path):
    store = make_store(tmp_path, [make_recording(f"t{i}", seconds=12) for i in range(3)])
    with pytest.raises(ConfigError, match=r"needs gesture phases .*\(train\) has none") as caught:
        WindowDataset(store, "train", SPEC, ALL)
    assert "model.classifier=FILE" in caught.value.hint
    windows = WindowDataset(store, "train", SPEC, ALL - {"phases"})
    assert windows.batch([0]).joints.shape == (2, 100, 8, 3)  # no fingers, two spine joints


def test_recordings_without_phases_are_kept_where_wanted(tmp_path):
    takes = [labelled_recording(f"t{i}", i, labelled=i % 2 == 0) for i in range(6)]
    store = make_store(tmp_path, takes)
    labelled = [recording.has_phases for recording in store.recordings]
    for split in SPLITS:
        recordings = [span.recording for span in store.splits[split]]
        dataset = WindowDataset(store, split, replace(SPEC, unlabelled=True), ALL)
        assert set(dataset.recordings) == set(recordings)
        known = dataset.batch(range(len(dataset))).phases.numpy() != UNLABELLED
        assert (known == np.array(labelled)[dataset.recordings][:, None]).all()
    strict = WindowDataset(store, "train", SPEC, ALL)
    assert all(labelled[recording] for recording in set(strict.recordings))


def test_recordings_without_sound_are_left_out(tmp_path):
    recordings = [make_recording(f"t{i}", seconds=12) for i in range(4)]
    recordings[0] = type(recordings[0])(
        **{**vars(recordings[0]), "speech": Speech(np.zeros(0, dtype=np.float32), None)}
    )
    store = make_store(tmp_path, recordings)
    assert {len(spans) for spans in store.splits.values()} == {1, 2}
    assert SPLITS[0] == "train"
    windows = WindowDataset(store, "train", SPEC, frozenset({"acoustics"}))
    assert set(windows.recordings) == {1}


@pytest.mark.parametrize(
    ("fps", "interleaves"), [(15.0, 1), (20.0, 1), (30.0, 2), (60.0, 3), (120.0, 6)]
)
def test_other_joints_at_other_rates(tmp_path, fps, interleaves):
    """The body glides along z; the left wrist's x is t^2 / 2 m more than the spine's."""
    frames = round(8 * fps)
    times = np.arange(frames) / fps
    positions = np.zeros((frames, len(UCI_SKELETON), 3), dtype=np.float32)
    positions[:, :, 2] = 0.5 * times[:, None]
    positions[:, UCI_SKELETON.index["left_wrist"], 0] += 0.5 * times**2
    labels = (np.arange(frames) // 30 % 9).astype(np.int8)
    recording = Recording(
        "one",
        "ada",
        Speech(np.zeros(0, dtype=np.float32), None),
        Motion(UCI_SKELETON, fps, positions),
        phases=labels,
    )
    with StoreWriter(tmp_path / "s", "s", {}, "0", upper_body=False) as writer:
        writer.add(recording)
        (count,) = writer.columns()["frames"]
        store = writer.finish({"train": [Span(0, 0, count)], "val": [], "test": []})
    spec = WindowSpec(fps=20, frames=50, seed_frames=0, stride=50, interleaved=True)
    needs = frozenset({"wrists", "phases"})
    dataset = WindowDataset(store, "train", spec, needs)
    starts = dataset.starts_s
    assert len(np.unique(np.round(starts % 0.05, 6) % 0.05)) == interleaves
    for window, start in enumerate(starts):
        batch = dataset.batch([window])
        times = start + np.arange(50) / 20
        left, right = batch.wrists[0].numpy().transpose(1, 0, 2)
        # Linear interpolation of t^2 / 2 between two frames is off by at most (1 / fps)^2 / 8.
        np.testing.assert_allclose(left[:, 0], times**2 / 2, atol=1 / fps**2 / 8 + 1e-5)
        np.testing.assert_allclose(left[:, 1:], 0, atol=1e-6)  # the spine's glide is gone
        np.testing.assert_allclose(right, 0, atol=1e-6)
        native = np.rint(times * fps).astype(int).clip(max=frames - 1)
        np.testing.assert_array_equal(batch.phases[0], labels[native])
