"""Word vectors from hand-made fastText files; hashes and sub-words worked out independently."""

import logging

import numpy as np
import pytest

from cospeech.errors import InputFileError
from cospeech.speech.fasttext_binary import FastTextModel, fnv1a, ngram_buckets
from cospeech.speech.vocabulary import Vocabulary
from cospeech.speech.word_vectors import find_word_vectors, load_word_vectors
from tests.fabricated.fasttext import BUCKETS, LONGEST, SHORTEST, write_fasttext_model

DIMENSIONS = 4
DICTIONARY = ["</s>", "the", "gesture", "naïve"]


def write_model(path, matrix, words=DICTIONARY, **changes):
    return write_fasttext_model(path, matrix, words, **changes)


@pytest.fixture
def matrix():
    shape = (len(DICTIONARY) + BUCKETS, DIMENSIONS)
    return np.random.default_rng(3).normal(size=shape).astype(np.float32)


@pytest.fixture
def model_file(tmp_path, matrix):
    return write_model(tmp_path / "model.bin", matrix)


# FNV-1a test vectors of the algorithm's authors (isthe.com/chongo/tech/comp/fnv), 32 bit
@pytest.mark.parametrize(
    ("text", "value"),
    [(b"", 0x811C9DC5), (b"a", 0xE40C292C), (b"b", 0xE70C2DE5), (b"foobar", 0xBF9CF968)],
)
def test_hash_has_the_published_test_vectors(text, value):
    assert fnv1a(text) == value


def test_hash_extends_the_sign_of_high_bytes():
    # by hand: 0x811C9DC5 xor 0xFFFFFFC3 = 0x7EE36206, times 0x01000193 modulo 2**32
    assert fnv1a(b"\xc3") == 0x7EE36206 * 0x01000193 % 2**32
    assert fnv1a(b"\xc3") != (0x811C9DC5 ^ 0xC3) * 0x01000193 % 2**32


def test_ngrams_are_those_of_the_documentation():
    # the fastText documentation's example: "where" has the trigrams <wh whe her ere re>
    grams = [b"<wh", b"whe", b"her", b"ere", b"re>"]
    assert sorted(ngram_buckets("where", 10**6, 3, 3)) == sorted(fnv1a(g) % 10**6 for g in grams)


def test_ngrams_count_letters_not_bytes_and_skip_bare_end_marks():
    grams = ["é", "é>", "<é"]
    expected = sorted(fnv1a(gram.encode()) % 997 for gram in grams)
    assert sorted(ngram_buckets("é", 997, 1, 2)) == expected


def mean_by_hand(matrix, word):
    """As the C++ code walks it: byte by byte over <word>, letters of one to four bytes."""
    marked = f"<{word}>".encode()
    rows = [DICTIONARY.index(word)] if word in DICTIONARY else []
    for start in range(len(marked)):
        if marked[start] & 0xC0 == 0x80:
            continue
        stop, length = start, 1
        while stop < len(marked) and length <= LONGEST:
            stop += 1
            while stop < len(marked) and marked[stop] & 0xC0 == 0x80:
                stop += 1
            if length >= SHORTEST:
                value = 2166136261
                for byte in np.frombuffer(marked[start:stop], dtype=np.int8):
                    value = ((value ^ (int(byte) & 0xFFFFFFFF)) * 16777619) & 0xFFFFFFFF
                rows.append(len(DICTIONARY) + value % BUCKETS)
            length += 1
    return matrix[rows].mean(axis=0)


def test_binary_vectors_are_means_of_word_and_subwords(model_file, matrix):
    words = Vocabulary.build(["the", "gesture", "gesturing", "unheard"]).words
    vectors = load_word_vectors(model_file, words, seed=0)
    assert vectors.shape == (8, DIMENSIONS)
    assert vectors.dtype == np.float32
    for index in range(4, 8):
        np.testing.assert_allclose(vectors[index], mean_by_hand(matrix, words[index]), rtol=1e-5)


def test_binary_handles_accents_and_the_end_of_sentence(model_file, matrix):
    model = FastTextModel.open(model_file, {"naïve", "</s>"})
    naive, end_of_sentence = model.vector("naïve"), model.vector("</s>")
    assert naive is not None
    np.testing.assert_allclose(naive, mean_by_hand(matrix, "naïve"), rtol=1e-5)
    assert end_of_sentence is not None
    np.testing.assert_array_equal(end_of_sentence, matrix[0])


def test_finding_leaves_out_what_the_file_does_not_know(tmp_path, model_file, matrix):
    dimensions, found = find_word_vectors(model_file, ["Gesture", "the", "x"])
    assert (dimensions, list(found)) == (DIMENSIONS, ["Gesture", "the", "x"])
    np.testing.assert_allclose(found["Gesture"], mean_by_hand(matrix, "Gesture"), rtol=1e-5)
    whole_words = write_model(tmp_path / "m.bin", matrix[:4], buckets=0, longest=0)
    _, found = find_word_vectors(whole_words, ["Gesture", "the"])
    assert list(found) == ["the"]
    text = tmp_path / "crawl.vec"
    table = write_text_vectors(text, ["the", "Gesture"])
    dimensions, found = find_word_vectors(text, ["Gesture", "unheard"])
    assert (dimensions, list(found)) == (300, ["Gesture"])
    np.testing.assert_array_equal(found["Gesture"], table[1].astype(np.float32))


def test_binary_without_subwords_knows_whole_words_only(tmp_path, matrix, caplog):
    path = write_model(tmp_path / "m.bin", matrix[:4], buckets=0, longest=0)
    with caplog.at_level(logging.WARNING):
        vectors = load_word_vectors(path, ["the", "unheard"], seed=1)
    np.testing.assert_array_equal(vectors[0], matrix[1])
    assert "1 of 2 words; random ones for the rest, e.g. unheard" in caplog.text


def test_labels_are_no_words(tmp_path, matrix):
    path = write_model(tmp_path / "m.bin", matrix, kind=3, labels=["__label__joy"])
    assert FastTextModel.open(path, {"__label__joy"}).word_rows == {}


def test_matrix_stays_on_disk(model_file):
    assert isinstance(FastTextModel.open(model_file, set()).rows, np.memmap)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"quantised": 1}, "quantised"),
        ({"pruned": 0}, "quantised"),
        ({"version": 99}, "version 99"),
        ({"dimensions": 10**9}, "1000000000 dimensions"),
        ({"buckets": -1}, "-1 buckets"),
        ({"longest": 10**6}, "n-grams of 1000000 letters"),
        ({"height": 10**12}, "an input matrix of 1000000000000 x 4"),
        ({"size": 2**31 - 1}, "2147483647 words"),
        ({"size": 1000}, "the dictionary is broken|inside|claims|missing"),
    ],
)
def test_implausible_headers_are_refused(tmp_path, matrix, changes, message):
    path = write_model(tmp_path / "m.bin", matrix, **changes)
    with pytest.raises(InputFileError, match=message):
        load_word_vectors(path, ["the"], seed=0)


def test_every_truncation_is_an_input_file_error(tmp_path, model_file, matrix):
    whole = model_file.read_bytes()
    needed = len(whole) - (17 + 4 * len(DICTIONARY) * DIMENSIONS)  # all but the output matrix
    for size in [4, 30, 63, 64, 90, 91, 100, 140, 160, needed - 1]:
        path = tmp_path / "cut.bin"
        path.write_bytes(whole[:size])
        with pytest.raises(InputFileError, match=r"cut\.bin"):
            load_word_vectors(path, ["the"], seed=0)


def write_text_vectors(path, words, dimensions=300, declared=None):
    table = np.random.default_rng(5).normal(size=(len(words), dimensions)).round(4)
    with path.open("w") as file:
        file.write(f"{declared or len(words)} {dimensions}\n")
        for word, row in zip(words, table, strict=True):
            file.write(f"{word} {' '.join(f'{value:.4f}' for value in row)} \n")
    return table


def test_text_vectors_are_read_as_written(tmp_path):
    path = tmp_path / "crawl.vec"
    table = write_text_vectors(path, [",", "the", "gesture", "naïve", "The"])
    words = Vocabulary.build(["gesture", "the"]).words
    vectors = load_word_vectors(path, words, seed=0)
    assert vectors.shape == (6, 300)
    np.testing.assert_array_equal(vectors[4:], table[[2, 1]].astype(np.float32))


def test_draws_have_the_published_spread_and_follow_the_seed(tmp_path, caplog):
    path = tmp_path / "crawl.vec"
    table = write_text_vectors(path, ["the"])
    words = [*Vocabulary.build(["the"]).words, *(f"unheard{i}" for i in range(400))]
    with caplog.at_level(logging.WARNING):
        vectors = load_word_vectors(path, words, seed=7)
    draws = np.delete(vectors, 4, axis=0)
    assert draws.std() == pytest.approx(np.sqrt(1 / 300), rel=0.01)
    assert draws.mean() == pytest.approx(0, abs=1e-3)
    assert "vectors for 1 of 401 words" in caplog.text
    np.testing.assert_array_equal(load_word_vectors(path, words, seed=7), vectors)
    other = load_word_vectors(path, words, seed=8)
    np.testing.assert_array_equal(other[4], table[0].astype(np.float32))
    assert (np.delete(other, 4, axis=0) != draws).any(axis=1).all()


def test_a_missing_word_does_not_move_the_draws_of_others(tmp_path):
    path = tmp_path / "crawl.vec"
    write_text_vectors(path, ["the", "and"])
    some = load_word_vectors(path, ["the", "unheard", "zzz"], seed=0)
    others = load_word_vectors(path, ["qqq", "and", "zzz"], seed=0)
    np.testing.assert_array_equal(some[2], others[2])


def test_reading_stops_once_every_word_is_found(tmp_path):
    path = tmp_path / "crawl.vec"
    write_text_vectors(path, ["the", "and"], declared=2_000_000)
    assert load_word_vectors(path, ["and"], seed=0).shape == (1, 300)
    with pytest.raises(InputFileError, match=r"ends after 2 of 2000000 words.*\n.*incomplete"):
        load_word_vectors(path, ["unheard"], seed=0)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"the 0.1 0.2\n", "does not begin with a word count"),
        (b"2 3\nthe 1 2\nand 1 2 3\n", r"line 2: expected a word and 3 finite numbers"),
        (b"2 3\nand 1 2 3\nthe 1 nan 3\n", r"line 3: expected"),
        (b"2 3\nthe 1 two 3\n", r"line 2: expected"),
        (b"2 99999999\nthe 1\n", "does not begin"),
        (b"PK\x03\x04rest", "is compressed\n  -> unzip"),
        (b"\x80\x04\x95pickle", "does not begin"),
        (b"", "does not begin"),
    ],
)
def test_broken_text_vectors_name_the_line(tmp_path, content, message):
    path = tmp_path / "bad.vec"
    path.write_bytes(content)
    with pytest.raises(InputFileError, match=message):
        load_word_vectors(path, ["the"], seed=0)


def test_missing_file_says_what_to_get(tmp_path):
    with pytest.raises(InputFileError, match=r"no such word vectors\n  -> download"):
        load_word_vectors(tmp_path / "none.bin", ["the"], seed=0)
