"""The embedded corpus at length: published phase statistics, and causes that show in the motion."""

from collections import defaultdict

import numpy as np
import pytest

from cospeech.corpus.synthetic import SKELETON, synthesise
from cospeech.motion.kinematics import invert_quaternions, rotate_vectors, world_rotations
from cospeech.motion.phases import PHASES

pytest.importorskip("espeakng_loader", reason='needs pip install "cospeech[tts]"')
pytestmark = pytest.mark.slow

# Ferstl et al. 2020, Table 1: share of time in percent, mean duration in s
PUBLISHED = {
    "preparation": (19.1, 0.45),
    "pre_hold": (3.2, 0.44),
    "stroke": (39.6, 0.62),
    "hold": (24.8, 0.66),
    "independent_hold": (0.8, 1.15),
    "rest_hold": (3.1, 0.89),
    "partial_retract": (3.8, 0.48),
    "retract": (1.3, 0.43),
    "none": (4.2, 1.20),
}


@pytest.fixture(scope="module")
def measured():
    """Everything the tests need of an hour, so that no more than one take is in memory."""
    frames = np.zeros(len(PHASES))
    runs = np.zeros(len(PHASES))
    moves, extents, seconds, strokes = defaultdict(list), [], 0.0, 0
    for recording in synthesise(60, seed=1):
        labels = recording.phases
        assert labels is not None
        frames += np.bincount(labels, minlength=len(PHASES))
        first = np.concatenate([[True], labels[1:] != labels[:-1]])
        runs += np.bincount(labels[first], minlength=len(PHASES))
        seconds += recording.motion.duration
        wrists = in_chest_frame(recording)
        amplitude = recording.annotations["style"]["amplitude"]
        calm = {
            round(start, 6): arousal for _, start, _, arousal in recording.annotations["sentences"]
        }
        starts = sorted(calm)
        for gesture in recording.annotations["gestures"]:
            strokes += gesture["kind"] != "independent_hold"
            begin, end = (round(gesture[key] * 60) for key in ("stroke_start", "stroke_end"))
            for side in ("left", "right"):
                if gesture["hand"] in (side, "both"):
                    moves[gesture["kind"]].append((side, wrists[side][end] - wrists[side][begin]))
            if gesture["kind"] == "beat":
                line = starts[np.searchsorted(starts, gesture["cause_time"], side="right") - 1]
                extents.append((np.log(gesture["amplitude_m"]), np.log(amplitude), calm[line]))
    return {
        "frames": frames,
        "runs": runs,
        "moves": moves,
        "extents": np.array(extents),
        "minutes": seconds / 60,
        "strokes": strokes,
    }


def in_chest_frame(recording):
    positions = recording.motion.positions.astype(np.float64)
    rotations = world_rotations(SKELETON.parents, recording.motion.rotations_local)
    inverse = invert_quaternions(rotations[:, SKELETON.index["Spine3"]])
    chest = positions[:, SKELETON.index["Spine3"]]
    return {
        side.lower(): rotate_vectors(inverse, positions[:, SKELETON.index[f"{side}Hand"]] - chest)
        for side in ("Left", "Right")
    }


def test_length(measured):
    assert measured["minutes"] == pytest.approx(60, rel=0.05)


def test_stroke_rate(measured):
    # 8655 strokes in 226 minutes
    assert measured["strokes"] / measured["minutes"] == pytest.approx(38.3, rel=0.06)


@pytest.mark.parametrize("label", PHASES)
def test_phase_shares(measured, label):
    share = 100 * measured["frames"][PHASES.index(label)] / measured["frames"].sum()
    published, _ = PUBLISHED[label]
    tolerance = 3.0 if published > 10 else 1.2
    assert share == pytest.approx(published, abs=tolerance)


@pytest.mark.parametrize("label", [label for label in PHASES if label != "stroke"])
def test_phase_durations(measured, label):
    i = PHASES.index(label)
    mean = measured["frames"][i] / measured["runs"][i] / 60
    assert mean == pytest.approx(PUBLISHED[label][1], rel=0.2)


def test_stroke_duration(measured):
    # strokes that follow one another without a pause are one run of labels: count gestures instead
    seconds = measured["frames"][PHASES.index("stroke")] / 60
    assert seconds / measured["strokes"] == pytest.approx(0.62, abs=0.05)


# direction in which the stroke of each kind goes: x to the speaker's left, y up, z forward; "out"
# is away from the midline
@pytest.mark.parametrize(
    ("kind", "direction", "metres"),
    [
        ("left", (1, 0, 0), 0.15),
        ("right", (-1, 0, 0), 0.15),
        ("up", (0, 1, 0), 0.15),
        ("down", (0, -1, 0), 0.15),
        ("forward", (0, 0, 1), 0.10),
        ("back", (0, 0, -1), 0.12),
        ("there", (0, 0, 1), 0.10),
        ("other", (0, 0, 1), 0.10),
        ("size_large", "out", 0.15),
        ("size_small", "in", 0.05),
        ("negation", "out", 0.12),
        ("self", "in", 0.06),
        ("beat", (0, -1, 0), 0.03),
        ("listing", (0, -1, 0), 0.05),
    ],
)
def test_words_shape_their_strokes(measured, kind, direction, metres):
    along = []
    for side, move in measured["moves"][kind]:
        outwards = (1, 0, 0) if side == "left" else (-1, 0, 0)
        towards = {"out": np.array(outwards), "in": -np.array(outwards)}.get(direction)
        along.append(float(move @ (np.array(direction) if towards is None else towards)))
    assert len(along) >= 10
    assert np.mean(along) > metres
    assert np.mean(np.array(along) > 0) > 0.75


def test_size_follows_the_speaker_and_the_excitement(measured):
    size, habit, arousal = measured["extents"].T
    inputs = np.stack([np.ones_like(habit), habit, arousal], axis=-1)
    _, by_habit, by_arousal = np.linalg.lstsq(inputs, size, rcond=None)[0]
    # both are in the rules: exponent 1 for the habit, 0.35 for arousal, less the chance around them
    assert 0.5 < by_habit < 1.3
    assert 0.15 < by_arousal < 0.5
