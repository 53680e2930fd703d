"""The study of caused gestures, on strokes made by hand and on a small embedded corpus."""

import json

import numpy as np
import pytest

from cospeech.corpus.splits import Span
from cospeech.corpus.store_writer import StoreWriter
from cospeech.corpus.synthetic import synthesise
from cospeech.errors import CospeechError
from cospeech.studies.caused_gestures import caused_gestures
from cospeech.studies.caused_gestures.answers import (
    faster_than_between,
    met,
    peak_times,
    ranks_at_lags,
    wrist_speeds,
)
from cospeech.studies.caused_gestures.concepts import (
    STEPS,
    WRISTS,
    ConceptShapes,
    matched,
    places,
    votes,
    wrist_steps,
)
from cospeech.studies.caused_gestures.generating import reference_motions
from cospeech.studies.caused_gestures.measuring import SystemMotion, make_setting, measure_system
from cospeech.studies.caused_gestures.poses import PoseSpace, first_and_last_quarter, pose_variance
from cospeech.studies.caused_gestures.strokes import Stroke, Take, read_takes
from cospeech.studies.caused_gestures.tables import tables
from cospeech.studies.trained_system import TrainedSystem
from tests.corpora import REST_POSE, make_store

FPS = 15.0
MOVES = {"up": (0.0, 0.3, 0.0), "left": (0.25, 0.0, 0.0), "forward": (0.0, 0.0, 0.2)}
BEAT = (0.0, -0.12, 0.0)


def made_take(seed: int, moves=MOVES, seconds: float = 48.0) -> Take:
    """A stroke every 1.2 to 2 s: the wrist goes smoothly in the concept's direction, rests, comes
    back slowly and rests. A third are of words; of each hand there are as many."""
    rng = np.random.default_rng(seed)
    times = np.arange(round(seconds * FPS)) / FPS
    positions = np.repeat(REST_POSE[None], len(times), axis=0).astype(np.float64)
    strokes, start = [], 1.0
    concepts = list(moves)
    while start < seconds - 3:
        is_word = rng.uniform() < 0.4
        concept = concepts[rng.integers(len(concepts))] if is_word else "beat"
        hands = ("left", "right")[int(rng.integers(2))]
        end, following = start + rng.uniform(0.4, 0.6), start + rng.uniform(1.2, 2.0)
        move = np.array(moves.get(concept, BEAT)) * rng.uniform(0.8, 1.2)
        there = np.clip((times - start) / (end - start), 0, 1)
        back = np.clip((times - end - 0.2) / (following - end - 0.4), 0, 1)
        course = there**2 * (3 - 2 * there) - back
        positions[:, WRISTS[hands == "right"]] += course[:, None] * move
        strokes.append(Stroke(concept, hands, float(start), float(end)))
        start = following
    return Take(
        Span(seed, 0, len(times)),
        f"take{seed}",
        "ada",
        positions.astype(np.float32),
        tuple(strokes),
    )


@pytest.fixture(scope="module")
def parts():
    return [made_take(seed) for seed in range(20, 26)], [made_take(seed) for seed in range(6)]


def measured(training, takes, change=lambda positions: positions, **system):
    setting = make_setting(training, takes, seed=0)
    motion = SystemMotion("made", system.get("seed", 0), [change(t.positions) for t in takes])
    return measure_system([motion], setting)


def values(found):
    return {key: number.value for key, number in found.numbers.items()}


def test_recorded_motion_answers_everything(parts):
    found = measured(*parts)
    of = values(found)
    assert of["concept_share"] > 0.98
    assert of["concept_place"] > 0.98
    assert of["concept_share_by_luck"] < 0.45
    assert of["words_answered"] > 0.85
    # hands that come back from a large gesture are as fast as a beat
    assert of["beats_answered"] > 0.68
    assert of["beats_met"] > 0.98
    assert of["beats_met_by_chance"] < 0.6
    assert of["beats_lag_s"] == 0
    assert of["speed"] == pytest.approx(1)
    assert of["spread"] == pytest.approx(1)
    low, high = found.numbers["concept_lift"].interval
    assert 0.9 < low <= high <= 1


def test_frozen_motion_gets_what_luck_gives(parts):
    of = values(measured(*parts, lambda p: np.broadcast_to(p[0], p.shape)))
    for key in ("concept_share", "concept_share_by_luck"):
        assert of[key] == pytest.approx(1 / len(MOVES))
    for key in ("concept_place", "concept_place_by_luck", "words_answered", "beats_answered"):
        assert of[key] == pytest.approx(0.5)
    assert of["beats_met"] == of["beats_met_by_chance"] == of["beats_lift"] == 0
    assert np.isnan(of["beats_lag_s"])
    assert of["speed"] == of["spread"] == 0


@pytest.mark.parametrize("frames", [6, -6])
def test_shifted_motion_loses_the_timing_and_the_lag_says_which_way(parts, frames):
    of = values(measured(*parts, lambda p: np.roll(p, frames, axis=0)))
    assert of["beats_lag_s"] == pytest.approx(frames / FPS, abs=1e-3)
    assert of["beats_met"] < 0.2
    assert of["beats_lift"] < 0
    assert of["beats_answered"] < 0.4


def test_damping_is_measured_and_costs_nothing_else(parts):
    of = values(measured(*parts, lambda p: REST_POSE + 0.5 * (p - REST_POSE)))
    recorded = values(measured(*parts))
    assert of["speed"] == pytest.approx(0.5, rel=1e-3)
    assert of["spread"] == pytest.approx(0.5, rel=1e-3)
    for key in ("concept_share", "words_answered", "beats_answered", "beats_met"):
        assert of[key] == pytest.approx(recorded[key], abs=0.01)


def test_the_other_hand_shows_another_thing():
    """Left and right hand mirror each other: 'left' of one is 'right' of the other."""
    mirrored = {"left": (0.25, 0.0, 0.0), "right": (-0.25, 0.0, 0.0), "up": (0.0, 0.3, 0.0)}
    training = [made_take(seed, mirrored) for seed in range(20, 26)]
    takes = [made_take(seed, mirrored) for seed in range(6)]

    def hands_exchanged(positions):
        exchanged = positions.copy()
        exchanged[:, list(WRISTS)] = positions[:, list(WRISTS[::-1])] * [-1, 1, 1]
        return exchanged

    assert values(measured(training, takes))["concept_share"] > 0.98
    assert values(measured(training, takes, hands_exchanged))["concept_share"] < 0.6


def test_what_a_concept_looks_like_is_learned_from_the_training_part():
    """People of the judged part who mean 'up' and go left are taken to mean 'left'."""
    order = list(MOVES)
    other = {name: MOVES[order[(i + 1) % len(order)]] for i, name in enumerate(order)}
    training = [made_take(seed) for seed in range(20, 26)]
    found = measured(training, [made_take(seed, other) for seed in range(6)])
    assert found.numbers["concept_share"].value < 0.02
    assert found.numbers["concept_lift"].value < 0


def test_drift_is_seen_in_the_last_quarter(parts):
    def drifting(positions):
        away = np.linspace(0, 1, len(positions)) ** 3
        return positions + away[:, None, None] * np.array([0.0, 0.5, 0.0])

    found = measured(*parts, drifting)
    assert found.counts["long"] == len(parts[1])
    assert found.numbers["drift"].value > 1
    assert abs(measured(*parts).numbers["drift"].value) < 0.4
    short = [made_take(seed, seconds=20) for seed in range(6)]
    found = measured(parts[0], short)
    assert found.counts["long"] == 0
    assert np.isnan(found.numbers["drift"].value)


def test_seeds_are_one_row_with_two_intervals(parts):
    training, takes = parts
    setting = make_setting(training, takes, seed=0)
    whole, still = (
        [change(take.positions) for take in takes]
        for change in (lambda p: p, lambda p: np.broadcast_to(p[0], p.shape))
    )
    found = measure_system([SystemMotion("a", 3, whole), SystemMotion("a", 5, still)], setting)
    assert found.seeds == (3, 5)
    speed = found.numbers["speed"]
    assert speed.by_seed == (pytest.approx(1), 0)
    assert speed.value == pytest.approx(0.5)
    assert speed.interval == pytest.approx((0.5, 0.5))
    # of 0 and 1 by Student's t with one degree of freedom: 12.706 * 0.7071 / 1.4142 aside of 0.5
    assert speed.seeds_interval == pytest.approx((0.5 - 6.353, 0.5 + 6.353), abs=1e-3)
    one = measure_system([SystemMotion("b", 0, whole)], setting)
    difference = one.numbers["speed"].minus(speed)
    assert difference.value == pytest.approx(0.5)
    assert difference.interval == pytest.approx((0.5, 0.5))
    shown = tables([found, one], 3, "text")
    assert "minus a" in shown
    assert "50 (50 to 50; -585 to 685)" in shown


def test_references_are_the_takes_own_motion_and_that_of_others_of_the_speaker(parts):
    training, takes = parts
    recorded, mismatched, still = reference_motions(takes[:2], training)
    assert recorded[0].positions[0] is takes[0].positions
    assert len(mismatched) == 3
    np.testing.assert_array_equal(mismatched[0].positions[0], takes[1].positions)
    np.testing.assert_array_equal(mismatched[0].positions[1], takes[0].positions)
    np.testing.assert_array_equal(mismatched[1].positions[1], training[0].positions)
    assert np.ptp(still[0].positions[0], axis=0).max() == 0
    alone = reference_motions(takes[:1], takes[:1])
    assert [row[0].name for row in alone] == ["recorded motion", "mean pose"]


def test_wrist_steps_by_hand():
    """A left wrist at 1 m/s to the left, from between two frames to between two others."""
    positions = np.zeros((31, 10, 3))
    positions[:, WRISTS[0], 0] = np.arange(31) / FPS
    steps = wrist_steps(positions, FPS, 0.5, 1.2)
    assert steps.shape == (STEPS, 2, 3)
    np.testing.assert_allclose(steps[:, 0, 0], 0.7 / STEPS)
    assert not steps[:, 1].any()
    assert not steps[:, 0, 1:].any()


def test_likeness_votes_and_places_by_hand():
    def steps(left, right):
        return np.broadcast_to(np.array([left, right], dtype=float), (STEPS, 2, 3))

    x, y, no = (1, 0, 0), (0, 1, 0), (0, 0, 0)
    strokes = [Stroke("a", "left", 0, 1), Stroke("a", "right", 0, 1), Stroke("b", "left", 0, 1)]
    shapes = ConceptShapes.of([steps(x, no), steps(no, x), steps(y, no)], strokes)
    assert shapes.concepts == ("a", "b")
    found = shapes.likeness(
        [steps((3, 0, 0), no), steps(no, (0.1, 0, 0)), steps(y, no), steps(no, no)]
    )
    np.testing.assert_allclose(found, [[1, 0], [1, 0], [0, 1], [0, 0]], atol=1e-12)
    three = np.array([[0.9, 0.1, -0.5], [0.2, 0.2, 0.1], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(votes(three), [[1, 0, 0], [0.5, 0.5, 0], [1 / 3] * 3])
    np.testing.assert_allclose(places(three), [[1, 0.5, 0], [0.75, 0.75, 0], [0.5] * 3])
    # 1 + 0.5 + 1/3 for their own; luck: each for the others' concepts, (0 + 0) + (0.5 + 0) + 2/3
    own, luck = matched(votes(three), np.array([0, 1, 2]))
    assert own == pytest.approx(1 + 0.5 + 1 / 3)
    assert luck == pytest.approx((0 + 0.5 + 2 / 3) / 2)
    assert matched(votes(three[:1]), np.array([0])) == (1, pytest.approx(1 / 3))
    assert matched(votes(three[:0]), np.array([], dtype=int)) == (0, 0)


def test_speeds_and_answers_by_hand():
    positions = np.zeros((31, 10, 3))
    positions[:, WRISTS[0], 1] = np.arange(31) * 0.1 / FPS
    np.testing.assert_allclose(wrist_speeds(positions, FPS), 0.05)
    # a step a second: strokes are steps 2, 3 and 6; between them are 0, 1, 4, 5, 7
    speeds = np.array([1.0, 2, 3, 9, 3, 4, 0, 5, 99])
    strokes = [Stroke("up", "left", 2, 4), Stroke("beat", "left", 6, 7)]
    found = faster_than_between(speeds, 1.0, strokes, strokes, (0, 8))
    np.testing.assert_allclose(found, [(2.5 / 5 + 1) / 2, 0])
    assert np.isnan(faster_than_between(speeds, 1.0, strokes[:1], strokes[:1], (2, 4))).all()
    ranks = ranks_at_lags(
        np.array([0.0, 5, 1, 2]), 1.0, [Stroke("beat", "left", 0, 1)], (0, 4), [0, 1, 9]
    )
    np.testing.assert_allclose(ranks, [[0.125, 0.875, np.nan]])


def test_peaks_that_are_met_by_hand():
    speeds = np.zeros(60)
    speeds[[15, 40]], speeds[50] = 1.0, 0.01
    peaks = peak_times(speeds, FPS, (0, 4))
    np.testing.assert_allclose(peaks, [15.5 / FPS, 40.5 / FPS])
    hits, chance = met([15.5 / FPS + 0.19, 40.5 / FPS - 0.21], peaks, (0, 4))
    assert hits == 1
    assert 0 < chance < 2 * 0.8 / 4 + 0.3
    assert met([1.0], np.zeros(0), (0, 4)) == met([], peaks, (0, 4)) == (0, 0)


def test_poses_by_hand():
    rng = np.random.default_rng(0)
    poses = np.zeros((4000, 2, 3))
    poses[:, 1, 0] = rng.normal(1, 0.3, 4000)
    space = PoseSpace.of(poses)
    pose = np.zeros((1, 2, 3))
    pose[0, 1, 0] = 1.9
    assert space.distances(pose)[0] == pytest.approx(3, rel=0.1)
    assert np.sqrt(np.square(space.distances(poses)).mean()) == pytest.approx(1, rel=1e-6)
    assert first_and_last_quarter(np.array([1.0, 3, 0, 0, 0, 0, 0, 5, 7])) == (2, 6)
    assert pose_variance(poses) == pytest.approx(0.09, rel=0.1)


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    with StoreWriter(tmp_path_factory.mktemp("s") / "s", "small", {}, "0" * 64) as writer:
        for recording in synthesise(5, seed=5, speakers=2, fps=15):
            writer.add(recording)
        frames = writer.columns()["frames"]
        count = len(frames)
        return writer.finish(
            {
                "train": [Span(i, 0, frames[i]) for i in range(count - 5)],
                "val": [Span(0, 75, frames[0])],
                "test": [Span(i, 0, frames[i]) for i in range(count - 5, count)],
            }
        )


class Replaying:
    """Gives the recorded motion of the judged takes on their own skeleton, in their order."""

    training = False

    def __init__(self, store, frames_short=0):
        self.motions = [
            store.motion(span.recording).slice(0, span.stop - frames_short)
            for span in store.splits["test"]
        ]

    def eval(self):
        pass

    def train(self, training):
        pass

    def generate(self, speech, speaker, generator):
        assert len(speech.words)
        return self.motions[generator.initial_seed()]


def test_motion_on_more_joints_is_judged_as_recorded(store, tmp_path, capsys):
    systems = [TrainedSystem("whole", 0, Replaying(store))]
    assert len(Replaying(store).motions[0].skeleton) > 10
    found = caused_gestures(store, "test", tmp_path, systems, seed=0, about=[("runs", "none")])
    rows = {row["name"]: row for row in found["systems"]}
    assert list(rows) == ["recorded motion", "recorded, mismatched speech", "mean pose", "whole"]
    recorded, whole = (rows[name]["numbers"] for name in ("recorded motion", "whole"))
    for key, number in recorded.items():
        assert whole[key]["value"] == pytest.approx(number["value"], abs=1e-3, nan_ok=True), key
    assert recorded["beats_met"]["value"] > 0.8
    assert recorded["beats_answered"]["value"] > 0.6
    assert recorded["concept_place"]["value"] > 0.8
    low = rows["recorded, mismatched speech"]["numbers"]
    assert abs(low["beats_answered"]["value"] - 0.5) < 0.08
    assert abs(low["beats_lift"]["value"]) < 0.2
    counts = rows["whole"]["counts"]
    assert counts["takes"] == 5
    assert counts["beats"] > 30 > counts["known"] > 3
    assert json.loads((tmp_path / "caused_gestures.json").read_text())["facts"]["runs"] == "none"
    page = (tmp_path / "caused_gestures.md").read_text()
    assert "| whole" in page
    assert f"{len(found['facts']['concepts'].split(', '))} concepts" in page
    assert (tmp_path / "caused_gestures.png").read_bytes().startswith(b"\x89PNG")
    assert "recorded, mismatched speech" in capsys.readouterr().out


def test_a_take_of_a_part_of_a_recording_has_its_own_clock(store):
    (whole,) = read_takes(store, [Span(0, 0, store.splits["val"][0].stop)])
    (later,) = read_takes(store, store.splits["val"])
    assert len(later.strokes) < len(whole.strokes)
    assert later.strokes[-1].start_s == pytest.approx(whole.strokes[-1].start_s - 5)
    assert later.strokes[0].start_s >= 0
    names = ("listing", "independent_hold", "beat", "up")
    kinds = {name: Stroke(name, "left", 0, 1).kind for name in names}
    assert kinds["listing"] is kinds["independent_hold"] is None
    assert kinds["beat"] == "beats"
    assert kinds["up"] == "words"


def test_what_is_refused(store, tmp_path):
    short = TrainedSystem("short", 0, Replaying(store, frames_short=8))
    with pytest.raises(CospeechError, match=r"short, seed 0: .* s of motion for .*, which lasts"):
        caused_gestures(store, "test", tmp_path, [short], seed=0)
    with pytest.raises(CospeechError, match="the training part teaches"):
        caused_gestures(store, "train", tmp_path, [], seed=0)
    with pytest.raises(CospeechError, match="nothing is known of what caused its gestures"):
        caused_gestures(make_store(tmp_path / "made"), "test", tmp_path, [], seed=0)
    assert [path.name for path in tmp_path.iterdir()] == ["made"]
