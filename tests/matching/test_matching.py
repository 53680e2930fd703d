"""Clips put together from a database."""

import numpy as np
import pytest
import torch

from cospeech.errors import CospeechError
from cospeech.matching.matching import Clip, match, match_together
from cospeech.matching.reference import search_reference
from cospeech.matching.search import MatchingSearch
from tests.matching.databases import make_database


def seeded(seed=0):
    return torch.Generator().manual_seed(seed)


def speech(frames=30, seed=0):
    return np.random.default_rng(seed).normal(size=(frames, 112)).astype(np.float32)


def test_a_clip_is_the_loop_of_the_paper():
    database = make_database(12)
    search = MatchingSearch(database)
    audio = speech(30)
    matched = match(search, Clip(audio, k=3, from_mean_pose=True))
    pose, standing_on = np.zeros(96, "f4"), None
    for step in range(4):
        found = search_reference(database, pose, audio[8 * step], k=3, standing_on=standing_on)
        assert (matched.sequences[step], matched.frames[step]) == found[:2]
        standing_on = found.sequence, found.frame + 7
        pose = database.pose_features[standing_on]
    # 30 frames are three whole windows and six frames of the fourth.
    assert matched.poses.shape == (30, 2, 3)
    for t in (0, 7, 8, 29):
        expected = [matched.sequences[t // 8], matched.frames[t // 8] + t % 8, 0]
        assert matched.poses[t, 0].tolist() == expected


def test_a_seed_gives_the_same_clip_and_another_seed_another():
    search = MatchingSearch(make_database(30))
    clip = Clip(speech(80))
    first, again, other = (match(search, clip, seeded(seed)) for seed in (1, 1, 2))
    assert first.sequences.tolist() == again.sequences.tolist()
    assert (first.sequences[0], first.frames[0]) != (other.sequences[0], other.frames[0])


def test_clips_together_are_as_each_alone():
    search = MatchingSearch(make_database(20))
    clips = [
        Clip(speech(8 * n + n, seed=n), k=n + 1, closed=(n,), from_mean_pose=True)
        for n in range(10)
    ]
    together = match_together(search, clips)
    for clip, matched in zip(clips, together, strict=True):
        alone = match(search, clip)
        np.testing.assert_array_equal(matched.poses, alone.poses)
        assert len(matched.poses) == len(clip.audio)
        assert not set(clip.closed) & set(matched.sequences.tolist())


def test_masks_change_from_step_to_step():
    database = make_database(6)
    search = MatchingSearch(database)
    left, right = (np.zeros((6, 64), dtype=bool) for _ in range(2))
    left[:3], right[3:] = True, True
    matched = match(search, Clip(speech(32), masks=[left, right, None, left]), seeded())
    assert matched.sequences[0] < 3 <= matched.sequences[1]
    assert matched.sequences[3] < 3


def test_a_single_window_repeats_and_an_empty_mask_says_where():
    database = make_database(6)
    search = MatchingSearch(database)
    window = np.zeros((6, 64), dtype=bool)
    window[[2, 2], [10, 17]] = True
    matched = match(search, Clip(speech(24), masks=window, from_mean_pose=True))
    assert matched.sequences.tolist() == [2, 2, 2]
    assert matched.frames.tolist() == [10, 10, 10]
    empty = np.zeros_like(window)
    with pytest.raises(CospeechError, match=r"step 1 \(0.53 s\)"):
        match(search, Clip(speech(24), masks=[None, empty, None], from_mean_pose=True))
    with pytest.raises(CospeechError, match="first pose"):
        match(search, Clip(speech(24), masks=empty), seeded())


def test_windows_may_begin_a_frame_later_and_go_on_where_they_were():
    database = make_database(1)
    start = np.zeros((1, 64), dtype=bool)
    start[0, [11, 18]] = True
    search = MatchingSearch(database, start_offset=1)
    clip = Clip(speech(32), masks=[start, None, None, None], from_mean_pose=True)
    matched = match(search, clip, natural_continuation=True)
    # What is compared is frame 10, what is shown begins after it, and no seam shows a frame twice.
    assert matched.frames.tolist() == [11, 19, 27, 35]
    assert matched.poses[:, 0, 1].tolist() == list(range(11, 43))
    published = match(MatchingSearch(database), clip)
    assert published.frames[0] == 11
    assert published.frames[1] in (17, 19)
    favoured = match(MatchingSearch(database), clip, natural_continuation=True)
    assert favoured.frames.tolist() == [11, 19, 27, 35]


def test_no_speech_gives_no_motion():
    assert match(MatchingSearch(make_database(2)), Clip(speech(0)), seeded()).poses.shape == (
        0,
        2,
        3,
    )


def test_a_single_window_that_it_stands_on_is_used_again():
    database = make_database(4)
    mask = np.zeros((4, 64), dtype=bool)
    mask[2, 10] = mask[2, 17] = True
    for seed in range(20):
        matched = match(MatchingSearch(database), Clip(speech(40), mask), seeded(seed))
        assert set(matched.sequences) == {2}
        assert set(matched.frames) == {10}


def test_first_poses_are_drawn_where_they_may_be():
    database = make_database(200)
    mask = np.zeros((200, 64), dtype=bool)
    mask[[7, 90]] = True
    search = MatchingSearch(database)
    first = [
        match(search, Clip(speech(8), mask, closed=np.array([90])), seeded(seed)).sequences[0]
        for seed in range(5)
    ]
    assert first == [7] * 5


@pytest.mark.parametrize("offset", [0, 1])
def test_no_window_begins_with_the_frame_shown_last(offset):
    # Slow poses: the nearest frame is always a neighbour of the one that is stood on.
    database = make_database(6, seed=3)
    search = MatchingSearch(database, preselect="pose_only", start_offset=offset)
    matched = match(search, Clip(speech(200)), seeded(4))
    last = list(zip(matched.sequences, matched.frames + 7, strict=True))[:-1]
    first = list(zip(matched.sequences, matched.frames, strict=True))[1:]
    assert all(a != b for a, b in zip(last, first, strict=True))
