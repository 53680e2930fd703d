"""Vocabulary and frame alignment against docs/facts/trimodal.md, sections 3.4, 3.7 and 3.8, and a
brute-force loop."""

import json
from math import floor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cospeech.speech.vocabulary import (
    UNK,
    Vocabulary,
    evenly_placed_words,
    frame_aligned_words,
    normalise_word,
)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Hello", "hello"),
        ("don't", "dont"),
        ("it\u2019s", "its"),
        ("Café,", "cafe"),
        ("NAÏVE!", "naive"),
        ("well-known", "well known"),
        ("a lot. ", "a lot"),
        ("#laugh#", "laugh"),
        ("snake_case", "snake case"),
        ("1984", "1984"),
        ("3.14%", "3 14"),
        ("...", ""),
        ("\u266a", ""),
        ("", ""),
        ("İstanbul", "istanbul"),
        ("飲食", "飲食"),
        ("たばこ", "たばこ"),  # ば decomposes into は and a mark that is no accent
        ("한국", "한국"),
        ("й", "й"),
    ],
)
def test_words_are_normalised_as_the_published_builder_does(text, expected):
    assert normalise_word(text) == expected


@given(st.text(max_size=20))
def test_normalising_twice_changes_nothing(text):
    once = normalise_word(text)
    assert normalise_word(once) == once


def test_ids_follow_first_occurrence_after_the_special_tokens():
    vocabulary = Vocabulary.build(["So", "the", "so", "...", "Don't", "the", "café"])
    assert vocabulary.words == [
        "<PAD>", "<SOS>", "<EOS>", "<UNK>", "so", "the", "dont", "cafe",
    ]  # fmt: skip
    assert len(vocabulary) == 8
    encoded = [vocabulary.encode(word) for word in ("SO", "don't", "Café!", "unheard", "")]
    assert encoded == [4, 6, 7, UNK, UNK]


def test_the_published_lookup_is_case_sensitive():
    vocabulary = Vocabulary.build(["hello"])
    assert vocabulary.encode("Hello") == 4
    assert vocabulary.encode("Hello", fold_case=False) == UNK
    assert vocabulary.encode("hello", fold_case=False) == 4


def test_speech_can_not_name_a_special_token():
    vocabulary = Vocabulary.build(["<PAD>", "pad"])
    assert vocabulary.words[4:] == ["pad"]
    assert vocabulary.encode("<PAD>", fold_case=False) == UNK


def test_vocabulary_survives_json():
    vocabulary = Vocabulary.build(["naïve", "は", "gesture"])
    assert Vocabulary(json.loads(json.dumps(vocabulary.words))) == vocabulary


def test_it_refuses_what_is_no_vocabulary():
    with pytest.raises(ValueError, match="begins with <PAD>"):
        Vocabulary(["the", "and"])
    with pytest.raises(ValueError, match="'the' is twice"):
        Vocabulary(["<PAD>", "<SOS>", "<EOS>", "<UNK>", "the", "and", "the"])


def test_words_land_on_their_onset_frames():
    # window from 10 s, 34 frames at 15 fps: frame i begins at 10 + i/15
    starts = [9.2, 10.05, 10.07, 11.01, 12.25, 12.27, 99.0]
    aligned = frame_aligned_words(starts, [4, 5, 6, 7, 8, 9, 10], 10.0, 34, 15.0)
    expected = np.zeros(34, dtype=np.int64)
    expected[0] = 5  # 4 began before the window and is overwritten: 0.05 s is frame 0 too
    expected[1] = 6  # 0.07 * 15 = 1.05
    expected[15] = 7  # 1.01 * 15 = 15.15
    expected[33] = 8  # 2.25 * 15 = 33.75; 2.27 s would be frame 34
    np.testing.assert_array_equal(aligned, expected)
    assert aligned.dtype == np.int64


@given(
    st.lists(st.floats(-3, 30, allow_nan=False), max_size=40).map(sorted),
    st.floats(0, 20),
    st.integers(1, 120),
    st.sampled_from([10.0, 12.5, 15.0, 20.0, 29.97]),
)
def test_alignment_equals_the_loop_of_the_specification(starts, window_start_s, frames, fps):
    ids = list(range(4, 4 + len(starts)))
    expected = np.zeros(frames, dtype=np.int64)
    for start, index in zip(starts, ids, strict=True):
        frame = max(0, floor((start - window_start_s) / (frames / fps / frames)))
        if frame < frames:
            expected[frame] = index
    aligned = frame_aligned_words(starts, ids, window_start_s, frames, fps)
    np.testing.assert_array_equal(aligned, expected)


def test_no_words_are_all_padding():
    np.testing.assert_array_equal(frame_aligned_words([], [], 0.0, 5, 15.0), np.zeros(5))
    np.testing.assert_array_equal(evenly_placed_words([], 5), np.zeros(5))


def test_onsets_and_ids_must_pair_up():
    with pytest.raises(ValueError, match=r"\(2,\) onsets for \(1,\)"):
        frame_aligned_words([0.0, 1.0], [4], 0.0, 34, 15.0)


def test_evenly_placed_words_divide_the_window():
    placed = evenly_placed_words([7, 8, 9], 34)  # floor(34 / 4) = 8
    assert {int(i): int(placed[i]) for i in placed.nonzero()[0]} == {8: 7, 16: 8, 24: 9}


def test_more_words_than_frames_leave_the_last_on_frame_0():
    np.testing.assert_array_equal(evenly_placed_words([4, 5, 6], 3), [6, 0, 0])
