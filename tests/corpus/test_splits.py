from collections import Counter

import pytest

from cospeech.corpus.splits import Span, published_spans, split_recordings, time_blocks
from cospeech.errors import ConfigError

SPEAKERS = [f"s{i % 8}" for i in range(40)]


def test_recordings_are_held_out_of_speakers_that_train():
    names = split_recordings(SPEAKERS, 0.1, 0.1, seed=3)
    assert Counter(names) == {"train": 32, "val": 4, "test": 4}
    training = {speaker for speaker, name in zip(SPEAKERS, names, strict=True) if name == "train"}
    assert training == set(SPEAKERS)


def test_speakers_are_held_out_whole():
    names = split_recordings(SPEAKERS, 0.125, 0.125, seed=3, held_out="speakers")
    sides = {
        split: {s for s, name in zip(SPEAKERS, names, strict=True) if name == split}
        for split in ("train", "val", "test")
    }
    assert [len(sides[split]) for split in ("train", "val", "test")] == [6, 1, 1]
    assert not sides["train"] & sides["val"]
    assert not sides["train"] & sides["test"]


def test_the_same_seed_gives_the_same_split():
    assert split_recordings(SPEAKERS, 0.1, 0.1, 5) == split_recordings(SPEAKERS, 0.1, 0.1, 5)
    assert split_recordings(SPEAKERS, 0.1, 0.1, 5) != split_recordings(SPEAKERS, 0.1, 0.1, 6)


def test_two_recordings_cannot_be_split_in_three():
    with pytest.raises(ConfigError, match="2 recordings") as caught:
        split_recordings(["a", "b"], 0.1, 0.1, 0)
    assert "time_blocks" in caught.value.hint


@pytest.mark.parametrize("shares", [(0.9, 0.5), (-0.1, 0.1), (10, 10)])
def test_shares_that_leave_nothing_to_train_on_are_named(shares):
    with pytest.raises(
        ConfigError, match=rf"val_share={shares[0]} and data.test_share={shares[1]}"
    ):
        split_recordings(["a"] * 50, *shares, seed=0)


def test_time_blocks_cover_a_take_without_overlap():
    spans = time_blocks([1000, 50], 0.2, 0.1, minimum=34)
    assert spans["train"] == [Span(0, 0, 700), Span(1, 0, 50)]
    assert spans["val"] == [Span(0, 700, 900)]
    assert spans["test"] == [Span(0, 900, 1000)]


def test_takes_too_short_for_blocks_are_an_error():
    with pytest.raises(ConfigError, match="34 frames"):
        time_blocks([60], 0.2, 0.2, minimum=34)


def test_published_splits_are_taken_as_they_are():
    spans = published_spans(["a", "b", "c"], ["train", "test", "val"], [5, 6, 7])
    assert spans == {"train": [Span(0, 0, 5)], "val": [Span(2, 0, 7)], "test": [Span(1, 0, 6)]}


def test_a_corpus_whose_test_part_is_kept_back_is_judged_on_validation(caplog):
    spans = published_spans(["a", "b"], ["train", "val"], [5, 6])
    assert spans["test"] == spans["val"] == [Span(1, 0, 6)]
    assert "validation split" in caplog.text


def test_a_recording_without_a_published_split_is_named():
    with pytest.raises(ConfigError, match=r"1 of 3 recordings.*b") as caught:
        published_spans(["a", "b", "c"], ["train", None, "val"], [5, 6, 7])
    assert "data.split=recordings" in caught.value.hint


def test_a_published_split_without_validation_says_how_to_make_one():
    with pytest.raises(ConfigError, match="no val recording"):
        published_spans(["a", "b"], ["train", "train"], [5, 6])
