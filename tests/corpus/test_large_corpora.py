"""What a corpus of very many short recordings needs: everything at once, with the same numbers."""

import dataclasses

import numpy as np
import pytest
import torch

from cospeech.corpus.manifest import read_manifest, write_manifest
from cospeech.corpus.recording import WindowList
from cospeech.corpus.split_facts import FRAMES_AT_ONCE, upper_body_statistics
from cospeech.corpus.splits import SPLITS, Span
from cospeech.corpus.store import SCHEMA_VERSION
from cospeech.corpus.store_writer import StoreWriter
from cospeech.corpus.windows import WindowDataset, WindowSpec
from cospeech.evaluation import real_windows
from cospeech.motion.codecs import direction_vectors
from cospeech.motion.upper_body import UPPER_BODY
from tests.corpora import make_recording

SPEC = WindowSpec(fps=15, frames=34, seed_frames=4, stride=10)


def test_statistics_of_many_spans_are_those_of_all_their_frames():
    rng = np.random.default_rng(0)
    lengths = rng.integers(1, 400, 60)
    first = np.cumsum(lengths) - lengths
    upper_body = rng.normal(size=(lengths.sum(), 10, 3)).astype(np.float32)
    upper_body[:50, 1] = upper_body[:50, 0]  # a bone without length
    spans = [Span(int(i), 0, int(lengths[i])) for i in range(0, 60, 2)]
    spans.append(Span(1, 3, int(lengths[1])))
    frames = np.concatenate([upper_body[first[s.recording] :][s.start : s.stop] for s in spans])
    assert len(frames) > 2 * FRAMES_AT_ONCE
    found = upper_body_statistics(upper_body, first, spans)
    mean = direction_vectors(torch.from_numpy(frames.astype(float))).mean(0).reshape(27)
    np.testing.assert_allclose(found["mean_direction"], mean, atol=1e-12)
    parents = list(UPPER_BODY.parents[1:])
    bones = np.linalg.norm((frames[:, 1:] - frames[:, parents]).astype(float), axis=-1)
    np.testing.assert_allclose(found["bone_lengths"], bones.mean(0), atol=1e-6)


@pytest.fixture(scope="module")
def mixed(tmp_path_factory):
    """Recordings of 40 to 160 frames, every other one with a list of windows."""
    rng = np.random.default_rng(1)
    with StoreWriter(tmp_path_factory.mktemp("store") / "s", "s", {}, "0") as writer:
        for i in range(20):
            recording = make_recording(f"t{i}", seconds=(40 + 6 * i) / 15, seed=i)
            starts = np.flatnonzero(rng.random(40 + 6 * i - 33) < 0.2)
            starts = starts if len(starts) else np.array([0])
            listed = WindowList(15.0, 42, 10, starts, 1000 * starts)
            writer.add(dataclasses.replace(recording, windows=listed if i % 2 else None))
        frames = writer.columns()["frames"]
        train = [Span(i, 3, frames[i] - 5) for i in (4, 3, 19, 0, 1, 12, 2)]
        return writer.finish({"train": train, "val": [Span(5, 0, 60)], "test": [Span(6, 0, 60)]})


def test_windows_are_those_of_the_plain_loop(mixed):
    """Listed ones where there is a list, else every tenth frame; never outside the span."""
    expected = []
    for span in mixed.splits["train"]:
        if span.recording % 2:
            rows = mixed.read(span.recording, "windows").tolist()
        else:
            starts = range(span.start, span.stop, 10)
            rows = [[start, round(start / 15 * 16_000)] for start in starts]
        expected += [
            [span.recording, *row]
            for row in rows
            if row[0] >= span.start and row[0] + 34 <= span.stop
        ]
    windows = WindowDataset(mixed, "train", SPEC, frozenset({"positions"}))
    starts = np.rint(windows.starts_s * 15).astype(int)
    found = np.stack([windows.recordings, starts, windows.samples], axis=1)
    assert found.tolist() == expected
    assert {row[0] for row in expected} == {2, 3, 4, 12, 19}  # too little of 0 and 1 is left


def store_of(folder, seconds):
    with StoreWriter(folder / "s", "s", {}, "0") as writer:
        for i in range(6):
            writer.add(make_recording(f"t{i}", f"speaker{i // 2}", seconds, seed=i))
        frames = writer.columns()["frames"]
        spans = [Span(i, 0, n) for i, n in enumerate(frames)]
        return writer.finish({"train": spans, "val": spans[:1], "test": spans[1:]})


def test_samples_of_one_window_are_grouped_by_speaker(tmp_path):
    """Samples cut from one video overlap: they are not independent recordings."""
    store = store_of(tmp_path, seconds=42 / 15)
    _, groups = real_windows(store, store.splits["test"])
    assert groups == ["speaker0", "speaker1", "speaker1", "speaker2", "speaker2"]


def test_longer_recordings_stand_for_themselves(tmp_path):
    store = store_of(tmp_path, seconds=44 / 15)
    _, groups = real_windows(store, store.splits["test"])
    assert groups == [f"t{i}" for i in (1, 1, 2, 2, 3, 3, 4, 4, 5, 5)]


def test_the_splits_of_very_many_recordings_are_read(mixed, tmp_path):
    """Three spans of each of 200,000: more lists than any other file may hold."""
    splits = dict.fromkeys(SPLITS, [[0, 0, 20]] * 200_000)
    (tmp_path / "vocabulary.json").write_text("[]")
    write_manifest(tmp_path, mixed.manifest | {"splits": splits})
    assert read_manifest(tmp_path, SCHEMA_VERSION)["splits"] == splits
