"""Transcripts and word vectors that are made to hang, to fill the memory, or to crash."""

import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cospeech.errors import CospeechError, InputFileError
from cospeech.matching.control import WordPattern, read_controls
from cospeech.speech.transcript import read_transcript, read_transcript_with_timing
from cospeech.speech.word_vectors import load_word_vectors

HOSTILE = Path(__file__).parents[1] / "data/hostile"
_HEAD = 'File type = "ooTextFile"\nObject class = "TextGrid"\n\n'

LARGE = 120_000
"""Characters: a search that takes the square of this takes minutes."""

LONG = {
    "a.TextGrid": [
        _HEAD + "xmin = " + "1" * LARGE + "x",
        _HEAD + "0\n1\n<exists>\n1\n" + '"' + '""' * LARGE,
        _HEAD + " \t" * LARGE,
        _HEAD + "<a" * LARGE,
    ],
    "a.txt": ["<a" * LARGE, "[a" * LARGE, "&amp" * LARGE, "{<[" * LARGE, "a " * LARGE],
    "a.srt": ["00:01.0-->00:02.0\n" + "<00:01\n" * LARGE, "1\n" * LARGE],
    "a.tsv": ["0.5\t" * 1000 + "\n", "0 1 a\n" * LARGE, "1" * 4000 + "x 1 a\n"],
    "a.ctm": ["r 1 0 1 a\n" * LARGE],
    "a.json": ["[" * LARGE, "[]" * LARGE, '{"words":[' + '["a",0,1],' * LARGE + "[]]}"],
}


@pytest.mark.parametrize(
    ("name", "content"), [(name, text) for name, texts in LONG.items() for text in texts]
)
def test_long_files_are_refused_soon(tmp_path, name, content):
    (tmp_path / name).write_text(content)
    begun = time.process_time()
    with pytest.raises(InputFileError):
        read_transcript(tmp_path / name, 10.0)
    assert time.process_time() - begun < 30  # a second or less on a quiet machine


def test_a_number_of_400_digits_names_the_line():
    with pytest.raises(InputFileError, match=r"a\.txt, line 1: expected \['word', start, end\]"):
        read_transcript(HOSTILE / "bracketed_number_of_400_digits/a.txt")


def test_brackets_are_read_without_running_them(tmp_path):
    (tmp_path / "a.txt").write_text(r"['don\'t \u00e9', .5, 1.0]" + '\n("a,b\\"c", 1e0, 2),\n')
    words = read_transcript(tmp_path / "a.txt")
    assert [(word.text, word.start) for word in words][::2] == [("don't", 0.5), ('a,b"c', 1.0)]
    (tmp_path / "a.txt").write_text("['a', 0.1, 0.2]\n['b', 9**9**9, 1]\n")
    with pytest.raises(InputFileError, match="line 2: expected"):
        read_transcript(tmp_path / "a.txt")
    (tmp_path / "a.txt").write_text(r"['\ud800a', 0.1, 0.2]")
    assert read_transcript(tmp_path / "a.txt")[0].text == "\ufffda"


def test_a_pattern_of_empty_alternatives_is_matched_soon():
    controls = read_controls(HOSTILE / "word_pattern_empty_alternatives/controls.yaml")
    begun = time.process_time()
    (keyword,) = controls.keywords
    assert not keyword.word.matches("a" * 40)
    assert WordPattern(keyword.word.text).matches("a" * 20 + "x")
    assert time.process_time() - begun < 10


@pytest.mark.parametrize("digits", [10, 20, 400, 5000])
def test_vectors_that_claim_more_words_than_there_are(tmp_path, digits):
    (tmp_path / "m.vec").write_bytes(b"9" * digits + b" 3\nthe 1 2 3\n")
    with pytest.raises(InputFileError, match="does not begin with a word count"):
        load_word_vectors(tmp_path / "m.vec", ["the"], seed=0)
    path = HOSTILE / "fasttext_vec_count_of_400_digits/m.vec"
    with pytest.raises(InputFileError, match=r"m\.vec, line 1: does not begin with a word count"):
        load_word_vectors(path, ["the"], seed=0)


_CELLS = st.sampled_from(
    ["0.4", "0.62", "400", "00:00:01,000", "words", "A", "so", "", "nan", "1e9", "-1", "S", "OW1"]
)
_PIECES = st.sampled_from(
    ["start", "end", "Tier", "Begin Time - msec", "duration", "text", "\\", "#", '"', "-->", "<i>"]
)


@given(
    st.lists(st.lists(_CELLS | _PIECES, max_size=7), max_size=8),
    st.sampled_from(["\t", " ", ",", ";"]),
    st.sampled_from([".tsv", ".txt", ".csv", ".ctm", ".srt", ".vtt"]),
    st.sampled_from([None, 0.0, 3.0]),
)
def test_any_table_is_read_or_refused(tmp_path_factory, rows, separator, suffix, duration_s):
    path = tmp_path_factory.getbasetemp() / f"any{suffix}"
    path.write_text("\n".join(separator.join(row) for row in rows))
    try:
        transcript = read_transcript_with_timing(path, duration_s)
    except CospeechError:
        return
    assert transcript.words or not path.read_text().strip()
    assert all(word.end >= word.start and word.text.strip() for word in transcript.words)
    starts = [word.start for word in transcript.words]
    assert starts == sorted(starts)
