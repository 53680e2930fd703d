"""The study of controls, on a small corpus and methods whose obedience is known."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter1d

from cospeech.errors import CospeechError
from cospeech.matching.control import measure
from cospeech.matching.features import MatchingSpec
from cospeech.matching.fitting import fit_database
from cospeech.matching.synthesis import MatchingSettings, MotionMatcher
from cospeech.matching.tracks import MatchingTracks
from cospeech.methods.base import GestureMethod
from cospeech.studies.control_adherence import control_adherence
from cospeech.studies.control_adherence.tested_controls import TESTED_CONTROLS, changing
from tests.corpora import REST_POSE, make_recording, make_store


def wandering(name, speaker, seed):
    """Wrists that stay in a place for a while."""
    recording = make_recording(name, speaker, 12, seed=seed)
    positions = recording.motion.positions
    noise = np.random.default_rng(seed).normal(size=(len(positions), 2, 3))
    wander = gaussian_filter1d(noise, 8.0, axis=0).astype(np.float32)
    moved = positions.copy()
    moved[:, [6, 9]] = REST_POSE[[6, 9]] + 0.6 * wander
    return replace(recording, motion=replace(recording.motion, positions=moved))


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    takes = [wandering(f"t{i}", ("ada", "ben")[i % 2], i) for i in range(8)]
    return make_store(tmp_path_factory.mktemp("control"), takes)


@pytest.fixture(scope="module")
def matcher(store):
    return MotionMatcher(fit_database(store, MatchingSpec(chunk_frames=32)), MatchingSettings())


class Made(GestureMethod):
    """Matched motion, and as second stage the same halfway to its mean; or it isn't controlled."""

    sample = generate = None

    def __init__(self, matcher, obeys=True, own=False):
        super().__init__()
        self.matcher, self.obeys, self.same_speaker = matcher, obeys, own

    def closed_sequences(self, speaker, generator):
        database = self.matcher.database
        return np.flatnonzero(~database.spoken_by(speaker)) if self.same_speaker else None

    def stages(self, speech, controls, generator, speaker=None):
        assert not self.training
        assert not torch.is_grad_enabled()
        closed = self.closed_sequences(speaker, generator)
        controls = controls if self.obeys else None
        poses = self.matcher(speech, controls, generator, closed).poses
        return {"k-NN": poses, "k-NN + cGAN": (poses + poses.mean(axis=0)) / 2}


Made.__abstractmethods__ = frozenset()


@pytest.fixture(scope="module")
def obeyed(store, matcher, tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    method = Made(matcher).train()
    result = control_adherence(store, method, "train", folder, 3, [("run", "made up")])
    assert method.training
    return folder, result


def test_numbers_are_those_of_the_motion(store, matcher, obeyed):
    """Everything again, by other means."""
    database, (_, result) = matcher.database, obeyed
    tracks = list(MatchingTracks(store, "train", 15.0))
    rows = {(row["name"], row["stage"]): row for row in result["controls"]}
    assert len(rows) == 12
    for tested in TESTED_CONTROLS:
        usable = measure(tested.quantity, database.poses, database.pose_roles, 15.0)[
            database.usable
        ]
        threshold = np.percentile(usable, tested.percent)
        values = {"free": [], "controlled": []}
        for number, track in enumerate(tracks):
            for kind, controls in (("free", None), ("controlled", tested.controls())):
                generator = torch.Generator().manual_seed(3000 + number)
                poses = matcher(store.speech(track.span), controls, generator).poses
                values[kind].append(measure(tested.quantity, poses, database.pose_roles, 15.0))
        row = rows[tested.name, "k-NN"]
        assert row["threshold"] == pytest.approx(threshold)
        for kind, parts in values.items():
            everything = np.concatenate(parts)
            assert row[kind]["mean"] == pytest.approx(everything.mean())
            assert row[kind]["deviation"] == pytest.approx(everything.std())
            inner = np.concatenate([np.delete(part, np.s_[::8]) for part in parts])
            assert row[kind]["within"] == pytest.approx(inner.mean())
            beyond = tested.way * everything >= tested.way * threshold
            assert row[kind]["share"] == pytest.approx(beyond.mean())
        shift = tested.way * (row["controlled"]["mean"] - row["free"]["mean"])
        assert row["shift"]["value"] == pytest.approx(shift)
        low, high = row["shift"]["interval"]
        assert low < shift < high
        real = np.concatenate(
            [measure(tested.quantity, t.poses, database.pose_roles, 15.0) for t in tracks]
        )
        assert row["real"]["mean"] == pytest.approx(real.mean())


def test_obedience_is_seen_and_the_mean_is_drawn_back_by_the_second_stage(obeyed):
    _, result = obeyed
    rows = {(row["name"], row["stage"]): row for row in result["controls"]}
    for name in ("wrist high", "wrist low"):
        first, second = (rows[name, stage] for stage in ("k-NN", "k-NN + cGAN"))
        assert first["verdict"] == second["verdict"] == "yes"
        assert first["controlled"]["share"] > 0.5 > first["free"]["share"]
        # Halfway to the clip's own mean leaves the mean and halves the deviation within a clip.
        assert second["controlled"]["mean"] == pytest.approx(first["controlled"]["mean"], abs=1e-6)
        assert second["controlled"]["deviation"] < first["controlled"]["deviation"]
    fast, slow = (rows[name, "k-NN"] for name in ("wrist fast", "wrist slow"))
    assert fast["controlled"]["mean"] > fast["free"]["mean"] > slow["controlled"]["mean"]
    (change, *_) = result["changing"]["quantities"]
    assert change["quantity"] == "left_wrist_height"
    assert change["halves"][1] - change["halves"][0] > change["free_halves"][1] - 0.01
    assert change["verdict"] == "yes"


def test_windows_are_counted_as_the_search_counts_them(store, matcher, obeyed):
    _, result = obeyed
    tracks = list(MatchingTracks(store, "train", 15.0))
    for row in result["controls"]:
        tested = next(one for one in TESTED_CONTROLS if one.name == row["name"])
        made = matcher(store.speech(tracks[0].span), tested.controls(), None)
        assert row["windows"]["mean"] == made.plan.eligible[0] == row["windows"]["fewest"]
        assert row["windows"]["of"] == matcher.search.eligible().sum()
    halves = matcher(store.speech(tracks[0].span), changing(12.0), None).plan.eligible
    counts = [windows["mean"] for windows in result["changing"]["windows"]]
    # The first half reaches into step 11 of 23, and not to its middle.
    assert [halves[0], halves[-1]] == counts
    assert len(set(halves[:11])) == len(set(halves[11:])) == 1


def test_what_is_taken_from_one_speaker_has_that_speakers_percentiles(store, matcher, tmp_path):
    result = control_adherence(store, Made(matcher, own=True), "train", tmp_path, 0)
    database = matcher.database
    limits = []
    for name in ("ada", "ben"):
        own = database.usable & database.spoken_by(name)[:, None]
        heights = database.poses[..., database.pose_roles.index("left_wrist"), 1][own]
        limits.append(np.percentile(heights.astype(np.float64), 85))
    assert limits[0] != limits[1]
    assert result["controls"][0]["threshold"] == pytest.approx(np.mean(limits))
    assert result["controls"][0]["windows"]["of"] < matcher.search.eligible().sum()


def test_a_method_that_does_not_listen_is_found_out(store, matcher, tmp_path):
    result = control_adherence(store, Made(matcher, obeys=False), "train", tmp_path, 0)
    for row in result["controls"]:
        assert row["shift"]["value"] == 0
        assert row["verdict"] == "unclear"


def test_few_recordings_have_no_interval(store, matcher, tmp_path):
    result = control_adherence(store, Made(matcher), "test", tmp_path, 0)
    row = result["controls"][0]
    assert row["shift"]["interval"] is None
    assert row["verdict"] == "yes, too few recordings to be sure"


def test_the_files_say_what_was_found(obeyed):
    folder, result = obeyed
    written = json.loads((folder / "control_adherence.json").read_text())
    assert written["controls"][0]["published"]["threshold"] == 0.222
    assert written["facts"]["run"] == "made up"
    assert written["facts"]["part"] == "train: 6 recordings, 1.2 min"
    for row, told in zip(written["controls"], result["controls"], strict=True):
        assert row["shift"]["interval"] == list(told["shift"]["interval"])
    page = (folder / "control_adherence.md").read_text()
    first = result["controls"][0]
    mean, deviation = (100 * first["controlled"][key] for key in ("mean", "deviation"))
    assert f"{mean:.1f} ({deviation:.1f})" in page
    assert "22.2: 25.6 (3.4)" in page
    assert page.count("| k-NN + cGAN |") == 8
    assert (folder / "control_adherence.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_methods_without_controls_are_refused(store, tmp_path):
    class Other(GestureMethod):
        pass

    Other.__abstractmethods__ = frozenset()
    with pytest.raises(CospeechError, match="a Other takes no controls"):
        control_adherence(store, Other(), "test", tmp_path, 0)
