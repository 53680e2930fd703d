"""From speech to matched motion: lengths, seams, and what is left out."""

import numpy as np
import pytest
import torch

from cospeech.errors import ConfigError, CospeechError
from cospeech.matching.control import Controls
from cospeech.matching.features import MatchingSpec
from cospeech.matching.fitting import fit_database
from cospeech.matching.matching import Matched
from cospeech.matching.seams import HALF_LIFE_S, blended
from cospeech.matching.streaming import MatchedPieces
from cospeech.matching.synthesis import MatchingSettings, MotionMatcher
from cospeech.speech.speech import Speech
from tests.corpora import make_store
from tests.matching.databases import make_database


@pytest.fixture(scope="module")
def database(tmp_path_factory):
    return fit_database(make_store(tmp_path_factory.mktemp("store")), MatchingSpec(chunk_frames=32))


def speech_of(seconds):
    return Speech((np.arange(round(seconds * 16_000)) / 16_000 % 1).astype(np.float32))


def seeded():
    return torch.Generator().manual_seed(0)


@pytest.mark.parametrize("seconds", [0.0, 0.05, 0.5, 64 / 15, 7.03])
def test_motion_covers_the_speech(database, seconds):
    found = MotionMatcher(database, MatchingSettings())(speech_of(seconds), None, seeded())
    samples = round(seconds * 16_000)
    assert len(found.poses) == int(np.ceil(samples / 16_000 * 15 - 1e-9))
    assert found.plan is None


def test_windows_are_the_databases(database):
    found = MotionMatcher(database, MatchingSettings())(speech_of(3), None, seeded())
    for step, (sequence, frame) in enumerate(
        zip(found.matched.sequences, found.matched.frames, strict=True)
    ):
        there = found.poses[step * 8 : step * 8 + 8]
        np.testing.assert_array_equal(
            there, database.poses[sequence, frame : frame + 8][: len(there)]
        )


@pytest.mark.parametrize(
    "settings",
    [
        MatchingSettings(),
        MatchingSettings(seam="crossfade", natural_continuation=True),
        MatchingSettings(seam="inertialise", step_frames=5, start_offset=1),
        MatchingSettings(preselect="audio", initial_pose="mean", k=2),
    ],
)
@pytest.mark.parametrize("true_future", [False, True])
def test_speech_that_comes_in_pieces_is_matched_like_the_whole(
    tmp_path_factory, settings, true_future
):
    store = make_store(tmp_path_factory.mktemp("store"))
    spec = MatchingSpec(chunk_frames=32, true_future=true_future)
    matcher = MotionMatcher(fit_database(store, spec), settings)
    waveform = store.speech(store.splits["train"][0]).waveform[: round(4.03 * 16_000)]
    whole = matcher(Speech(waveform), None, seeded(), [1]).poses
    pieces = MatchedPieces(matcher, [1], seeded())
    poses = [pieces.hear(part) for part in np.array_split(waveform, 37)]
    early = sum(map(len, poses))
    poses.append(pieces.finish())
    np.testing.assert_array_equal(np.concatenate(poses), whole)
    # 0.96 s of look-ahead, and steps of 8 frames at most.
    assert early >= (4 - 1) * 15


def test_several_at_once_are_those_one_by_one(database):
    matcher = MotionMatcher(database, MatchingSettings(initial_pose="mean", seam="crossfade"))
    speeches = [speech_of(4), Speech(speech_of(5).waveform[16_000:])]
    together = matcher.together([s.waveform for s in speeches], 60, [None, [0, 1]])
    for speech, closed, found in zip(speeches, (None, [0, 1]), together, strict=True):
        alone = matcher(speech, closed=closed)
        np.testing.assert_array_equal(found.poses, alone.poses)
    assert not set(together[1].sequences) & {0, 1}


def test_closed_sequences_are_never_used_under_controls_either(database):
    closed = np.flatnonzero(~database.spoken_by("ben"))
    matcher = MotionMatcher(database, MatchingSettings())
    controls = Controls.from_dict("left_wrist_height >= p60")
    for given in (None, controls):
        found = matcher(speech_of(6), given, seeded(), closed)
        assert database.spoken_by("ben")[found.matched.sequences].all()
    heights = found.poses[:, database.pose_roles.index("left_wrist"), 1]
    limit = np.percentile(database.poses[:, :, database.pose_roles.index("left_wrist"), 1], 60)
    ends = heights.reshape(-1)[: len(heights) // 8 * 8].reshape(-1, 8)[:, [0, 7]]
    assert (ends >= limit - 1e-6).all()
    assert found.plan.fallbacks == ()


def test_what_cannot_be_is_refused(database):
    with pytest.raises(ConfigError, match="steps of 4 frames or more"):
        MatchingSettings(seam="inertialise", step_frames=2)
    for wrong in (
        {"initial_pose": "rest"},
        {"preselect": "nose"},
        {"seam": "glue"},
        {"start_offset": 2},
        {"k": 0},
    ):
        with pytest.raises(ConfigError, match=f"model.{next(iter(wrong))}"):
            MatchingSettings(**wrong)
    with pytest.raises(CospeechError, match="NaN"):
        MotionMatcher(database, MatchingSettings())(Speech(np.full(100, np.nan, np.float32)))


def matched_windows(database, places, step=8):
    rows = [database.poses[m, f : f + step] for m, f in places]
    columns = np.array(places).T
    return Matched(np.concatenate(rows), *columns)


def test_a_crossfade_by_hand():
    database = make_database(sequences=3, frames=20)
    matched = matched_windows(database, [(0, 2), (2, 5), (1, 0)])
    poses = blended(matched, database, 8, "crossfade")
    np.testing.assert_array_equal(poses[:8], matched.poses[:8])
    np.testing.assert_array_equal(poses[12:16], matched.poses[12:16])
    share = 0.2**2 * (3 - 2 * 0.2)
    # Frame 10 of sequence 0 goes on where frame 9 was the last of the window.
    expected = (1 - share) * database.poses[0, 10] + share * database.poses[2, 5]
    np.testing.assert_allclose(poses[8], expected, rtol=1e-6)
    np.testing.assert_array_equal(matched.poses[8], database.poses[2, 5])


def test_a_sequence_that_ends_stays_in_its_last_pose():
    database = make_database(sequences=2, frames=20)
    matched = matched_windows(database, [(0, 12), (1, 0)])
    poses = blended(matched, database, 8, "crossfade")
    share = 0.8**2 * (3 - 2 * 0.8)
    expected = (1 - share) * database.poses[0, 19] + share * database.poses[1, 3]
    np.testing.assert_allclose(poses[11], expected, rtol=1e-6)


def test_inertia_keeps_place_and_velocity_and_forgets_the_difference():
    database = make_database(sequences=2, frames=64)
    slope = np.arange(64, dtype=np.float32)[:, None, None] / 15
    still = np.stack([0.3 * slope + np.zeros((1, 2, 3)), np.ones((64, 2, 3))]).astype(np.float32)
    database.poses[:] = still
    step = 24
    matched = matched_windows(database, [(0, 0), (1, 0)], step)
    poses = blended(matched, database, step, "inertialise").astype(np.float64)
    steps = np.diff(poses[:, 0, 0]) * 15
    # Where the next window begins, the old velocity of 0.3 m/s still holds.
    np.testing.assert_allclose(steps[step - 1], 0.3, atol=1e-5)
    offset = poses[step:, 0, 0] - 1
    rate = 1.678347 / HALF_LIFE_S
    assert (1 + rate * HALF_LIFE_S) * np.exp(-rate * HALF_LIFE_S) == pytest.approx(0.5, abs=1e-6)
    times = np.arange(step) / 15
    start = offset[0]
    np.testing.assert_allclose(
        offset, (start + (0.3 + rate * start) * times) * np.exp(-rate * times), atol=1e-5
    )
    assert abs(offset[-1]) < 1e-4
