"""Gesticulator's text features against the published ones."""

import json
import re

import numpy as np
import pytest

from cospeech.corpus.features.spoken_words import spoken_words
from cospeech.speech.speech import Speech, Word
from cospeech.speech.text.syllables import count_syllables
from tests.parity import formulas

JEREMY = "real/trinity/gesticulator_jeremy_howard.json"


class ByFormula:
    """The stand-in of the language model: numbers by call, piece and dimension."""

    version, dimensions = "formula", 768

    def __init__(self):
        self.calls = 1  # the published code asks for the fillers' first

    def vectors(self, words):
        is_filler = words[0].text == "eh"
        call = 0 if is_filler else self.calls
        self.calls += not is_filler
        vectors, piece = [], 0
        for word in words:
            runs = re.findall(r"\w+|[^\w\s]", word.text)
            count = sum(-(-len(run) // 5) for run in runs)
            pieces = np.arange(piece, piece + count)
            n = 100_000 * call + 768 * pieces[:, None] + np.arange(768)
            of_pieces = np.sin(formulas.quadratic(n, 7) + 0.5 * formulas.V).astype(np.float32)
            vectors.append(of_pieces.mean(axis=0))
            piece += count
        return np.array(vectors)


class Numbered:
    """A word's vector is its number among all words that were sent, by sentence; -2 of a filler."""

    version, dimensions = "numbered", 1

    def __init__(self):
        self.sentences = []

    def vectors(self, words):
        texts = [word.text for word in words]
        if texts[0] == "eh":
            return np.full((len(texts), 1), -2.0, dtype=np.float32)
        first = sum(map(len, self.sentences))
        self.sentences.append(texts)
        return np.arange(first, first + len(texts), dtype=np.float32)[:, None]


def transcript(path):
    words = []
    for segment in json.loads(path.read_text()):
        for word in segment["alternatives"][0].get("words", []):
            start, end = (float(word[key].rstrip("s")) for key in ("start_time", "end_time"))
            words.append(Word(word["word"], start, end))
    return tuple(words)


def assert_placed_as_published(name, words, expected):
    index = expected[f"text_{name}_word_index"]
    extras = expected[f"text_{name}_extras"].astype(np.float32)
    speech = Speech(np.zeros(1600 * len(index), dtype=np.float32), words)
    numbered = Numbered()
    values = spoken_words(numbered, published=True).of_speech(speech, 10.0)
    np.testing.assert_array_equal(np.where(values[:, 0] == -15, -1, values[:, 0]), index)
    np.testing.assert_array_equal(values[:, 1:], extras)
    sent = [word for sentence in numbered.sentences for word in sentence]
    assert sent == expected[f"text_{name}_words"].tolist()
    numbers = [i for i, sentence in enumerate(numbered.sentences) for _ in sentence]
    assert numbers == expected[f"text_{name}_sentence_of_word"].tolist()

    values = spoken_words(ByFormula(), published=True).of_speech(speech, 20.0)
    assert values.shape == (2 * len(index), 773)
    np.testing.assert_array_equal(values[::2], values[1::2])
    columns = expected[f"text_{name}_vec_cols_0_1_2_767"]
    np.testing.assert_allclose(values[::2, [0, 1, 2, 767]], columns, atol=1e-6)
    np.testing.assert_array_equal(values[::2, 768:], extras)


def test_awkward_words_are_placed_as_published():
    path = formulas.FOLDER / "gesticulator" / "transcript_odd.json"
    assert_placed_as_published("odd", transcript(path), formulas.expected("gesticulator"))


def test_a_real_transcript_is_placed_as_published(shared):
    path = shared / "data" / JEREMY
    with np.load(shared / "data/parity/gesticulator/expected.npz") as expected:
        assert_placed_as_published("jh", transcript(path), expected)


def test_syllables_are_counted_as_published():
    expected = formulas.expected("gesticulator")
    counted = [count_syllables(str(word)) for word in expected["syllable_words"]]
    assert counted == expected["syllable_counts"].tolist()


@pytest.mark.parametrize("name", ["three", "knee", "1984"])
def test_words_without_syllables_have_one_where_time_is_in_seconds(name):
    speech = Speech(np.zeros(16_000, dtype=np.float32), (Word(name, 0.2, 0.7),))
    values = spoken_words(ByFormula()).of_speech(speech, 20.0)
    assert count_syllables(name) == 0
    np.testing.assert_allclose(values[4:14, -1], 2.0)
    np.testing.assert_allclose(values[4, -5:], [0, 0.5, 0.5, 0, 2], atol=1e-6)
    np.testing.assert_allclose(values[13, -5:-1], [0.45, 0.05, 0.5, 0.9], atol=1e-6)
    assert (values[[3, 14], :768] == -15).all()
    assert (values[[3, 14], 768:] == 0).all()
