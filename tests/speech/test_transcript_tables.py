"""Tables of words as ELAN, Audacity, Praat and spreadsheets write them; CTM among them."""

from pathlib import Path

import pytest

from cospeech.errors import InputFileError
from cospeech.speech.transcript import read_transcript, read_transcript_with_timing
from tests.speech.test_transcript_plausibility import TURNING, read, times

ELAN = Path(__file__).parents[1] / "data/wild/elan_tab_export/elan_export.txt"


def lines(row, separator="\t", words=TURNING):
    return "".join(separator.join(map(str, row(*word))) + "\n" for word in words)


def ms(seconds):
    return round(seconds * 1000)


def hms(seconds):
    return f"00:00:0{seconds:.3f}"


def test_elans_tab_delimited_text():
    words = read_transcript_with_timing(ELAN, 3.0).words
    assert times(words) == [("so", 0.4, 0.62), ("the", 0.62, 0.75), ("big", 0.75, 1.1)]


ALL_UNITS = lines(
    lambda w, s, e: ("words", "Ann", hms(s), s, ms(s), hms(e), e, ms(e), hms(e - s), ms(e - s), w)
)
TABLES = {
    "without durations": lines(lambda w, s, e: ("words", "Ann", s, e, w)),
    "without participants": lines(lambda w, s, e: ("words", s, e, round(e - s, 2), w)),
    "an empty participant": lines(lambda w, s, e: ("words", "", s, e, round(e - s, 2), w)),
    "neither": lines(lambda w, s, e: ("words", s, e, w)),
    "no tier": lines(lambda w, s, e: (s, e, round(e - s, 2), w)),
    "clock times": lines(lambda w, s, e: ("words", "", hms(s), hms(e), w)),
    "whole milliseconds": lines(lambda w, s, e: ("words", "", ms(s), ms(e), ms(e) - ms(s), w)),
    "every unit": ALL_UNITS,
    "every unit, named": "Tier\tParticipant\tBegin Time - hh:mm:ss.ms\tBegin Time - ss.msec\t"
    "Begin Time - msec\tEnd Time - hh:mm:ss.ms\tEnd Time - ss.msec\tEnd Time - msec\t"
    "Duration - hh:mm:ss.ms\tDuration - msec\tAnnotation\n" + ALL_UNITS,
    "milliseconds, named": "Begin Time - msec\tEnd Time - msec\tdefault\n"
    + lines(lambda w, s, e: (ms(s), ms(e), w)),
    "two tiers": lines(lambda w, s, e: ("words", "A", s, e, w))
    + lines(lambda w, s, e: ("gloss", "A", s, e, w.upper())),
    "a column per tier": "Begin Time - ss.msec\tEnd Time - ss.msec\twords\tphones\n"
    + lines(lambda w, s, e: (s, e, w, ""))
    + "0.4\t0.5\t\tS\n",
    "praat": "tmin\ttier\ttext\ttmax\n" + lines(lambda w, s, e: (s, "mots", w, e)),
    "audacity": lines(lambda w, s, e: (f"{s:.6f}", f"{e:.6f}", f"{w}\n\\\t100.0\t5000.0")),
    "word first": lines(lambda w, s, e: (w, s, e)),
    "commas": "start,end,word\n" + lines(lambda w, s, e: (s, e, f'"{w}"'), ","),
    "commas, not named": lines(lambda w, s, e: (s, e, w), ","),
    "german": lines(lambda w, s, e: (w, *(str(t).replace(".", ",") for t in (s, e))), ";"),
    "start and duration": "onset\tduration\tlabel\n"
    + lines(lambda w, s, e: (s, round(e - s, 2), w)),
    "ctm": lines(lambda w, s, e: ("rec", 1, s, round(e - s, 2), w, 0.9), " "),
    "ctm with tabs": lines(lambda w, s, e: ("rec", "A", s, round(e - s, 2), w)),
    "ctm of a number": lines(lambda w, s, e: (2412, 1, s, round(e - s, 2), w), " "),
}


@pytest.mark.parametrize("suffix", [".txt", ".tsv", ".csv"])
@pytest.mark.parametrize("content", TABLES.values(), ids=TABLES.keys())
def test_columns_are_found_by_name_or_content(tmp_path, content, suffix):
    assert times(read(tmp_path, content, f"a{suffix}").words) == TURNING


def test_labels_of_phrases_are_spread(tmp_path):
    transcript = read(tmp_path, "0.4\t1.5\tso the wheel\n1.6\t2.6\tturns\n2.6\t2.8\tit goes\n")
    assert transcript.timing == "spread"
    assert times(transcript.words)[:3] == [
        ("so", 0.4, 0.62),
        ("the", 0.62, 0.95),
        ("wheel", 0.95, 1.5),
    ]


def test_whispers_header_means_milliseconds_over_whole_numbers_alone(tmp_path):
    whole = read(tmp_path, "start\tend\ttext\n400\t620\tso\n620\t750\tthe\n")
    seconds = read(tmp_path, "start\tend\ttext\n0.4\t0.62\tso\n0.62\t0.75\tthe\n")
    assert times(whole.words) == times(seconds.words) == TURNING[:2]
    assert (whole.timing, seconds.timing) == ("spread", "words")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.ctm", lines(lambda w, s, e: ("rec", 1, s, e, w)), "most words overlap.*'so'.*'the'"),
        ("a.tsv", lines(lambda w, s, e: (s, round(e - s, 2), w)), "ends at|most words overlap"),
        ("a.tsv", lines(lambda w, s, e: ("a", "b", s, "c", w)), "can't tell which columns"),
        ("a.tsv", "0.5\t" * 1000 + "\n", "can't tell which columns"),
        (
            "a.txt",
            lines(lambda w, s, e: ("one", "A", s, e, w))
            + lines(lambda w, s, e: ("two", "A", s, e, w + w)),
            r"no interval tier is called 'words' \(tiers: 'one', 'two'",
        ),
        ("a.tsv", "1e999\t2e999\tso\n", "the time of 'so' is inf"),
        ("a.txt", "['so', " + "9" * 400 + ", 1]\n", r"line 1: expected \['word', start, end\]"),
    ],
)
def test_columns_that_do_not_fit_are_refused(tmp_path, name, content, message):
    with pytest.raises(InputFileError, match=message):
        read(tmp_path, content, name)


def test_prose_with_numbers_and_commas_is_prose(tmp_path):
    text = "In 1990, 12, he said. From the start, to the end, we go\nStart, 10, 20, thirty, end"
    assert read(tmp_path, text, "a.txt").timing == "spread"
    (tmp_path / "b.txt").write_text("10, 20, thirty")
    assert len(read_transcript(tmp_path / "b.txt", 3.0)) == 3


@pytest.mark.parametrize("suffix", ["tsv", "txt"])
@pytest.mark.parametrize("separator", ["\t", " "])
@pytest.mark.parametrize("score", ["0.9", "-12."])
def test_a_number_after_each_word_is_a_score(tmp_path, separator, score, suffix):
    listed = "".join(
        separator.join([str(s), str(e), w, f"{score}{i}"]) + "\n"
        for i, (w, s, e) in enumerate(TURNING)
    )
    for head in ("", separator.join(["start", "end", "word", "score"]) + "\n"):
        transcript = read(tmp_path, head + listed, f"a.{suffix}")
        assert times(transcript.words) == TURNING
        assert transcript.notes == ()


@pytest.mark.parametrize(
    ("separator", "first", "last"), [("\t", "", "NOUN"), (" ", "", "NOUN"), ("\t", "A\t", "")]
)
def test_tags_and_speakers_beside_words_are_none(tmp_path, separator, first, last):
    row = separator.join(["{}", "{}", first + "{}", last]).rstrip()
    transcript = read(tmp_path, "".join(row.format(s, e, w) + "\n" for w, s, e in TURNING))
    assert times(transcript.words) == TURNING
    (note,) = transcript.notes
    column = 4 if first else 3
    assert f"the words are those of column {column} (so, the, big ...), not of column" in note


def test_two_columns_that_may_be_words_are_refused(tmp_path):
    listed = "".join(f"{s}\t{e}\t{w}\t{w}s\n" for w, s, e in TURNING)
    with pytest.raises(InputFileError, match="tiers: 'column 3', 'column 4'"):
        read(tmp_path, listed)
    assert times(read(tmp_path, f"start\tend\tword\tlemma\n{listed}").words) == TURNING


def test_phrases_of_two_words_stay_phrases(tmp_path):
    said = ["so the", "big wheel", "turns slowly", "and stops"]
    listed = "".join(f"{i} {i + 1} {text}\n" for i, text in enumerate(said))
    words = read(tmp_path, listed, duration_s=4.0).words
    assert [word.text for word in words] == " ".join(said).split()
