"""Pairs of real and matched windows on small corpora."""

import json
import logging
from dataclasses import replace

import numpy as np
import pytest
import torch

from cospeech.corpus.window_loader import WindowLoader
from cospeech.errors import ConfigError, CospeechError
from cospeech.matching.features import MatchingSpec
from cospeech.matching.fitting import fit_database
from cospeech.matching.matching import Clip, match
from cospeech.matching.seams import blended
from cospeech.matching.search import MatchingSearch
from cospeech.matching.tracks import MatchingTracks
from cospeech.methods.motion_matching.refinement import pairing
from cospeech.methods.motion_matching.refinement.pair_windows import (
    PairWindows,
    open_pair_windows,
)
from cospeech.methods.motion_matching.refinement.pairing import (
    cut_windows,
    heard,
    make_pairs,
    neighbours,
)
from cospeech.methods.motion_matching.refinement.pairs import PairSettings
from cospeech.speech.feature_sets.sphinx import sphinx_features, with_slopes
from tests.corpora import make_recording, make_store
from tests.matching.databases import make_database

SPEC = MatchingSpec(chunk_frames=32, true_future=True)
ALL = frozenset({"poses", "matched", "cepstra", "positions", "speakers"})
SETTINGS = PairSettings(frames=32, stride=5, closed_frames=32)


def talk(name, seed, seconds=20.0, speaker="ada"):
    """Noise whose loudness changes every tenth of a second."""
    recording = make_recording(name, speaker, seconds, seed=seed)
    rng = np.random.default_rng(seed)
    waveform = recording.speech.waveform
    loudness = rng.uniform(0.02, 0.5, -(-len(waveform) // 1600)).repeat(1600)[: len(waveform)]
    waveform[:] = (rng.uniform(-1, 1, len(waveform)) * loudness).astype(np.float32)
    return recording


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    names = ("ada", "ben", "ada", "ben", "ada", "ben")
    recordings = [talk(f"take{i}", i, 20 + i, name) for i, name in enumerate(names)]
    return make_store(tmp_path_factory.mktemp("pairs"), recordings)


@pytest.fixture(scope="module")
def database(store):
    return fit_database(store, SPEC)


@pytest.fixture(scope="module")
def search(database):
    return MatchingSearch(database, threads=1)


@pytest.fixture(scope="module")
def reader(store):
    return MatchingTracks(store, "train", 15.0)


@pytest.fixture(scope="module")
def tracks(reader):
    return list(reader)


@pytest.fixture(scope="module")
def pairs(tracks, search, tmp_path_factory):
    return make_pairs(tracks, search, SETTINGS, 0, tmp_path_factory.mktemp("made"))


def test_neighbours_by_hand():
    database = make_database(20)  # sequence m has frames 64 m to 64 m + 63 of recording 0

    def around(frame, reach, recording=0):
        return neighbours(database, recording, frame / 15, 64, reach).tolist()

    assert around(640, 64) == [9, 10, 11]
    assert around(640, 0) == [10]
    assert around(641, 0) == [10, 11]
    assert around(639, 0) == [9, 10]
    # Frames 645 to 708: 64 before is in sequence 9, 64 after, frame 772, is in 12.
    assert around(645, 64) == [9, 10, 11, 12]
    assert around(0, 64) == [0, 1]
    assert around(640, 64, recording=1) == []


def test_windows_stay_in_their_tracks(tracks):
    windows = cut_windows(tracks, SETTINGS)
    # Takes of 300, 315, 330 and 345 frames.
    starts = [range(0, frames - 32 + 1, 5) for frames in (300, 315, 330, 345)]
    assert windows.tolist() == [[i, start] for i in range(4) for start in starts[i]]
    alone = cut_windows(tracks, SETTINGS.for_judging())
    assert alone[:10].tolist() == [[0, start] for start in range(0, 288, 32)] + [[1, 0]]


def test_a_window_in_the_middle_hears_what_a_longer_speech_hears(store, tracks, database):
    whole = database.audio_queries(store.audio(0, 0, 320_000))
    for first in (0, 100, 268):  # the last one ends the track
        np.testing.assert_allclose(
            heard(tracks[0], first, 32, database), whole[first : first + 32], atol=1e-4
        )


def test_as_published_a_window_hears_nothing_after_itself(store, tracks):
    database = fit_database(store, replace(SPEC, true_future=False))
    features = heard(tracks[0], 100, 32, database)
    raw = features * database.audio_normalisation.deviation + database.audio_normalisation.mean
    static = tracks[0].audio
    np.testing.assert_allclose(raw[0, :14], static[100], atol=1e-3)
    np.testing.assert_allclose(raw[17, -14:], static[131], atol=1e-3)
    np.testing.assert_allclose(raw[18, -14:], 0, atol=1e-3)  # frame 132 is past the end
    np.testing.assert_allclose(raw[31, 14:], 0, atol=1e-3)


def test_a_pair_is_the_search_with_the_windows_own_sound(tracks, search, tmp_path):
    settings = replace(SETTINGS, from_mean_pose=True, stride=50)
    pairs = make_pairs(tracks, search, settings, 3, tmp_path)
    assert pairs.pointers.shape == (len(pairs), 4, 2)
    assert len(set(pairs.ks.tolist())) > 3
    for (track, first), k, pointers in zip(pairs.windows, pairs.ks, pairs.pointers, strict=True):
        recording = tracks[track].span.recording
        closed = neighbours(search.database, recording, first / 15, 32, 32)
        audio = heard(tracks[track], first, 32, search.database)
        clip = Clip(audio, k=int(k), closed=closed.tolist(), from_mean_pose=True)
        alone = match(search, clip)
        assert pointers.tolist() == np.stack([alone.sequences, alone.frames], axis=1).tolist()


def own_share(pairs, tracks, database):
    own = []
    for (track, first), pointers in zip(pairs.windows, pairs.pointers, strict=True):
        closed = neighbours(database, tracks[track].span.recording, first / 15, 32, 32)
        own.append(np.isin(pointers[:, 0], closed).mean())
    return np.mean(own)


def test_no_window_finds_its_own_neighbourhood(tracks, database, pairs, tmp_path):
    assert own_share(pairs, tracks, database) == 0
    # A search by sound finds a window's own, whose distance is 0, unless it is closed.
    search = MatchingSearch(database, preselect="audio", threads=1)
    settings = replace(SETTINGS, k=1, from_mean_pose=True)
    closing = make_pairs(tracks, search, settings, 0, tmp_path)
    free = make_pairs(tracks, search, replace(settings, closed_frames=None), 0, tmp_path)
    assert own_share(closing, tracks, database) == 0
    assert free.own_hits is None
    # All windows are measured, and without draws they find the same again.
    assert closing.own_hits == pytest.approx(own_share(free, tracks, database))
    # 3 or 4 of the 36 sequences are near: chance would give about a tenth.
    assert closing.own_hits > 0.2


def test_the_share_is_measured_on_a_sample(tracks, search, tmp_path, monkeypatch):
    monkeypatch.setattr(pairing, "MEASURED_WINDOWS", 3)
    settings = replace(SETTINGS, stride=40)
    sample = make_pairs(tracks, search, settings, 0, tmp_path)
    assert sample.own_hits * 12 == pytest.approx(round(sample.own_hits * 12))  # of 3 x 4 steps


def test_windows_with_nothing_left_are_left_out(search, tracks, tmp_path, caplog):
    """A speaker with one recording, whose windows in its middle are near to all of it."""
    names = ["ada", "ben", "nobody", "ben"]
    settings = replace(SETTINGS, closed_frames=150)
    database = search.database
    lonely = replace(database, speakers=np.where(database.recordings == 0, 0, 1))
    lonely = replace(lonely, speaker_names=("ada", "ben"))
    with caplog.at_level(logging.WARNING):
        pairs = make_pairs(tracks, MatchingSearch(lonely, threads=1), settings, 0, tmp_path, names)
    left = {int(first) for track, first in pairs.windows if track == 0}
    sequences = [range(start, start + 32) for start in range(0, 288, 32)]
    expected = {
        first
        for first in range(0, 269, 5)
        if any(not (s[-1] >= first - 150 and s[0] <= first + 31 + 150) for s in sequences)
    }
    assert 0 < len(expected) < 54
    assert left == expected
    assert f"{54 - len(expected)} of 234 windows are left out" in caplog.text


def test_half_of_the_windows_take_the_best_candidate(tracks, search, tmp_path):
    settings = PairSettings(frames=8, stride=1, closed_frames=None)
    pairs = make_pairs(tracks, search, settings, 0, tmp_path)
    assert len(pairs) == 293 + 308 + 323 + 338
    counts = np.bincount(pairs.ks, minlength=16)
    deviation = np.sqrt(len(pairs) / 4)
    assert abs(counts[1] - len(pairs) / 2) < 4 * deviation
    others = counts[2:]
    expected = len(pairs) / 28
    assert len(others) == 14
    assert ((others - expected) ** 2 / expected).sum() < 34.5  # chi-squared, 13 degrees, 0.1 %
    only = make_pairs(tracks, search, replace(settings, stride=50, k=1), 0, tmp_path)
    assert set(only.ks.tolist()) == {1}


def test_the_seed_decides_and_not_the_chunk(tracks, search, tmp_path):
    settings = replace(SETTINGS, stride=20)
    one, other = (
        make_pairs(tracks, search, settings, 0, tmp_path / str(chunk), chunk=chunk)
        for chunk in (7, 1000)
    )
    for name in ("windows", "ks", "pointers"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert one.own_hits == other.own_hits
    again = make_pairs(tracks, search, settings, 1, tmp_path)
    assert (again.ks != one.ks).any()
    assert (again.pointers != one.pointers).any()


def test_speakers_keep_to_themselves(tracks, search, tmp_path):
    names = ["ada", "ben", "ada", "ben"]
    settings = replace(SETTINGS, stride=40)
    pairs = make_pairs(tracks, search, settings, 0, tmp_path, speakers=names)
    found = np.array(names)[search.database.recordings[pairs.pointers[..., 0]]]
    assert (found == np.array(names)[pairs.windows[:, :1]]).all()


def test_what_was_made_is_opened(tracks, search, tmp_path, monkeypatch):
    settings = replace(SETTINGS, stride=40)
    first = make_pairs(tracks, search, settings, 0, tmp_path)
    assert isinstance(first.pointers, np.memmap)
    (folder,) = tmp_path.iterdir()

    def refuse(*_args):
        raise AssertionError("searched again")

    monkeypatch.setattr(pairing, "match_together", refuse)
    again = make_pairs(tracks, search, settings, 0, tmp_path)
    np.testing.assert_array_equal(again.pointers, first.pointers)
    assert again.own_hits == first.own_hits
    for other in (
        lambda: make_pairs(tracks, search, settings, 1, tmp_path),
        lambda: make_pairs(tracks[:3], search, settings, 0, tmp_path),
        lambda: make_pairs(tracks, search, replace(settings, stride=41), 0, tmp_path),
        lambda: make_pairs(
            tracks, MatchingSearch(search.database, 8, "audio", threads=1), settings, 0, tmp_path
        ),
    ):
        with pytest.raises(AssertionError, match="searched again"):
            other()
    # What failed has left nothing.
    assert [path.name for path in tmp_path.iterdir()] == [folder.name]


def test_damaged_and_foreign_pairs_are_made_again(tracks, search, tmp_path, caplog):
    settings = replace(SETTINGS, stride=40)
    expected = np.array(make_pairs(tracks, search, settings, 0, tmp_path).pointers)
    (folder,) = tmp_path.iterdir()
    manifest = json.loads((folder / "manifest.json").read_text())

    def flipped(name):
        content = bytearray((folder / name).read_bytes())
        content[-1] ^= 1
        (folder / name).write_bytes(content)

    def foreign():
        (folder / "manifest.json").write_text(
            json.dumps({**manifest, "made_by": {**manifest["made_by"], "database": "f" * 64}})
        )

    for damage, message in (
        (lambda: flipped("pointers.npy"), "isn't what was written"),
        (lambda: flipped("ks.npy"), "isn't what was written"),
        (lambda: (folder / "windows.npy").write_bytes(b""), "damaged"),
        (lambda: (folder / "pointers.npy").unlink(), "can't be read"),
        (lambda: (folder / "manifest.json").write_text("{"), "not valid JSON"),
        (lambda: (folder / "manifest.json").write_text("[]"), "made by something else"),
        (
            lambda: (folder / "manifest.json").write_text(json.dumps({**manifest, "own_hits": 0})),
            "isn't what was written",
        ),
        (foreign, "made by something else"),
    ):
        damage()
        caplog.clear()
        with caplog.at_level(logging.WARNING):
            again = make_pairs(tracks, search, settings, 0, tmp_path)
        assert message in caplog.text
        assert "made again" in caplog.text
        np.testing.assert_array_equal(again.pointers, expected)
    assert [path.name for path in tmp_path.iterdir()] == [folder.name]


def test_batches_are_what_the_store_and_the_database_hold(store, database, search, reader, pairs):
    windows = PairWindows(store, "train", ALL, reader, pairs, database, search.step)
    assert len(windows) == len(pairs)
    indices = np.array([3, len(windows) - 1, 60])
    batch = windows.batch(indices)
    joints = len(database.pose_roles)
    assert batch.window_ids.tolist() == indices.tolist()
    assert batch.poses.shape == batch.matched.shape == (3, 32, joints, 3)
    assert batch.cepstra.shape == (3, 32, 28)
    assert batch.positions.shape == (3, 32, 10, 3)
    for row, index in enumerate(indices):
        track, first = pairs.windows[index]
        frames = slice(first, first + 32)
        told = windows.describe(index)
        assert told["recording"] == f"take{track}"
        assert told["start_s"] == pytest.approx(first / 15)
        assert told["k"] == pairs.ks[index]
        assert told["pointers"] == pairs.pointers[index].tolist()
        upper = store.upper_body(int(track))[frames]
        torch.testing.assert_close(batch.positions[row], torch.from_numpy(np.array(upper)))
        np.testing.assert_allclose(
            database.upper_body(batch.poses[row].numpy()), upper - upper[:, :1], atol=1e-5
        )
        samples = 16_000 * (20 + int(track))
        static = sphinx_features(store.audio(int(track), 0, samples), 15, samples * 15 // 16_000)
        np.testing.assert_allclose(batch.cepstra[row], with_slopes(static)[frames], atol=1e-3)
        for t in (0, 7, 8, 31):
            sequence, start = pairs.pointers[index, t // 8]
            expected = database.poses[sequence, start + t % 8]
            np.testing.assert_array_equal(batch.matched[row, t], expected)
        speaker = store.recordings[int(track)].speaker
        assert int(batch.speakers[row]) == store.speaker_ids.get(speaker, 0)


def test_only_what_is_needed_is_served(store, database, search, reader, pairs):
    needs = frozenset({"poses", "matched"})
    batch = PairWindows(store, "train", needs, reader, pairs, database, search.step).batch([0])
    assert batch.cepstra is None
    assert batch.positions is None
    with pytest.raises(ConfigError, match="no batch field smell; there are positions"):
        PairWindows(store, "train", frozenset({"smell"}), reader, pairs, database, search.step)


@pytest.mark.parametrize("seam", ["crossfade", "inertialise"])
def test_seams_are_smoothed_as_in_a_synthesis(
    store, database, search, reader, tracks, tmp_path, seam
):
    settings = replace(SETTINGS, from_mean_pose=True, stride=90, k=1)
    pairs = make_pairs(tracks, search, settings, 0, tmp_path)
    needs = frozenset({"matched"})
    windows = PairWindows(store, "train", needs, reader, pairs, database, search.step, seam)
    batch = windows.batch(range(len(windows)))
    for index, (track, first) in enumerate(pairs.windows):
        closed = neighbours(database, int(track), first / 15, 32, 32).tolist()
        audio = heard(tracks[track], first, 32, database)
        alone = match(search, Clip(audio, closed=closed, from_mean_pose=True))
        expected = blended(alone, database, 8, seam)
        assert not np.allclose(expected, alone.poses)
        np.testing.assert_array_equal(batch.matched[index], expected)


def test_judging_windows_lie_side_by_side(store, search, tmp_path):
    windows = open_pair_windows(store, "val", search, SETTINGS, 0, ALL, tmp_path)
    assert windows.spec.stride == windows.spec.frames == 32
    assert windows.pairs.windows.tolist() == [[0, start] for start in range(0, 329, 32)]
    assert set(windows.pairs.ks.tolist()) == {1}
    assert windows.pairs.own_hits is None
    batch = windows.batch(range(len(windows)))
    # Take 4 is read from its beginning, without a gap.
    upper = torch.from_numpy(np.array(store.upper_body(4)[:352]))
    torch.testing.assert_close(batch.positions.flatten(0, 1), upper.clone()[: 32 * len(windows)])
    assert (search.database.recordings[windows.pairs.pointers[..., 0]] < 4).all()


def test_loaders_serve_pairs_in_an_order_of_the_seed(store, search, tmp_path):
    windows = open_pair_windows(store, "train", search, SETTINGS, 0, ALL, tmp_path)
    loader = WindowLoader(windows, 50, seed=1, shuffle=True, drop_last=True)
    first, again = ([batch.window_ids.tolist() for batch in loader] for _ in range(2))
    assert first == again
    assert len(first) == len(windows) // 50
    assert len({index for batch in first for index in batch}) == 50 * len(first)


def test_nothing_to_match(tmp_path):
    short = make_store(tmp_path, [talk(f"t{i}", i, 5) for i in range(3)])
    search = MatchingSearch(fit_database(short, SPEC), threads=1)
    tracks = list(MatchingTracks(short, "train", 15.0))
    with pytest.raises(CospeechError, match="as long as a window of 100 frames"):
        make_pairs(tracks, search, replace(SETTINGS, frames=100), 0, tmp_path / "pairs")
    with pytest.raises(CospeechError, match="exclude_own=false"):
        make_pairs(tracks, search, SETTINGS, 0, tmp_path / "pairs")
    assert not list((tmp_path / "pairs").iterdir())


@pytest.mark.parametrize(
    ("name", "value"), [("frames", 0), ("stride", 0), ("k", 0), ("closed_frames", -1)]
)
def test_settings_out_of_range(name, value):
    with pytest.raises(ConfigError, match=f"{name}={value}"):
        PairSettings(**{name: value})
