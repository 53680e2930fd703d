"""The TED set's published preprocessing: against its own cache database, and by hand."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import interp1d

from cospeech.formats.lmdb_values import list_keys, read_value
from cospeech.formats.ted.clip import TedClip, UnusableClipError
from cospeech.formats.ted.filters import PUBLISHED_MEAN_POSE, PUBLISHED_RULES, judge_motion
from cospeech.formats.ted.values import checked_clip
from cospeech.formats.ted.windows import (
    ClipWindows,
    resample_poses,
    spectrogram_columns,
)
from cospeech.speech.speech import Word
from cospeech.speech.vocabulary import frame_aligned_words
from tests.fabricated.ted_cache import (
    PUBLISHED_MEAN_DIRECTION,
    cached_samples,
    direction_vectors,
)
from tests.fabricated.ted_clips import make_clip

FACTS = Path(__file__).resolve().parents[2] / "docs" / "facts"


def fixture_clips(folder, database):
    for key in list_keys(folder / database):
        video = read_value(folder / database, key)
        for clip in video["clips"]:
            yield video["vid"], checked_clip(clip)


@pytest.fixture(scope="module")
def published(shared):
    """What the original preprocessing cached for lmdb_val, and what is made of it here."""
    folder = shared / "data" / "ted_legacy_fixture"
    means = json.loads((folder / "cache_means.json").read_text())
    rules = replace(PUBLISHED_RULES, mean_pose=tuple(means["mean_pose"]))
    made = [
        sample
        for vid, clip in fixture_clips(folder, "lmdb_val")
        for sample in cached_samples(clip, vid, rules, means["mean_dir_vec"])
    ]
    cache = folder / "lmdb_val_cache"
    return [read_value(cache, key) for key in list_keys(cache)], made


def test_the_published_cache_is_reproduced_bit_for_bit(published):
    cached, made = published
    assert len(cached) == len(made) == 26
    for value, sample in zip(cached, made, strict=True):
        words, poses, directions, audio, spectrogram, aux = value
        assert [[w.text, w.start, w.end] for w in sample.words] == words
        assert sample.aux == aux
        assert audio.dtype == sample.audio.dtype == np.float16
        np.testing.assert_array_equal(sample.poses, poses)
        np.testing.assert_allclose(sample.directions, directions, rtol=0, atol=1e-15)
        np.testing.assert_array_equal(sample.audio, audio)
        np.testing.assert_array_equal(sample.spectrogram, spectrogram)


def test_words_lie_on_the_frames_that_the_loader_gives_them(published):
    for value, sample in zip(*published, strict=True):
        start_s, end_s = sample.aux["start_time"], sample.aux["end_time"]
        end_s = start_s + (end_s - start_s) * 34 / 42  # the published loader keeps 34 frames
        expected = [0] * 34
        for number, (_, word_start, _) in enumerate(value[0], start=4):
            frame = max(0, math.floor((word_start - start_s) / ((end_s - start_s) / 34)))
            if frame < 34:
                expected[frame] = number
        starts = [word.start for word in sample.words]
        aligned = frame_aligned_words(starts, range(4, 4 + len(starts)), start_s, 34, 15.0)
        assert aligned.tolist() == expected


def test_lengths_of_spectrograms():
    assert spectrogram_columns(42) == 86  # 86.5, which rounds to even
    assert spectrogram_columns(34) == 70


@pytest.mark.parametrize(("count", "seconds"), [(50, 2.0), (61, 2.0353), (30, 1.001), (7, 1.4)])
def test_resampling_is_linear_interpolation_over_the_frame_index(count, seconds):
    poses = np.random.default_rng(count).normal(size=(count, 10, 3))
    at = np.arange(0, count, count / (seconds * 15))
    line = interp1d(np.arange(count), poses, axis=0, fill_value="extrapolate")
    resampled = resample_poses(poses, seconds, 15)
    assert len(resampled) == math.ceil(seconds * 15)
    np.testing.assert_array_equal(resampled, line(at).astype(np.float16))


def test_resampling_goes_on_past_the_last_frame():
    ramp = np.broadcast_to(np.arange(4.0)[:, None, None], (4, 10, 3))
    # 4 frames in a second at 15 fps: a step of 4/15 of a frame, the last one at 14 * 4/15 = 3.73
    resampled = resample_poses(ramp, 1.0, 15)
    np.testing.assert_allclose(resampled[:, 0, 0], np.arange(15) * 4 / 15, atol=2e-3)


def test_published_means_agree_with_each_other_and_the_facts():
    """docs/facts/trimodal.md, sections 3.1 and 3.2: the digits, and that both means are of one
    body."""
    text = (FACTS / "trimodal.md").read_text(encoding="utf-8")
    for title, mean in (
        ("Mean direction vector (27):", PUBLISHED_MEAN_DIRECTION),
        ("Mean pose (30):", PUBLISHED_MEAN_POSE),
    ):
        listed = text.split(title)[1].split("\n\n")[0]
        assert mean == tuple(float(number) for number in re.findall(r"-?\d+\.\d+", listed))
    pose, directions = np.reshape(PUBLISHED_MEAN_POSE, (10, 3)), PUBLISHED_MEAN_DIRECTION
    bones = np.linalg.norm(pose[1:] - pose[[0, 1, 2, 1, 4, 5, 1, 7, 8]], axis=1)
    shares = bones / np.linalg.norm(np.reshape(directions, (9, 3)), axis=1)
    assert shares.mean() == pytest.approx(0.2012, abs=5e-5)


STILL = np.tile(np.reshape(PUBLISHED_MEAN_POSE, (10, 3)), (42, 1, 1))


def lively(right=True, left=True):
    """The mean pose moved by 0.03 on each axis, its wrists waving with a variance of 0.0025."""
    poses = STILL + 0.03
    wave = 0.0707 * np.sin(2 * np.pi * np.arange(42) / 21)
    for joint, moves in ((6, left), (9, right)):
        poses[:, joint, 1] += wave * moves
    return poses


def leaning(poses, degrees):
    leant = poses.copy()
    angles = np.radians(np.broadcast_to(degrees, len(poses)))
    length = np.linalg.norm(leant[:, 1] - leant[:, 0], axis=1)
    leant[:, 1] = leant[:, 0] + length[:, None] * np.stack(
        [np.sin(angles), -np.cos(angles), 0 * angles], axis=1
    )
    return leant


def test_motion_filters_in_their_order():
    assert judge_motion(lively()) == "PASS"
    assert judge_motion(lively(left=False)) == "PASS"
    assert judge_motion(lively(right=False)) == "PASS"
    assert judge_motion(lively(right=False, left=False)) == "motion"
    assert judge_motion(STILL + 0.0199) == "pose"
    assert judge_motion(STILL + 0.0201) == "motion"
    one_frame = np.zeros(42)
    one_frame[5] = 29.9
    assert judge_motion(leaning(lively(), one_frame)) == "PASS"
    one_frame[5] = 30.1
    assert judge_motion(leaning(lively(), one_frame)) == "spine angle"
    assert judge_motion(leaning(lively(), 19.9)) == "PASS"
    assert judge_motion(leaning(lively(), 20.1)) == "spine angle"
    # of several, the first counts
    assert judge_motion(leaning(STILL, 40)) == "pose"
    assert judge_motion(leaning(lively(False, False), 40)) == "spine angle"


@pytest.mark.parametrize(("amplitude", "verdict"), [(0.0528, "motion"), (0.0530, "PASS")])
def test_wrist_variance_is_a_population_variance(amplitude, verdict):
    # a full number of sine periods: variance amplitude^2 / 2, at 0.0014 for amplitude 0.05292
    poses = STILL + 0.03
    poses[:, 9, 0] += amplitude * np.sin(2 * np.pi * np.arange(42) / 21)
    assert judge_motion(poses) == verdict


def test_directions_of_a_hand_made_pose():
    pose = np.zeros((10, 3))
    pose[1] = [0, -0.2, 0]
    pose[2] = [0, -0.2, 0.1]
    pose[3] = pose[2]
    pose[4] = [-0.3, 0.2, 0]
    directions = direction_vectors(pose)
    np.testing.assert_allclose(directions[0], [0, -1, 0])
    np.testing.assert_allclose(directions[1], [0, 0, 1])
    np.testing.assert_array_equal(directions[2], [0, 0, 0])
    np.testing.assert_allclose(directions[3], [-0.6, 0.8, 0])


def quiet_clip(frames=100, words=(), **changes):
    """`frames` at 15 fps from second 10, the wrist moving; audio and spectrogram count upwards."""
    poses = np.concatenate([lively()] * 4)[:frames].astype(np.float16)
    clip = TedClip(
        words=tuple(words) or tuple(Word(str(i), 10 + i / 4, 10.2 + i / 4) for i in range(60)),
        poses=poses,
        spectrogram=np.tile(np.arange(spectrogram_columns(frames), dtype=np.float16), (128, 1)),
        audio=np.arange(round(frames / 15 * 16000), dtype=np.float32),
        start_frame=150,
        start_s=10.0,
        # as little less as keeps rounding from adding a frame
        end_s=10.0 + frames / 15 - 1e-9,
    )
    return replace(clip, **changes)


@pytest.mark.parametrize(("frames", "count"), [(41, 0), (42, 1), (51, 1), (52, 2), (100, 6)])
def test_number_of_windows(frames, count):
    cut = ClipWindows(quiet_clip(frames))
    assert len(cut) == frames
    assert [window.start for window in cut.windows] == [10 * i for i in range(count)]
    assert len(cut.kept) == count


def test_a_window_needs_two_words():
    # windows start at 10, 10.67, ... and last 2.8 s; a word that ends with its start is outside
    words = [Word("a", 9.5, 10.0), Word("b", 12.7, 13.0), Word("c", 12.8, 13.0)]
    cut = ClipWindows(quiet_clip(words=words))
    assert [len(window.words) for window in cut.windows] == [1, 2, 2, 2, 2, 0]
    assert cut.dropped() == {"words": 2}


def test_slices_start_by_the_share_of_the_clip_and_are_mirrored():
    audio = np.arange(50000, dtype=np.float32)
    spectrogram = np.tile(np.arange(104, dtype=np.float16), (128, 1))
    clip = quiet_clip(frames=52, audio=audio, spectrogram=spectrogram)
    last = list(cached_samples(clip, "v"))[1]
    first_sample, first_column = math.floor(10 / 52 * 50000), math.floor(10 / 52 * 104)
    there = 50000 - first_sample
    assert there < 44800
    np.testing.assert_array_equal(last.audio[:there], audio[first_sample:])
    np.testing.assert_array_equal(last.audio[there:], audio[::-1][: 44800 - there])
    expected = [*range(first_column, 104), 103, 102]
    np.testing.assert_array_equal(last.spectrogram, np.tile(expected, (128, 1)))


def test_aux_mixes_native_and_resampled_frames():
    samples = list(cached_samples(checked_clip(make_clip(6.0)), "abc"))
    assert samples[1].aux == {
        "vid": "abc",
        "start_frame_no": 75 + 10,
        "end_frame_no": 75 + 52,
        "start_time": 3 + 10 / 15,
        "end_time": 3 + 52 / 15,
        "is_correct_motion": True,
        "filtering_message": "PASS",
    }
    np.testing.assert_allclose(
        samples[1].directions + np.reshape(PUBLISHED_MEAN_DIRECTION, (9, 3)),
        direction_vectors(samples[1].poses),
    )


def test_what_the_published_code_stops_at():
    def kind(**changes):
        with pytest.raises(UnusableClipError) as caught:
            ClipWindows(quiet_clip(**changes))
        return caught.value.kind, str(caught.value)

    poses = quiet_clip().poses.copy()
    poses[30, 4, 1] = np.nan
    assert kind(poses=poses)[0] == "pose not a number"
    assert "pose 30 of 100 (2.00 s)" in kind(poses=poses)[1]
    spectrogram = quiet_clip().spectrogram
    assert spectrogram.shape[1] == 207
    assert kind(spectrogram=spectrogram[:, :201])[0] == "audio and motion differ in length"
    ClipWindows(quiet_clip(spectrogram=spectrogram[:, :202]))
    assert kind(poses=poses[:1])[0] == "no motion"
    assert kind(end_s=10.0)[0] == "times don't fit the frames"
    assert kind(end_s=1e8)[0] == "times don't fit the frames"
