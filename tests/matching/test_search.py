"""The fast search against the paper's loops, and what follows from its definition."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cospeech.errors import ConfigError
from cospeech.matching.leading import LeadingCoordinates
from cospeech.matching.reference import search_reference
from cospeech.matching.search import MatchingSearch, Query
from tests.matching.databases import from_features, make_database


def by_reference(search, query):
    return search_reference(
        search.database,
        query.pose,
        query.audio,
        k=query.k,
        step=search.step,
        preselect=search.preselect,
        mask=query.mask,
        standing_on=query.standing_on,
        goes_on=query.goes_on,
        start_offset=search.start_offset,
    )


def random_query(rng, database, mask=None, most=16):
    sequences, frames = database.usable.shape
    standing_on = int(rng.integers(sequences)), int(rng.integers(frames))
    audio = database.audio_features[rng.integers(sequences), rng.integers(frames)]
    audio = audio + rng.normal(size=len(audio)).astype(np.float32) * rng.choice([0, 0.3, 2])
    goes_on = (standing_on[0], standing_on[1] + 1) if rng.random() < 0.3 else None
    k = int(rng.integers(1, most))
    return Query(
        database.pose_features[standing_on], audio.astype("f4"), k, mask, standing_on, (), goes_on
    )


@pytest.mark.parametrize(
    ("preselect", "queries"), [("pose", 300), ("audio", 100), ("pose_only", 100)]
)
def test_random_queries_give_what_the_loops_give(preselect, queries):
    rng = np.random.default_rng(1)
    database = make_database(24, seed=2)
    database.usable[rng.random(database.usable.shape) < 0.05] = False
    search = MatchingSearch(database, preselect=preselect, threads=2)
    every = [random_query(rng, database) for _ in range(queries)]
    expected = [by_reference(search, query) for query in every]
    assert search.answer(every) == expected
    assert [search(query) for query in every[:40]] == expected[:40]
    assert len({match.sequence for match in expected}) > 10


@pytest.mark.parametrize("start_offset", [0, 1])
def test_under_random_masks(start_offset):
    rng = np.random.default_rng(3)
    database = make_database(16, seed=4)
    search = MatchingSearch(database, start_offset=start_offset, threads=1)
    every = []
    for share in (0.02, 0.15, 0.5, 0.85):
        mask = rng.random(database.usable.shape) < share
        every += [random_query(rng, database, mask) for _ in range(20)]
        sequences = rng.random(len(database)) < 0.3
        every.append(every[-1]._replace(mask=mask & sequences[:, None]))
    expected = [by_reference(search, query) for query in every]
    assert search.answer(every) == expected
    assert [search(query) for query in every[:30]] == expected[:30]
    assert min(match.candidates for match in expected) < 10


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), preselect=st.sampled_from(["pose", "audio", "pose_only"]))
def test_ties_fall_as_in_the_loops(seed, preselect):
    # Features of few whole numbers: most distances are shared, whole sequences are copies.
    rng = np.random.default_rng(seed)
    sequences, frames, step = int(rng.integers(1, 12)), int(rng.integers(3, 12)), 3
    pose = rng.integers(-1, 2, (sequences, frames, 8))
    audio = rng.integers(-1, 2, (sequences, frames, 8))
    copied = rng.integers(sequences, size=sequences)
    database = from_features(pose[copied], audio[copied])
    search = MatchingSearch(database, step, preselect, threads=1)
    mask = rng.random(database.usable.shape) < 0.7
    every = [random_query(rng, database, m, 20) for m in (None, mask) for _ in range(5)]
    assert search.answer(every) == [by_reference(search, query) for query in every]
    assert search(every[0]) == by_reference(search, every[0])


def test_poses_that_stand_still_and_silence():
    database = make_database(12, seed=5)
    database.pose_features[:, 20:50] = database.pose_features[:, 20:21]
    database.pose_features[6:] = database.pose_features[:6]
    database.audio_features[::2, 10:40] = 0
    rng = np.random.default_rng(6)
    silent = [random_query(rng, database) for _ in range(40)]
    silent += [query._replace(audio=np.zeros(112, "f4")) for query in silent[:10]]
    for preselect in ("pose", "audio", "pose_only"):
        search = MatchingSearch(database, preselect=preselect)
        assert search.answer(silent) == [by_reference(search, query) for query in silent]


@pytest.mark.parametrize("preselect", ["pose", "audio", "pose_only"])
def test_orders_that_only_double_precision_tells(preselect):
    # Rows that differ in a last digit here and there: what is near is near to within rounding.
    rng = np.random.default_rng(11)
    features = []
    for size in (96, 112):
        rows = np.broadcast_to(rng.normal(size=size).astype("f4"), (60, 64, size)).copy()
        changed = rng.random(rows.shape) < 0.05
        rows[changed] = np.nextafter(rows[changed], np.float32(np.inf))
        features.append(rows)
    database = from_features(*features)
    search = MatchingSearch(database, preselect=preselect)
    # Where nothing is heard exactly: double precision can't tell cosines of nearly 1 either.
    every = [random_query(rng, database) for _ in range(30)]
    every = [query._replace(audio=rng.normal(size=112).astype("f4")) for query in every]
    every += [query._replace(pose=rng.normal(size=96).astype("f4")) for query in every[:10]]
    expected = [by_reference(search, query) for query in every]
    assert search.answer(every) == expected
    assert [search(query) for query in every] == expected
    assert len({match.sequence for match in expected}) > 10


@pytest.mark.parametrize("is_audio", [False, True])
def test_bounds_hold_and_are_narrow(is_audio):
    rng = np.random.default_rng(12)
    turned = rng.normal(size=(30, 20, 96)) * 0.85 ** np.arange(96)
    rows = (turned @ np.linalg.qr(rng.normal(size=(96, 96)))[0] * 5).astype("f4")
    by = np.linalg.norm(rows.astype("f8"), axis=2) if is_audio else np.ones((30, 20))
    leading = LeadingCoordinates(rows, by, np.ones((30, 20), dtype=bool), is_audio)
    queries = rows[rng.integers(30, size=50), rng.integers(20, size=50)] + rng.normal(size=96)
    bounds = leading.bounds(queries)
    coordinates = bounds.coordinates[:, :, :20].astype("f8")
    sums = np.einsum("bl,mls->bms", bounds.vectors.astype("f8"), coordinates)
    low = bounds.halves[:, :20] + sums + bounds.offsets[:, None, None]
    width = -2 * bounds.vectors[:, bounds.rest, None, None] * (coordinates[:, bounds.rest] + 0.5)
    scaled = queries / np.linalg.norm(queries, axis=1, keepdims=True) if is_audio else queries
    half = ((rows / by[..., None] - scaled[:, None, None]) ** 2).sum(axis=-1) / 2
    slack = bounds.slack[:, None, None]
    assert (low - slack <= half).all()
    assert (half <= low + width + slack).all()
    assert np.median(width + 2 * slack) < 0.02 * np.median(half)


def test_one_silent_frame_is_far_from_everything():
    # A row without a direction is at distance 1, not half of that as its length would have it.
    database = make_database(12, seed=13)
    rng = np.random.default_rng(14)
    database.audio_features[np.arange(12), rng.integers(5, 50, 12)] = 0
    search = MatchingSearch(database, preselect="audio")
    every = [random_query(rng, database) for _ in range(20)]
    every += [query._replace(audio=np.zeros(112, "f4")) for query in every[:10]]
    assert search.answer(every) == [by_reference(search, query) for query in every]


def test_more_candidates_asked_for_than_there_are():
    database = make_database(5)
    search = MatchingSearch(database)
    query = random_query(np.random.default_rng(0), database)
    last = search(query._replace(k=5))
    assert search(query._replace(k=99)) == last == by_reference(search, query._replace(k=99))
    chosen = {search(query._replace(k=k)).sequence for k in range(1, 6)}
    assert chosen == set(range(5))


def test_a_sequence_alone():
    database = make_database(1)
    search = MatchingSearch(database)
    query = Query(database.pose_features[0, 30], database.audio_features[0, 3], 1, None, (0, 30))
    # Motion is smooth, so a neighbour of the frame itself is nearest.
    assert search(query) in {(0, 29, 1), (0, 31, 1)}
    assert search(query._replace(standing_on=None)) == (0, 30, 1)
    assert search(query._replace(closed=(0,))) == (-1, -1, 0)


def test_a_mask_of_ones_is_none_and_a_mask_of_one_window_leaves_it():
    database = make_database(10)
    search = MatchingSearch(database)
    rng = np.random.default_rng(7)
    ones = np.ones(database.usable.shape, dtype=bool)
    window = np.zeros_like(ones)
    window[[4, 4], [11, 18]] = True
    for _ in range(20):
        query = random_query(rng, database)._replace(goes_on=None)
        assert search(query._replace(mask=ones)) == search(query)
        if query.standing_on != (4, 11):
            assert search(query._replace(mask=window)) == (4, 11, 1)
    assert search.eligible(window).sum() == 1
    assert search(query._replace(mask=np.zeros_like(ones))) == (-1, -1, 0)


def test_closed_sequences_and_the_window_that_goes_on():
    database = make_database(10)
    search = MatchingSearch(database)
    query = Query(database.pose_features[3, 20], database.audio_features[3, 21], 1, None, (3, 20))
    assert search(query).sequence == 3
    assert search(query._replace(goes_on=(3, 40), closed=range(3))).candidates == 7
    only = [m for m in range(10) if m != 3]
    assert search(query._replace(goes_on=(3, 40), closed=only)) == (3, 40, 1)
    # A window that isn't eligible is not forced.
    assert search(query._replace(goes_on=(3, 60), closed=only)).frame in (19, 21)


@pytest.mark.parametrize(("step", "frames"), [(0, 16), (17, 16), (8, 65)])
def test_windows_that_cannot_be(step, frames):
    with pytest.raises(ConfigError, match="frames"):
        MatchingSearch(make_database(2, frames, pose_size=8, audio_size=8), step)


def test_unusable_starts_are_never_chosen():
    database = dataclasses.replace(make_database(4), usable=np.zeros((4, 64), dtype=bool))
    database.usable[2, 5] = True
    query = random_query(np.random.default_rng(0), database)
    assert MatchingSearch(database)(query) == (2, 5, 1)
