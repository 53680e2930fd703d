"""Which words a stream takes, whatever the method."""

import math

import numpy as np
import pytest

from cospeech.errors import CospeechError
from cospeech.methods.streams import WholeUtterance
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.speech.speech import SAMPLE_RATE, Word

SECOND = np.zeros(SAMPLE_RATE, np.float32)


class Hearing:
    """A stream, and the words that its method was given."""

    def __init__(self):
        self.words = None
        self.stream = WholeUtterance(self.make)

    def make(self, speech):
        self.words = speech.words
        return Motion(UPPER_BODY, 15.0, np.zeros((1, 10, 3), np.float32))


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("hi", "a list of words, not a str"),
        (3, "a list of words, not a int"),
        (["hi"], "word 1 of this push is a str"),
        ([Word("so", 0, 1), None], "word 2 of this push is a NoneType"),
        ([Word(None, 0, 1)], "the text of word 1 of this push is a NoneType"),
        ([Word("n", math.nan, 1)], "'n', is said from nan to 1"),
        ([Word("n", 0, math.inf)], "'n', is said from 0 to inf"),
        ([Word("n", None, 1)], "'n', is said from None to 1"),
        ([Word("n", 0.5, 0.25)], "'n', is said from 0.5 to 0.25"),
    ],
)
def test_what_is_no_word_is_refused_and_the_stream_goes_on(words, told):
    hearing = Hearing()
    with pytest.raises(CospeechError, match=told) as caught:
        hearing.stream.push(SECOND, words)
    assert "\n" not in caught.value.problem
    assert "Word(text, start, end)" in caught.value.hint
    hearing.stream.push(SECOND, [Word("so", np.float32(0.5), 1)])
    hearing.stream.finish()
    assert [word.text for word in hearing.words] == ["so"]


def test_a_word_that_comes_after_its_sound_is_refused_with_both_times():
    hearing = Hearing()
    hearing.stream.push(SECOND, [])
    for empty in (SECOND, SECOND[:0]):
        with pytest.raises(CospeechError, match="came after the sound it begins in") as caught:
            hearing.stream.push(empty, [Word("later", 2.0, 2.1), Word("late", 0.75, 1.5)])
        assert "'late' begins at 0.750 s" in caught.value.problem
        assert "1.000 s of sound had been pushed" in caught.value.problem
    hearing.stream.push(SECOND, [Word("rounded", 1 - 1 / SAMPLE_RATE, 1.5)])
    with pytest.raises(CospeechError, match="came after"):
        hearing.stream.push(SECOND, [Word("late", 2 - 2 / SAMPLE_RATE, 2.5)])


def test_words_of_one_push_are_put_in_order_and_may_come_before_their_sound():
    hearing = Hearing()
    # One that began before a part of a recording.
    hearing.stream.push(SECOND, [Word("c", 2.5, 3.0), Word("a", -0.1, 0.2), Word("b", 0.3, 0.4)])
    with pytest.raises(CospeechError, match=r"'x' begins at 1\.500 s, before 'c' \(2\.500 s\)"):
        hearing.stream.push(SECOND, [Word("x", 1.5, 1.6)])
    hearing.stream.push(SECOND, None)
    hearing.stream.push(SECOND, [Word("d", 2.5, 3.1)])
    hearing.stream.finish()
    assert [word.text for word in hearing.words] == ["a", "b", "c", "d"]
