"""The words of a plain text on the frames of a speech."""

import numpy as np
import pytest

from cospeech.corpus.features.spoken_words import spoken_words
from cospeech.speech.reading import read_speech
from tests.fabricated.sound import save_wav

TEXT = "Look, three little words. And knee after knee, they go on to the very end!"
LETTERS = [4, 5, 6, 5, 3, 4, 5, 4, 4, 2, 2, 2, 3, 4, 3]


class Numbers:
    """A word's vector is its number among the words, from 0 on, and its letters; twice."""

    dimensions, version = 2, "numbers"

    def __init__(self):
        self.asked = 0

    def vectors(self, words):
        """Counted through, as sentences are asked for one after another."""
        first, self.asked = self.asked, self.asked + len(words)
        return np.array([[first + i, len(word.text)] for i, word in enumerate(words)], np.float32)


@pytest.mark.parametrize("published", [False, True])
def test_a_plain_text_fills_the_speech_at_full_speed(tmp_path, published):
    """The published path for plain text says half of the words, at half their speed."""
    seconds = 11.5
    save_wav(tmp_path / "a.wav", np.zeros(round(16_000 * seconds), np.float32))
    (tmp_path / "a.txt").write_text(TEXT)
    speech = read_speech(tmp_path / "a.wav", tmp_path / "a.txt")
    values = spoken_words(Numbers(), published).of_speech(speech, 20.0)
    assert len(values) == 230
    edges_s = np.concatenate([[0], np.cumsum(LETTERS)]) * seconds / sum(LETTERS)
    unit_s, rows_per_s = (0.1, 10) if published else (1.0, 20)
    onsets = np.floor(edges_s[:-1] * rows_per_s)
    said = onsets.searchsorted(np.arange(230) // (20 // rows_per_s), side="right") - 1
    np.testing.assert_array_equal(values[:, 0], said)
    assert set(said) == set(range(15)), "every word is said"
    durations_s = values[:, -3] * unit_s
    np.testing.assert_allclose(durations_s, np.diff(edges_s)[said], atol=0.1 if published else 1e-5)
    # "three" has no syllable by the published rule; in seconds it counts one.
    rates = values[said == 1, -1] / unit_s
    np.testing.assert_allclose(rates, 0 if published else 1 / durations_s[said == 1], rtol=1e-5)
