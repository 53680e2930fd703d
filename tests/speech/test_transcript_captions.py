"""Captions that roll, grow, stay, time their words, or are written without care."""

from pathlib import Path

import pytest

from cospeech.speech.speech import Word
from cospeech.speech.transcript import read_transcript_with_timing
from tests.speech.test_transcript_plausibility import read, times

WILD = Path(__file__).parents[1] / "data/wild/youtube_rolling_captions"


def srt(*cues, numbered=True, blank="\n"):
    return "".join(
        (f"{index}\n" if numbered else "")
        + f"00:00:0{start:.3f} --> 00:00:0{end:.3f}\n{text}\n{blank}"
        for index, (start, end, text) in enumerate(cues, start=1)
    )


def phrases(*cues):
    """What the cues are spread to, by hand: letters share the time."""
    expected = []
    for start, end, text in cues:
        letters = [sum(c.isalnum() for c in word) for word in text.split()]
        for index, word in enumerate(text.split()):
            before, after = (sum(letters[: index + i]) / sum(letters) for i in (0, 1))
            times = (pytest.approx(start + (end - start) * share) for share in (before, after))
            expected.append((word, *times))
    return expected


ROLLED = phrases(
    (0.4, 1.59, "so the big wheel"), (1.6, 2.59, "turns slowly"), (2.6, 3.5, "and stops")
)


def test_rolling_captions_of_youtube_once_each():
    srt_file = read_transcript_with_timing(WILD / "youtube_auto.srt", 4.0)
    assert times(srt_file.words) == ROLLED
    assert srt_file.timing == "spread"
    vtt = read_transcript_with_timing(WILD / "youtube_auto.vtt", 4.0)
    assert times(vtt.words) == [
        ("so", 0.4, 0.62),
        ("the", 0.62, 0.75),
        ("big", 0.75, 1.1),
        ("wheel", 1.1, 1.59),
        ("turns", 1.6, 2.05),
        ("slowly", 2.05, 2.59),
        ("and", 2.6, 3.0),
        ("stops", 3.0, 3.5),
    ]
    assert vtt.timing == "words"
    for transcript in (srt_file, vtt):
        assert transcript.notes == ("4 lines left out that captions carried over",)


@pytest.mark.parametrize(
    "content",
    [
        srt(  # each grows out of the one before
            (0.4, 1.59, "so the big wheel"),
            (1.59, 1.6, "so the big wheel"),
            (1.6, 2.59, "so the big wheel turns slowly"),
            (2.6, 3.5, "so the big wheel turns slowly and stops"),
        ),
        srt(  # each twice
            (0.4, 1.59, "so the big wheel"),
            (0.4, 1.59, "so the big wheel"),
            (1.6, 2.59, "turns slowly"),
            (1.6, 2.59, "turns slowly"),
            (2.6, 3.5, "and stops"),
            (2.6, 3.5, "and stops"),
        ),
        srt(  # the line before stays above
            (0.4, 1.59, "so the big wheel"),
            (1.6, 2.59, "so the big wheel\nturns slowly"),
            (2.6, 3.5, "<i>turns slowly</i>\nand stops"),
            blank="",
        ),
        srt(
            (0.4, 1.59, "so the\n\nbig wheel"), (1.6, 2.59, "turns slowly"), (2.6, 3.5, "and stops")
        ),
        srt(
            (0.4, 1.59, "so the big wheel"),
            (1.6, 2.59, " \nturns slowly\n "),
            (2.6, 3.5, "and stops"),
            numbered=False,
        ),
        srt(
            (0.4, 1.59, "so the big wheel"),
            (1.6, 2.59, "{\\an8}turns slowly"),
            (2.6, 3.5, "[bell] and stops"),
            blank=" \n",
        ),
    ],
)
def test_every_line_once_at_its_first_time(tmp_path, content):
    for name, text in (
        ("a.srt", content),
        ("a.vtt", "WEBVTT\n\n" + content.replace("\n\nbig", " big")),
    ):
        assert times(read(tmp_path, text, name, 4.0).words) == ROLLED, name


def test_what_is_said_twice_stays(tmp_path):
    content = srt((0.4, 1.5, "No."), (1.6, 2.6, "No."), (2.6, 3.5, "Never ever."), (3.6, 3.9, "Oh"))
    transcript = read(tmp_path, content, "a.srt", 4.0)
    assert [word.text for word in transcript.words] == ["No.", "No.", "Never", "ever.", "Oh"]
    assert transcript.notes == ()


@pytest.mark.parametrize("gap", [0.0, 0.1, 0.5])
def test_speech_that_is_repeated_is_no_caption_carried_over(tmp_path, gap):
    said = ["Yeah.", "Yeah.", "I know.", "Yeah.", "Yeah.", "Yeah."]
    step = 0.4 + gap
    cues = [(step * i, step * i + 0.4, text) for i, text in enumerate(said)]
    transcript = read(tmp_path, srt(*cues), "a.srt", 6.0)
    assert [word.text for word in transcript.words] == " ".join(said).split()
    assert transcript.notes == ()


def test_numbers_that_are_said_stay(tmp_path):
    said = [(0.4, 1.5, "the answer is\n42"), (1.6, 2.6, "so\n\n7"), (2.6, 3.5, "or\n8")]
    words = ["the", "answer", "is", "42", "so", "7", "or", "8"]
    for name, content in (
        ("a.srt", srt(*said)),
        ("b.srt", srt(*said[:1], (1.6, 2.6, "so\n7"), *said[2:], blank="")),
        ("c.vtt", "WEBVTT\n\n" + srt(*said, numbered=False).replace("\n\n7", "\n7")),
    ):
        assert [word.text for word in read(tmp_path, content, name, 4.0).words] == words, name
    doubled = srt((0.4, 1.5, "the answer"), (1.6, 2.6, "is 42")).replace("\n", "\n\n")
    words = [word.text for word in read(tmp_path, doubled, "e.srt", 4.0).words]
    assert words == ["the", "answer", "is", "42"]
    countdown = srt((0.4, 1.5, "3"), (1.6, 2.6, "2"), (2.6, 3.5, "1"))
    assert [w.text for w in read(tmp_path, countdown, "d.srt", 4.0).words] == ["3", "2", "1"]


def test_captions_that_stay_while_the_next_is_spoken_are_cut(tmp_path):
    content = srt(
        (0.4, 2.6, "so the big wheel"), (1.6, 3.5, "turns slowly"), (2.6, 3.5, "and stops")
    )
    transcript = read(tmp_path, content, "a.srt", 4.0)
    assert times(transcript.words) == phrases(
        (0.4, 1.6, "so the big wheel"), (1.6, 2.6, "turns slowly"), (2.6, 3.5, "and stops")
    )
    assert transcript.notes == ("2 captions cut where the next begins, above which they stay",)


def test_vtt_with_classes_and_without_ids(tmp_path):
    content = (
        "WEBVTT\n\nSTYLE\n::cue { color: red }\n\n00:00.400 --> 00:01.590 line:0\n"
        "<c.colorE5E5E5>so<00:00.620><c> the</c><00:00.750><c> big</c></c>"
        "<00:01.100><c.x> wheel</c>\n"
        "\n00:01.600 --> 00:02.050\n<v Bob Miller>turns</v>\n"
    )
    assert read(tmp_path, content, "a.vtt", 4.0).words == (
        Word("so", 0.4, 0.62),
        Word("the", 0.62, 0.75),
        Word("big", 0.75, 1.1),
        Word("wheel", 1.1, 1.59),
        Word("turns", 1.6, 2.05),
    )


def test_what_whisper_prints(tmp_path):
    content = (
        "[00:00.400 --> 00:01.590]  so the big wheel\n[00:01.600 --> 00:02.590]  turns slowly\n"
        "[00:02.600 --> 00:03.500]  and stops\n"
    )
    assert times(read(tmp_path, content, "a.txt", 4.0).words) == ROLLED


@pytest.mark.parametrize("suffix", ["srt", "vtt"])
@pytest.mark.parametrize("tag", ["u", 'font color="#00ff00"'])
def test_words_that_captions_mark_one_after_another_have_those_times(tmp_path, suffix, tag):
    def marked(start, end, before, word, after):
        return start, end, f"{before}<{tag}>{word}</{tag.split()[0]}>{after}"

    content = srt(
        marked(0.4, 0.62, "", "so", " the\nbig so"),
        marked(0.62, 0.75, "so ", "the", "\nbig so"),
        (0.75, 0.9, "so the\nbig so"),
        marked(0.9, 1.1, "so the\n", "big", " so"),
        (1.1, 1.2, "so the\nbig so"),  # its last word is never marked
        marked(1.2, 2.2, "", "big", " so"),  # as the line before ends
        marked(2.2, 2.4, "big ", "so", ""),
        marked(2.4, 2.6, "", "big", " so"),  # said again
        marked(2.6, 2.8, "big ", "so", ""),
    )
    transcript = read(tmp_path, "WEBVTT\n\n" * (suffix == "vtt") + content, f"a.{suffix}")
    words = times(transcript.words)
    assert words[:3] == [("so", 0.4, 0.62), ("the", 0.62, 0.75), ("big", 0.9, 1.1)]
    assert words[3][0] == "so"
    assert words[4:] == [
        ("big", 1.2, 2.2),
        ("so", 2.2, 2.4),
        ("big", 2.4, 2.6),
        ("so", 2.6, 2.8),
    ]
    assert transcript.timing == "words"
    assert transcript.notes == ("1 of 8 words lacks a time: placed by neighbours",)


def test_a_line_that_is_marked_alike_twice_is_said_twice(tmp_path):
    said = [(0.0, 1.0, "<i>never</i> mind"), (1.0, 2.0, "<i>never</i> mind")]
    assert len(read(tmp_path, srt(*said), "a.srt").words) == 4


def test_names_of_speakers_before_what_they_say_are_no_words(tmp_path):
    said = [
        (0.4, 1.5, "Anna Berg: so the big"),
        (1.5, 2.0, "<i>Bob:</i> turns"),
        (2.0, 3.0, "- Anna Berg: it is 9:30\n- SPEAKER 2: yes: it is"),
        (3.0, 3.9, "Anna Berg: stops"),
    ]
    transcript = read(tmp_path, srt(*said), "a.srt", 4.0)
    words = ["so", "the", "big", "turns", "it", "is", "9:30", "yes:", "it", "is", "stops"]
    assert [word.text for word in transcript.words] == words
    assert transcript.notes[0] == "names of speakers left out (Anna Berg, Bob, SPEAKER 2)"
    plain = read(tmp_path, "A: so the big\nB: yes\nA: wheel\n", "a.txt")
    assert [word.text for word in plain.words] == ["so", "the", "big", "yes", "wheel"]


@pytest.mark.parametrize("text", ["Remember: it turns", "as he said: it turns", "10: it turns"])
def test_a_colon_alone_names_no_speaker(tmp_path, text):
    said = [(0.0, 1.0, text), (1.0, 2.0, "so it does"), (2.0, 3.0, "and so on: yes")]
    words = [word.text for word in read(tmp_path, srt(*said), "a.srt").words]
    assert words == [*text.split(), *["so", "it", "does", "and", "so", "on:", "yes"]]


@pytest.mark.parametrize(
    "cues",
    [
        [  # they grow word by word, with pauses
            (0.4, 0.6, "so"),
            (0.6, 0.7, "so the"),
            (1.0, 1.5, "so the big"),
            (2.0, 2.4, "wheel"),
            (2.8, 3.0, "wheel turns"),
            (3.2, 3.8, "wheel turns slowly"),
        ],
        [  # each carries its last line over, with pauses
            (0.4, 1.0, "so the"),
            (1.5, 2.0, "so the\nbig wheel"),
            (2.4, 3.0, "big wheel\nturns slowly"),
        ],
    ],
)
def test_captions_that_grow_or_roll_after_pauses_are_read_once(tmp_path, cues):
    transcript = read(tmp_path, srt(*cues), "a.srt", 4.0)
    words = ["so", "the", "big", "wheel", "turns", "slowly"]
    assert [word.text for word in transcript.words] == words
    assert {cue[0] for cue in cues} <= {word.start for word in transcript.words}
    assert "left out that captions carried over" in transcript.notes[0]


def test_what_is_said_again_after_a_long_pause_stays(tmp_path):
    said = [(0.0, 1.0, "so"), (4.0, 5.0, "so it"), (8.0, 9.0, "so it does")]
    assert len(read(tmp_path, srt(*said), "a.srt", 9.0).words) == 6


def test_a_single_line_with_a_colon_names_no_speaker(tmp_path):
    words = read(tmp_path, srt((0.0, 1.0, "Remember: it turns")), "a.srt").words
    assert [word.text for word in words] == ["Remember:", "it", "turns"]
