"""The language of criteria, against NumPy, and against those who mean it ill."""

import re
import time
import unicodedata
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cospeech.errors import ConfigError
from cospeech.matching.control import QUANTITIES, database_mask, measure, parse_criterion
from cospeech.matching.control.words import WordPattern
from cospeech.motion.phases import PHASE_INDEX
from tests.matching.control_databases import ROLES, arms


def mask_of(text, database):
    return database_mask(parse_criterion(text), database)


@pytest.fixture(scope="module")
def database():
    made = arms(12, phases=True, seed=3)
    made.usable[:, 50:] = False
    return made


def numbers(database):
    return {name: measure(name, database.poses, ROLES, 15.0) for name in QUANTITIES}


def test_conditions_are_those_of_numpy(database):
    q = numbers(database)
    height, speed = q["left_wrist_height"], q["left_wrist_speed"]
    right, asymmetry = q["right_wrist_speed"], q["asymmetry"]

    def p(values, percent):
        return np.percentile(values[database.usable], percent)

    mean = (speed + right) / 2
    for text, expected in {
        "left_wrist_height > 0.1": height > 0.1,
        "left_wrist_height > 10*cm": height > 10 * 0.01,
        "-0.1 < left_wrist_height": height > -0.1,
        "left_wrist_height >= p85": height >= p(height, 85),
        "p97.5 <= left_wrist_height": height >= p(height, 97.5),
        "left_wrist_height <= p0": height <= p(height, 0),
        "left_wrist_height <= p100": height <= p(height, 100),
        "p15 <= left_wrist_speed <= p85": (speed >= p(speed, 15)) & (speed <= p(speed, 85)),
        "0.1 < left_wrist_height < 0.2 < left_wrist_speed": (height > 0.1)
        & (height < 0.2)
        & (speed > 0.2),
        "(left_wrist_speed + right_wrist_speed)/2 > p85": mean > p(mean, 85),
        "2 * p50 - 1*cm/s < left_wrist_speed": speed > 2 * p(speed, 50) - 0.01,
        "left_wrist_height > 0.2 and asymmetry < 0.05 or not right_wrist_speed > p50": (
            (height > 0.2) & (asymmetry < 0.05)
        )
        | ~(right > p(right, 50)),
        "not (left_wrist_height > 0.2 or asymmetry < 0.05)": ~((height > 0.2) | (asymmetry < 0.05)),
        "abs(left_wrist_x) < min(p50, 0.2)": np.abs(q["left_wrist_x"])
        < min(p(np.abs(q["left_wrist_x"]), 50), 0.2),
        "max(left_wrist_height, right_wrist_height, 0) > 0.15": np.maximum(
            np.maximum(height, q["right_wrist_height"]), 0
        )
        > 0.15,
        "left_wrist_height > left_elbow_height": height > q["left_elbow_height"],
        "phase == stroke": database.phases == PHASE_INDEX["stroke"],
        "'hold' == phase": database.phases == PHASE_INDEX["hold"],
        "phase != stroke": (database.phases != PHASE_INDEX["stroke"]) & (database.phases >= 0),
        "1 < 2": np.ones_like(height, dtype=bool),
        "1 > 2 or asymmetry > 0.1": asymmetry > 0.1,
        "\n  left_wrist_height\n> 0.1 # up": height > 0.1,
    }.items():
        found = mask_of(text, database)
        assert found.dtype == bool, text
        assert expected.any(), text
        np.testing.assert_array_equal(found, expected, text)


def test_comparisons_with_no_number_hold_nowhere(database):
    for text in ("left_wrist_height / 0 > 1", "1 / 0 > left_wrist_height", "0 / 0 <= 1"):
        assert not mask_of(text, database).any(), text


def test_a_percentile_leaves_that_share_of_the_frames(database):
    usable = database.usable
    for percent in (1, 15, 50, 85, 99):
        share = mask_of(f"left_wrist_radius >= p{percent}", database)[usable].mean()
        assert share == pytest.approx(1 - percent / 100, abs=1 / usable.sum())


def test_masks_are_made_once_and_cannot_be_changed(database):
    first = mask_of("radius > p50", database)
    assert mask_of("radius > p50", database) is first
    assert mask_of("radius > p50", arms(12, seed=3)) is not first
    with pytest.raises(ValueError, match="read-only"):
        first[0, 0] = True


WORDS = (
    ("the", 0, 0.0, 0.2),
    ("big", 0, 1.02, 1.31),
    ("huge", 0, 4.1, 4.5),  # over the edge of the first and the second sequence
    ("big", 7, 12.5, 12.52),  # less than a frame
    ("house", 0, 6.0, 6.4),
    ("bigger", 0, 9.0, 9.4),
)


def test_words_leave_the_windows_over_which_they_are_spoken():
    """Recording 0 is three sequences in a row, 7 is one that begins at 10 s."""
    second_s = 64 / 15
    database = arms(
        4, words=WORDS, recordings=[0, 0, 7, 0], starts_s=[0, second_s, 10.0, 2 * second_s]
    )
    mask = mask_of('word("big|huge")', database)
    found = mask[:, :57] & mask[:, 7:]
    expected = np.zeros((4, 57), dtype=bool)
    for text, recording, start, end in WORDS:
        if text not in ("big", "huge"):
            continue
        for sequence in np.flatnonzero(database.recordings == recording):
            times = database.starts_s[sequence] + np.arange(64) / 15
            for first in range(57):
                # A window shows its last frame for a fifteenth of a second.
                spoken = times[first] < end and times[first + 7] + 1 / 15 > start
                expected[sequence, first] |= spoken
    np.testing.assert_array_equal(found, expected)
    # "big" touches frames 15 to 19, so windows 8 to 19; "huge" 61 to 67; the short "big" frame 37.
    assert expected.sum(axis=1).tolist() == [12 + 3, 4, 8, 0]


def test_words_of_any_length_mark_all_of_their_sequences():
    database = arms(5, words=[("long", 0, 1.0, 1e7)])
    mask = mask_of('word("LONG")', database)
    assert mask[1:].all()
    assert mask[0].argmax() == 15 - 7


def test_databases_without_what_is_asked_for_say_so():
    database = arms(2)
    with pytest.raises(ConfigError, match=r"asks for words \(big\).*no transcripts"):
        mask_of('word("big")', database)
    with pytest.raises(ConfigError, match="gesture phases, and the database's corpus has none"):
        mask_of("phase == stroke", database)
    assert not mask_of('word("never")', arms(2, words=WORDS)).any()


@pytest.mark.parametrize(
    ("pattern", "word", "meant"),
    [
        ("big|huge", "HUGE", True),
        ("big", "bigger", False),
        (r"big\w*", "bigger", True),
        ("big", '"Big!"', True),
        ("don't", "don't", True),
        ("groß", "GROß,", True),
        ("b.g", "bag", True),
        (".*", "...", True),
        ("", "", None),
        ("a" * 300, "a", None),
        ("(a+)+", "aaa", True),
        (r"énorm\w*", "ÉNORMÉMENT", True),
        (r"[\w-]+", "à-côté", True),
        (r"[^\W\d_]+", "çà", True),
        (r"[^\W\d_]+", "a1", False),
        (r"\[\w", "[é", True),
        (r"\d+", "٣", True),
        (r"a\D", "a1", False),
        ("(?=a)a", "a", None),
        (r"(a)\1", "aa", None),
        ("(a{900}){900}", "a", None),
        ("\ud800", "a", None),
        ("[a", "a", None),
        ("(?P<x>a", "a", None),
    ],
)
def test_patterns(pattern, word, meant):
    if meant is None:
        with pytest.raises(ConfigError, match="pattern of words"):
            WordPattern(pattern)
    else:
        assert WordPattern(pattern).matches(word) is meant


@pytest.mark.parametrize("pattern", ["(a*)*b", "(?:a|aa)*b", "a*" * 60 + "b", "(|.)" * 33 + "x"])
def test_patterns_that_could_match_in_endless_ways_end_soon(pattern):
    begun = time.process_time()
    assert not WordPattern(pattern).matches("a" * 39)
    assert not WordPattern(pattern).matches("a" * 1_000_000)
    assert time.process_time() - begun < 5


def test_half_a_surrogate_pair_is_no_letter():
    assert not WordPattern("ab").matches("a\ud800b")


@pytest.mark.parametrize(
    ("text", "message", "marked"),
    [
        ("left_wrist_hight > p85", "did you mean 'left_wrist_height'", "left_wrist_hight"),
        ("asymmetry > 0.1 and sped > 1", "did you mean 'speed'", "sped"),
        ("speed", "a condition is wanted", "speed"),
        ("speed > 3 and asymmetry", "a condition is wanted", "asymmetry"),
        ("speed + (radius > 1) > 3", "a number is wanted", "radius > 1"),
        ("speed > p85 > p15", "on both sides", "p15"),
        ("p85 > 3", "a percentile of what", "p85"),
        ("speed > p101", "p0 to p100", "p101"),
        ("speed == 3", "compared by < <= > >=", "speed == 3"),
        ("speed > 1 & radius > 1", "write `and`, `or`", "1 & radius"),
        ("speed ** 2 > 1", r"\+ - \* /", "speed ** 2"),
        ("speed > 9**9**9", r"\+ - \* /", "9**9**9"),
        ("speed > 1e999", "too large", "1e999"),
        ("phase == strok", "no phase strok; did you mean 'stroke'", "strok"),
        ("stroke", "write phase == stroke", "stroke"),
        ("phase > 3", "phase == NAME", "phase > 3"),
        ("mean(speed) > 3", "no function 'mean'", "mean"),
        ("abs(speed, 3) > 3", "takes one number", "abs(speed, 3)"),
        ("max(speed) > 3", "takes two numbers", "max(speed)"),
        ("abs > 3", "abs is a function", "abs"),
        ("word(big)", "one pattern in quotes", "word(big)"),
        ("word('a' 'b')", "one pattern in quotes", "word('a' 'b')"),
        ("word('(?=a)')", "can't be taken", "'(?=a)'"),
        ("word('a') > 1", "a number is wanted", "word('a')"),
        ("speed > 'fast'", "isn't a number", "'fast'"),
        ("speed > True", "isn't a number", "True"),
        ("speed > 1j", "isn't a number", "1j"),
        ("speed = 3", "not understood from here on", "="),
        ("(speed > 3", "never closed", "("),
        ("speed > ü", "isn't part of the language", "ü"),
        ("__import__('os').system('ls') > 1", "isn't part", "__import__('os').system('ls')"),
        ("speed.real > 1", "isn't part", "speed.real"),
        ("speed[0] > 1", "isn't part", "speed[0]"),
        ("(lambda: 1)() > 1", "isn't part", "(lambda: 1)()"),
        ("[x for x in (1, 2)]", "isn't part", "[x for x in (1, 2)]"),
        ("(x := 3) > 1", "isn't part", "x := 3"),
        ("f'{speed}' > 1", "isn't part", "f'{speed}'"),
        ("speed if speed else speed", "isn't part", "speed if speed else speed"),
        ("word(*'ab')", "one pattern in quotes", "word(*'ab')"),
    ],
)
def test_errors_quote_the_text_and_mark_the_place(text, message, marked):
    with pytest.raises(ConfigError, match=message) as caught:
        parse_criterion(text)
    problem = caught.value.problem
    assert repr(text) in problem
    *_, shown, marks = problem.split("\n")
    stretch = re.search(r"\^+", marks)
    assert shown[stretch.start() : stretch.end()].startswith(marked[:1])
    if len(marked) > 1 or len(stretch.group()) > 1:
        assert shown[stretch.start() : stretch.end()] == marked
    assert "left_wrist_height" in caught.value.hint


@pytest.mark.parametrize(
    "text",
    [
        "(" * 400,
        "not " * 200 + "1 < 2",
        "-" * 900 + "1 < 2",
        "1<2" + " and 1<2" * 120,
        "+".join(["speed"] * 120) + " > 1",
        "speed > " + "9" * 990,
        "speed > " + "1" * 2000,
        "a\0b",
        "\\",
        "speed > 1;import os",
        "x" * 999,
    ],
)
def test_hostile_sizes_are_refused(text):
    with pytest.raises(ConfigError):
        parse_criterion(text)


_SIGNS = "()<>=!&|+-*/%'\"[]{},.:;~@^# \n\t\\0193pem"
_NAMES = (
    "p85 p97.5 and or not in is speed left_wrist_height phase stroke word abs max cm lambda if for"
    " ** <= 1e9 ü __class__ f'{ \0 word('big')"
)
_PIECES = st.sampled_from([*_SIGNS, *_NAMES.split(" "), "speed > p85"])


@given(st.lists(_PIECES, max_size=12).map(" ".join) | st.lists(_PIECES, max_size=12).map("".join))
def test_any_text_is_a_criterion_or_an_error(text):
    with suppress(ConfigError):
        mask = database_mask(parse_criterion(text), _SMALL)
        assert mask.shape == (2, 64)
        assert mask.dtype == bool


_SMALL = arms(2, words=WORDS, phases=True)


@given(st.text(max_size=40))
def test_text_of_any_kind_is_refused_or_is_a_criterion(text):
    criterion = None
    with suppress(ConfigError):
        criterion = parse_criterion(text)
    if criterion is not None:
        mask = database_mask(criterion, _SMALL)
        assert (mask.dtype, mask.shape) == (bool, _SMALL.usable.shape)


@given(st.text(max_size=30), st.text(max_size=30))
def test_patterns_of_any_kind_are_refused_or_matched(pattern, word):
    found = None
    with suppress(ConfigError):
        found = WordPattern(pattern)
    if found is not None:
        assert found.matches(word) in (True, False)
    plain = pattern.isascii() and pattern.isalnum()
    assert not plain or (found is not None and found.matches(pattern.upper()))


def test_accents_spelt_in_two_characters_are_the_same_word():
    composed, apart = "café", unicodedata.normalize("NFD", "café")
    assert composed != apart
    for pattern in (composed, apart):
        assert WordPattern(pattern).matches(composed)
        assert WordPattern(pattern).matches(apart)
