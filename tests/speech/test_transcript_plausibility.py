"""Words get right times, or none: units, words beyond the sound, phones, markup, tiny words."""

from pathlib import Path

import pytest

from cospeech.errors import InputFileError
from cospeech.speech.speech import Word
from cospeech.speech.transcript import read_transcript, read_transcript_with_timing

DATA = Path(__file__).parents[1] / "data"

TURNING = [
    ("so", 0.4, 0.62),
    ("the", 0.62, 0.75),
    ("big", 0.75, 1.1),
    ("wheel", 1.1, 1.52),
    ("turns", 1.6, 2.05),
    ("slowly", 2.05, 2.6),
]


def rows(scale=1.0, words=TURNING, whole=True):
    number = (lambda value: round(value * scale)) if whole else (lambda value: value * scale)
    return "".join(f"{number(s)}\t{number(e)}\t{w}\n" for w, s, e in words)


def read(tmp_path, content, name="a.tsv", duration_s=3.0):
    (tmp_path / name).write_text(content)
    return read_transcript_with_timing(tmp_path / name, duration_s)


def times(words):
    return [(word.text, pytest.approx(word.start), pytest.approx(word.end)) for word in words]


@pytest.mark.parametrize("duration_s", [3.0, 600.0, None])
@pytest.mark.parametrize("whole", [True, False])
def test_milliseconds_are_converted_and_said(tmp_path, duration_s, whole):
    transcript = read(tmp_path, rows(1000, whole=whole), duration_s=duration_s)
    assert times(transcript.words) == TURNING
    assert transcript.notes == (
        "its times are milliseconds: they were divided by 1000 (the last word ends at 2.60 s)",
    )


def test_sample_numbers_are_converted_where_one_rate_alone_fits(tmp_path):
    transcript = read(tmp_path, rows(16000).replace("\t", " "), "timit.txt")
    assert times(transcript.words) == TURNING
    assert "samples at 16 kHz: they were divided by 16000" in transcript.notes[0]
    for rate in (44100, 48000):  # each could be the other
        with pytest.raises(InputFileError, match="its times are no seconds") as caught:
            read(tmp_path, rows(rate))
        assert "44.1 kHz (divide by 44100) or samples at 48 kHz" in str(caught.value)
    with pytest.raises(InputFileError, match="its times are no seconds"):
        read(tmp_path, rows(16000), duration_s=None)


@pytest.mark.parametrize(("scale", "whole"), [(100, True), (30, True), (1 / 60, False)])
def test_other_units_are_refused(tmp_path, scale, whole):
    with pytest.raises(InputFileError, match="its times are no seconds"):
        read(tmp_path, rows(scale, whole=whole))


def test_a_transcript_much_longer_than_the_sound_names_both_lengths_and_the_cure(tmp_path):
    content = "".join(f"{i / 2}\t{i / 2 + 0.4}\tword{i}\n" for i in range(128))
    with pytest.raises(InputFileError) as caught:
        read(tmp_path, content, duration_s=11.0)
    assert "goes on to 63.9 s, but the sound lasts 11.0 s (106 of 128 words" in str(caught.value)
    assert "cut the transcript too" in str(caught.value)
    (tmp_path / "a.tsv").write_text(content)
    whole = read_transcript_with_timing(tmp_path / "a.tsv", 11.0, goes_on=True)
    assert len(whole.words) == 128
    assert whole.notes == ()


def test_few_words_outside_the_sound_are_left_out_and_counted(tmp_path):
    outside = [("cough", -2.0, -1.5), ("um", -0.2, 0.1), ("late", 8.0, 9.0)]
    inside = [*TURNING, ("and", 2.6, 2.7), ("stops", 2.7, 2.9)]
    transcript = read(tmp_path, rows(words=[*outside, *inside, *TURNING[:3]], whole=False))
    assert [word.text for word in transcript.words][:2] == ["um", "so"]
    assert [word.text for word in transcript.words][-1] == "stops"
    assert transcript.notes == (
        "3 entries with the times and text of another left out",
        "1 word of 11 left out, after the end of the sound: the words go on to 9.0 s, the sound to"
        " 3.0 s; is it the transcript of this recording?",
        "1 word of 11 left out, before the start of the sound: the first is at -2.0 s",
    )
    over = read(tmp_path, rows(words=[*TURNING[:5], ("slowly", 2.05, 6.0)], whole=False))
    assert over.words[-1] == Word("slowly", 2.05, 3.0)
    assert over.notes[0].startswith("1 word of 6 cut at its end: the words go on to 6.0 s")


def test_words_that_all_lie_before_or_after_the_sound_are_refused(tmp_path):
    with pytest.raises(InputFileError, match=r"goes on to 22\.6 s, but the sound lasts 3\.0 s"):
        read(tmp_path, rows(words=[(w, s + 20, e + 20) for w, s, e in TURNING], whole=False))
    with pytest.raises(InputFileError, match=r"starts at -19\.6 s, before the sound"):
        read(tmp_path, rows(words=[(w, s - 20, e - 20) for w, s, e in TURNING], whole=False))
    with pytest.raises(InputFileError, match=r"the times of 'so' are 1\.7e"):
        read(tmp_path, rows(words=[(w, s + 1.7e9, e + 1.7e9) for w, s, e in TURNING], whole=False))


def test_clock_times_and_markup_are_no_words(tmp_path):
    content = (
        "00:00:01,000 --> so the <i>big</i> 0:01:02.5 wheel &nbsp; at 10:30 &amp; [music] ends"
    )
    transcript = read(tmp_path, content, "a.txt")
    texts = [word.text for word in transcript.words]
    assert texts == ["so", "the", "big", "wheel", "at", "10:30", "ends"]
    assert transcript.notes == (
        "2 clock times among the words left out",
        "markup or sounds in brackets left out of 1 entry",
    )
    listed = "0.1\t0.2\t00:00:01,000\n0.2\t0.3\t<i>\n0.3\t0.4\t&nbsp;\n0.5\t0.9\t<b>so</b>\n"
    transcript = read(tmp_path, listed)
    assert transcript.words == (Word("so", 0.5, 0.9),)
    assert transcript.notes[0] == "1 clock time among the words left out"
    # The marks of aligners for an unknown word stand for one.
    assert read(tmp_path, "0.5\t0.9\t<unk>\n").words == (Word("<unk>", 0.5, 0.9),)


def test_words_of_a_few_milliseconds_get_the_time_to_the_next(tmp_path):
    # 2 letters and a run without room: so, the and big share 0.7 s by their letters
    content = "0.4\t0.402\tso\n0.402\t0.404\tthe\n0.404\t1.2\tbig\n1.3\t1.303\tat\n2\t2.4\tgo"
    transcript = read(tmp_path, content)
    assert times(transcript.words) == [
        ("so", 0.4, 0.6),
        ("the", 0.6, 0.9),
        ("big", 0.9, 1.2),
        ("at", 1.3, 1.44),  # 0.07 s a letter
        ("go", 2.0, 2.4),
    ]
    assert transcript.notes == (
        "4 words of under 20 ms, or beside one, given the time up to the next",
    )
    points = "".join(f"{s:.6f}\t{s:.6f}\t{w}\n" for w, s, _ in TURNING)
    assert times(read(tmp_path, points, "labels.txt").words)[:2] == [
        ("so", 0.4, 0.54),
        ("the", 0.62, 0.75),
    ]


def test_points_keep_their_starts(tmp_path):
    points = [("a", 0.5), ("significantly", 1.0), ("bigger", 1.3), ("one", 2.4)]
    content = "".join(f"{start}\t{start}\t{word}\n" for word, start in points)
    assert times(read(tmp_path, content).words) == [
        ("a", 0.5, 0.57),
        ("significantly", 1.0, 1.3),
        ("bigger", 1.3, 1.72),
        ("one", 2.4, 2.61),
    ]


def test_words_without_room_before_the_end_of_the_sound_are_counted(tmp_path):
    content = rows(whole=False) + "".join(f"2.9\t2.9\tz{i}\n" for i in range(30))
    transcript = read(tmp_path, content)
    assert [word.text for word in transcript.words[6:]] == [f"z{i}" for i in range(5)]
    assert transcript.words[-1].end == pytest.approx(3.0)
    assert transcript.notes == (
        "5 words of under 20 ms, or beside one, given the time up to the next",
        "25 words of under 20 ms left out, for which there is no time before the end of the sound",
    )


ARPABET = ["S", "OW1", "DH", "AH0", "B", "IH1", "G"]
IPA = ["s", "əʊ", "ð", "ə", "b", "\u026a", "\u0261", "w", "i\u02d0", "l", "t", "ɜ", "n", "z"]
TIMIT = ["sh", "iy", "hv", "ae", "d", "y", "er", "d", "aa", "r", "k", "s", "uw", "t"]
KALDI = ["B_B", "IH1_I", "G_E", "W_B", "IY1_I", "L_E"]
X_SAMPA = ["t_h", "@U", "3`", "n_=", "r\\", "d_0", "i:", "l_G", "O:", "b", "s", "z"]
LONG_IPA = [f"{label}\u02d0" for label in ("t\u0283", "d\u032a", "aj", *IPA[:4], *IPA[9:])]


def textgrid(*tiers):
    lines = ['File type = "ooTextFile"\nObject class = "TextGrid"\n', 0, 3, "<exists>", len(tiers)]
    for name, entries in tiers:
        lines += ['"IntervalTier"', f'"{name}"', 0, 3, len(entries)]
        for text, start, end in entries:
            lines += [start, end, f'"{text}"']
    return "\n".join(map(str, lines))


def phones(labels):
    return [(label, 0.4 + 0.1 * i, 0.5 + 0.1 * i) for i, label in enumerate(labels)]


def test_a_tier_of_phones_alone_is_refused(tmp_path):
    with pytest.raises(InputFileError, match=r"holds phones and no words \(tiers: 'phones'\)"):
        read_transcript(DATA / "wild/textgrid_phones_only/phones_only.TextGrid", 1.2)
    for labels in (ARPABET, IPA, TIMIT, KALDI, X_SAMPA, LONG_IPA):
        with pytest.raises(InputFileError, match="holds phones and no words"):
            read(tmp_path, textgrid(("Mary", phones(labels))), "a.TextGrid")
        with pytest.raises(InputFileError, match="holds phones and no words"):
            read(tmp_path, rows(words=phones(labels), whole=False))


@pytest.mark.parametrize("name", ["gesture", "POS", "ToBI tones", "emotion"])
def test_tiers_of_something_else_are_no_words(tmp_path, name):
    others = (name, phones(["ADV", "L*", "NOUN"]))
    with pytest.raises(InputFileError, match=f"holds no words .*{name}"):
        read(tmp_path, textgrid(others), "a.TextGrid")
    assert times(read(tmp_path, textgrid(others, ("Bob", TURNING)), "a.TextGrid").words) == TURNING


def test_phases_and_emotions_are_no_words(tmp_path):
    listed = '[{"label": "happy", "start": 0, "end": 1}, {"label": "sad", "start": 1, "end": 2}]'
    with pytest.raises(InputFileError, match="emotions and no words"):
        read(tmp_path, listed, "a.json")
    with pytest.raises(InputFileError, match="phases of gestures"):
        read(tmp_path, textgrid(("x", phones(["stroke", "hold"]))), "a.TextGrid")


@pytest.mark.parametrize(
    ("words", "phone_tier"),
    [
        ("mots", "phonèmes"),
        ("Wörter", "Laute"),
        ("palabras", "fonemas"),
        ("слова", "звуки"),
        ("单词", "音素"),
        ("ORT-MAU", "MAU"),
        ("TokensAlign", "PhonAlign"),
        ("Bob", "phones"),
        ("Bob", "x"),
        ("Ann - words", "Ann - phones"),
    ],
)
def test_the_tier_of_words_is_found_in_many_languages(tmp_path, words, phone_tier):
    for tiers in (((words, TURNING), (phone_tier, phones(ARPABET))),) * 2:
        assert times(read(tmp_path, textgrid(*tiers), "a.TextGrid").words) == TURNING
    content = textgrid((phone_tier, phones(ARPABET)), (words, TURNING))
    assert times(read(tmp_path, content, "a.TextGrid").words) == TURNING


def test_short_words_are_no_phones(tmp_path):
    listening = ["mm", "uh", "oh", "mm", "no", "ok", "mm", "uh", "oh", "hm", "I", "oh"]
    words = read(tmp_path, textgrid(("listener", phones(listening))), "a.TextGrid").words
    assert [word.text for word in words] == listening
    chinese = list("今天天气很好我们出去走走吧")
    words = read(tmp_path, textgrid(("A", phones(chinese))), "a.TextGrid").words
    assert [word.text for word in words] == chinese


def test_the_two_commands_get_the_same_words(tmp_path):
    """What `prepare` and `generate` call is one function; that a note exists is its own doing."""
    (tmp_path / "a.tsv").write_text(rows(1000))
    assert read_transcript(tmp_path / "a.tsv", 3.0) == read_transcript(tmp_path / "a.tsv", 3.2)


@pytest.mark.parametrize(
    "content",
    [
        "".join(f"{w} {s:.2f} {e:.2f}\n" for w, s, e in TURNING),
        "".join(f"{w},{s},{e},0.98\n" for w, s, e in TURNING),
        "".join(f"{s}\t{e}\t{w}\t0.98\n" for w, s, e in TURNING),
        "".join(f"0:00:0{s:.3f},0:00:0{e:.3f}\n{w}\n\n" for w, s, e in TURNING),
    ],
)
def test_words_before_their_times_confidences_and_sbv_are_read(tmp_path, content):
    assert times(read(tmp_path, content, "a.txt").words) == TURNING


@pytest.mark.parametrize(
    "content",
    [
        "".join(f"utt{i} rec {s:.2f} {e:.2f}\n" for i, (_, s, e) in enumerate(TURNING)),
        "".join(f"rec A spk {s} {e} <o,f0> {w} and some more\n" for w, s, e in TURNING),
        "".join(f"- word: {w}\n  start: {s}\n  end: {e}\n" for w, s, e in TURNING),
        '<?xml version="1.0"?><tt><p begin="00:00:00.400" end="00:00:01.520">so</p></tt>',
        "00:00 Intro\n00:12 So the wheel\n00:15 turns\n",
        "".join(f"Bob (00:00:0{i}):\nso they all turn on and on\n" for i in range(4)),
        "[00:00.40]so the big wheel\n[00:01.60]turns slowly\n[00:02.60]\n",
        "[0.40s -> 1.52s] so the big wheel\n[1.60s -> 2.60s] turns slowly\n",
        "[00:00.40] so the big wheel turns slowly\n",
        "rec1 1 spk 0.40 2.60 <o,f0,male> so the big wheel turns slowly\n",
        "words\t\t00:00:00:10\t10\t00:00:00:18\t18\tso\n",
        "Ann Berg  0:00\nso the big wheel and so on turns slowly with all that is on it\n",
        "Ann at 1:00\nso it\n\nhas come\nBob at 1:02\nturned\nto\nAnn at 1:02\nyes\n",
    ],
)
def test_lists_of_times_are_no_prose(tmp_path, content):
    with pytest.raises(InputFileError, match=r"looks like .* not like plain text"):
        read(tmp_path, content, "a.txt")


@pytest.mark.parametrize(
    "content",
    [
        "At 10:30 or 11:30, then 12:45",
        "pi is 3.14, e is 2.71\nand the rest is none of our business, 10 9 8 7",
        "ten\n10\nnine\n9\neight\n8",
    ],
)
def test_prose_with_numbers_is_prose(tmp_path, content):
    words = read(tmp_path, content, "a.txt").words
    assert [word.text for word in words] == content.split()


@pytest.mark.parametrize(
    "content",
    [
        "we meet at 10:30\nand leave at 9:15\nor at 11:00",
        "the train of 10:30\nand that of 11:00",
        "so it is 0:05\nand then I turned",
        "it is 0:05 and 2.5 and 3.75 are numbers",
    ],
)
def test_prose_may_name_times(tmp_path, content):
    transcript = read(tmp_path, content, "a.txt", 6.0)
    assert [word.text for word in transcript.words] == content.split()


@pytest.mark.parametrize("scale", [10, 25])
def test_whole_numbers_of_slow_words_are_refused_however_long_the_sound(tmp_path, scale):
    with pytest.raises(InputFileError, match="frame numbers or tenths of a second") as caught:
        read(tmp_path, rows(scale), duration_s=3000.0)
    assert "frames: divide by the frame rate; tenths: divide by 10" in str(caught.value)


def test_slow_words_are_noted(tmp_path):
    slow = read(tmp_path, rows(10, whole=False), duration_s=3000.0)
    assert slow.words[0] == Word("so", 4.0, 6.2)
    assert slow.notes == ("half of the words last over 3.85 s: are its times seconds?",)
    assert read(tmp_path, rows(3, whole=False), duration_s=3000.0).notes == ()
    phrases = "0 2 so the big\n2 4 wheel turns\n4 6 slowly\n6 9 and stops there\n"
    assert read(tmp_path, phrases, duration_s=9.0).notes == ()
