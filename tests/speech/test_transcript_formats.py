"""Every transcript format by hand-made files: words, times, silences, and what's wrong where."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cospeech.errors import InputFileError
from cospeech.speech.speech import Word
from cospeech.speech.transcript import (
    read_transcript,
    read_transcript_with_timing,
    spread_text,
)

HELLO_WORLD = (Word("hello", 0.5, 1.0), Word("world", 1.25, 2.0))

LONG_TEXTGRID = """File type = "ooTextFile"
Object class = "TextGrid"

xmin = 0
xmax = 2.5
tiers? <exists>
size = 2
item []:
    item [1]:
        class = "IntervalTier"
        name = "words"
        xmin = 0
        xmax = 2.5
        intervals: size = 5
        intervals [1]:
            xmin = 0
            xmax = 0.5
            text = "sil"
        intervals [2]:
            xmin = 0.5
            xmax = 1.0
            text = "hello"
        intervals [3]:
            xmin = 1.0
            xmax = 1.25
            text = "<eps>"
        intervals [4]:
            xmin = 1.25
            xmax = 2.0
            text = "world"
        intervals [5]:
            xmin = 2.0
            xmax = 2.5
            text = ""
    item [2]:
        class = "TextTier"
        name = "bell"
        xmin = 0
        xmax = 2.5
        points: size = 1
        points [1]:
            number = 1.5
            mark = "!"
"""

SHORT_TEXTGRID = """File type = "ooTextFile"
Object class = "TextGrid"

0
2.5
<exists>
2
"IntervalTier"
"phones"
0
2.5
1
0
2.5
"AH0"
"IntervalTier"
"Words"
0
2.5
3
0
0.5
"sp"
0.5
1.0
"hello"
1.25
2.0
"world\""""  # no newline at the end

GENTLE = {
    "transcript": "hello world",
    "words": [
        {"word": "hello", "case": "success", "start": 0.5, "end": 1.0, "alignedWord": "hello"},
        {"word": "world", "case": "success", "start": 1.25, "end": 2.0, "alignedWord": "<unk>"},
    ],
}
GOOGLE_WORDS = [
    {"word": "hello", "startTime": "0.500s", "endTime": "1s"},
    {"word": "world ", "startTime": "1.250s", "endTime": "2.0s"},
]
GENEA_2020 = [
    {
        "alternatives": [
            {
                "transcript": "hello world",
                "words": [
                    {"start_time": "0.500s", "end_time": "1s", "word": "hello"},
                    {"start_time": "1.250s", "end_time": "2s", "word": "world"},
                ],
            },
            {"words": [{"start_time": "0s", "end_time": "1s", "word": "yellow"}]},
        ],
        "language_code": "en-us",
    }
]
GOOGLE_WITH_SPEAKERS = {
    "results": [
        {"alternatives": [{"words": GOOGLE_WORDS[:1]}]},
        {"alternatives": [{"words": GOOGLE_WORDS[1:]}]},
        {"alternatives": [{"words": [w | {"speakerTag": 1} for w in GOOGLE_WORDS]}]},
    ]
}
GOOGLE_PROTOBUF = [
    {
        "alternatives": [
            {
                "words": [
                    {
                        "word": "hello",
                        "start_time": {"nanos": 500_000_000},
                        "end_time": {"seconds": 1},
                    },
                    {
                        "word": "world",
                        "start_time": {"seconds": "1", "nanos": 250_000_000},
                        "end_time": {"seconds": 2, "nanos": 0},
                    },
                ]
            }
        ]
    }
]
WHISPER_WORDS = [
    {"word": f" {word.text}", "start": word.start, "end": word.end, "probability": 0.9}
    for word in HELLO_WORLD
]
WHISPER = {
    "text": " Hello world",
    "segments": [{"start": 0.5, "text": "...", "words": [word]} for word in WHISPER_WORDS],
}
VOSK = {
    "result": [{"conf": 1, "word": w.text, "start": w.start, "end": w.end} for w in HELLO_WORLD]
}
ALIGNER_JSON = {
    "start": 0,
    "end": 2.5,
    "tiers": {
        "words": {"type": "interval", "entries": [[0.5, 1.0, "hello"], [1.25, 2.0, "world"]]},
        "phones": {"type": "interval", "entries": [[0.5, 0.6, "HH"]]},
    },
}

SAME_WORDS = {
    "long.TextGrid": LONG_TEXTGRID,
    "no_suffix": LONG_TEXTGRID,
    "short.TextGrid": SHORT_TEXTGRID,
    "short.txt": SHORT_TEXTGRID,
    "windows.TextGrid": LONG_TEXTGRID.replace("\n", "\r\n"),
    "gentle.json": json.dumps(GENTLE),
    "gentle.txt": json.dumps(GENTLE, indent=1),
    "genea2020.json": json.dumps(GENEA_2020),
    "google.json": json.dumps({"results": [{"alternatives": [{"words": GOOGLE_WORDS}]}]}),
    "speakers.json": json.dumps(GOOGLE_WITH_SPEAKERS),
    "protobuf.json": json.dumps(GOOGLE_PROTOBUF),
    "whisper.json": json.dumps(WHISPER),
    "whisperx.json": json.dumps(WHISPER | {"word_segments": WHISPER_WORDS}),
    "vosk.json": json.dumps(VOSK),
    "mfa.json": json.dumps(ALIGNER_JSON),
    "list.json": json.dumps(
        [{"text": w.text, "start": w.start, "end": w.end} for w in HELLO_WORLD]
    ),
    "triples.json": json.dumps([[w.text, w.start, w.end] for w in HELLO_WORLD]),
    "genea2022.tsv": "0.5\t1.0\thello\n1.25\t2.0\tworld\n",
    "header.tsv": "start\tend\tword\n0.0\t0.5\t\n0.5\t1.0\thello\n1.25\t2.0\tworld\n",
    "columns.txt": "0.5 1.0 hello\n1.25 2e0 world",
    "nist.ctm": ";; comment\nrec 1 0.5 0.5 hello 0.9\nrec 1 1.0 0.25 <eps>\nrec 1 1.25 .75 world\n",
    "nist.txt": "2412 1 0.5 0.5 hello\n2412 1 1.25 0.75 world\n",
    "culture_with_timing.txt": "['hello ', 0.5, 1.0]\n[\"world\", 1.25, 2.0]\n",
}


@pytest.mark.parametrize(("name", "content"), SAME_WORDS.items())
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_formats_with_word_times_read_alike(tmp_path, name, content, encoding):
    path = tmp_path / name
    path.write_bytes(content.encode(encoding))
    transcript = read_transcript_with_timing(path)
    assert transcript.words == HELLO_WORLD
    assert transcript.timing == "words"
    assert read_transcript(path) == HELLO_WORLD


SRT = """1
00:00:01,000 --> 00:00:03,000
<i>Say</i> it
{\\an8}- hello!

2
00:01:00,500 --> 00:01:01,000
[applause] you &amp; me

3
00:02:00,000 --> 00:02:01,000
\u266a \u266a
"""
VTT = """WEBVTT - a talk

NOTE said nowhere

intro
00:01.000 --> 00:03.000 align:start position:0%
<v Bob>Say it hello!

01:00:00.000 --> 01:00:01.000
end
"""


@pytest.mark.parametrize("name", ["a.srt", "a.txt"])
def test_subtitles_are_spread_by_letters(tmp_path, name):
    (tmp_path / name).write_text(SRT)
    transcript = read_transcript_with_timing(tmp_path / name)
    assert transcript.timing == "spread"
    # cue 1: 3 + 2 + 5 letters over 2 s; cue 2: 3 + 0 + 2 letters over 0.5 s
    assert transcript.words == (
        Word("Say", 1.0, 1.6),
        Word("it", 1.6, 2.0),
        Word("hello!", 2.0, 3.0),
        Word("you", 60.5, 60.8),
        Word("me", 60.8, 61.0),
    )


def test_vtt(tmp_path):
    (tmp_path / "a.vtt").write_text(VTT)
    words = read_transcript(tmp_path / "a.vtt")
    assert words[:3] == (Word("Say", 1.0, 1.6), Word("it", 1.6, 2.0), Word("hello!", 2.0, 3.0))
    assert words[3:] == (Word("end", 3600.0, 3601.0),)


def test_phrases_of_other_formats_are_spread_too(tmp_path):
    expected = (Word("so", 1.0, 1.5), Word("be", 1.5, 2.0))
    whisper = {"segments": [{"start": 1.0, "end": 2.0, "text": " so be", "words": []}]}
    files = {
        "segments.json": json.dumps(whisper),
        "whisper.tsv": "start\tend\ttext\n1000\t2000\tso be\n",
        "utterances.TextGrid": LONG_TEXTGRID.replace('"words"', '"Bob"')
        .replace('"hello"', '""')
        .replace("xmin = 1.25", "xmin = 1.0")
        .replace('"world"', '"so be"'),
    }
    for name, content in files.items():
        (tmp_path / name).write_text(content)
        transcript = read_transcript_with_timing(tmp_path / name)
        assert transcript.words == expected, name
        assert transcript.timing == "spread"


def test_plain_text_needs_the_duration(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("so, be\nit")
    with pytest.raises(InputFileError, match=r"without word times\n  -> give the recording's dur"):
        read_transcript(path)
    transcript = read_transcript_with_timing(path, duration_s=3.0)
    assert transcript.words == (Word("so,", 0, 1), Word("be", 1, 2), Word("it", 2, 3))
    assert transcript.timing == "spread"


def test_spread_text_fills_the_interval_without_gaps():
    words = spread_text("one - two: three", 10.0, 21.0)
    assert words == (Word("one", 10.0, 13.0), Word("two:", 13.0, 16.0), Word("three", 16.0, 21.0))
    assert spread_text(" - ", 0.0, 1.0) == ()


def gentle(*words):
    """Gentle output; a bare string is a word it did not find."""
    return json.dumps({
        "words": [
            {"word": word, "case": "not-found-in-audio"}
            if isinstance(word, str)
            else {"word": word[0], "case": "success", "start": word[1], "end": word[2]}
            for word in words
        ]
    })  # fmt: skip


def read_gentle(tmp_path, *words):
    (tmp_path / "a.json").write_text(gentle(*words))
    return read_transcript(tmp_path / "a.json")


def test_a_word_not_found_takes_its_neighbours_times(tmp_path):
    words = read_gentle(tmp_path, ("a", 0.0, 1.0), "lost", ("b", 1.5, 2.0))
    assert words[1] == Word("lost", 1.0, 1.5)


def test_a_run_not_found_shares_the_gap(tmp_path):
    words = read_gentle(tmp_path, ("a", 0.0, 1.0), "two", "seven", ("b", 1.8, 2.0))
    assert words[1].start == 1.0
    assert words[1].end == words[2].start == pytest.approx(1.3)
    assert words[2].end == 1.8


def test_words_not_found_at_the_ends_keep_the_pace(tmp_path):
    # the timed words take 0.1 s per letter
    words = read_gentle(tmp_path, "so", ("be", 5.0, 5.2), ("cats", 6.0, 6.4), "end")
    assert words[0].start == pytest.approx(4.8)
    assert words[0].end == 5.0
    assert words[3].start == 6.4
    assert words[3].end == pytest.approx(6.7)
    words = read_gentle(tmp_path, "yesterday", ("be", 0.3, 0.5))
    assert words[0] == Word("yesterday", 0.0, 0.3)


def test_no_gap_gives_no_length_but_no_reversed_word(tmp_path):
    words = read_gentle(tmp_path, ("a", 0.0, 1.0), "lost", ("b", 0.9, 2.0))
    assert [word.text for word in words] == ["a", "b", "lost"]
    assert all(word.end >= word.start for word in words)


def test_nothing_found(tmp_path):
    with pytest.raises(InputFileError, match=r"no word in it has a time\n  -> align"):
        read_gentle(tmp_path, "a", "b")


def test_a_google_word_without_start_begins_at_0(tmp_path):
    # proto3 leaves out a time of zero
    words = [{"word": "hello", "endTime": "0.4s"}, GOOGLE_WORDS[1]]
    (tmp_path / "a.json").write_text(json.dumps([{"alternatives": [{"words": words}]}]))
    first = read_transcript(tmp_path / "a.json")[0]
    assert first.end == 0.4
    assert 0 <= first.start < 0.4


def test_overlaps_and_negative_starts_stay_and_order_is_by_onset(tmp_path):
    (tmp_path / "a.tsv").write_text("1.0\t1.5\tb\n-0.2\t1.1\ta\n2\t1.9999\tc\n")
    assert read_transcript(tmp_path / "a.tsv") == (
        Word("a", -0.2, 1.1),
        Word("b", 1.0, 1.5),
        Word("c", 2.0, 2.07),  # rounding in the file: as long as a letter takes
    )


def test_textgrid_labels_may_hold_quotes_tabs_and_lines(tmp_path):
    content = LONG_TEXTGRID.replace('"hello"', '"""hel\nlo"""').replace("0.5\n", "5e-1 \n")
    (tmp_path / "a.TextGrid").write_text(content)
    words = read_transcript(tmp_path / "a.TextGrid")
    assert words[:2] == (Word('"hel', 0.5, 0.8), Word('lo"', 0.8, 1.0))


def test_textgrid_times_may_be_negative(tmp_path):
    (tmp_path / "a.TextGrid").write_text(
        SHORT_TEXTGRID.replace('0.5\n1.0\n"hello"', '-0.5\n1.0\n"hello"')
    )
    assert read_transcript(tmp_path / "a.TextGrid")[0] == Word("hello", -0.5, 1.0)


def test_praatio_reads_the_same(tmp_path):
    textgrid = pytest.importorskip("praatio.textgrid")
    grid = textgrid.Textgrid(0, 9)
    entries = [(1.0, 2.0, "a"), (2.0, 3.5, "b c"), (4.0, 9.0, 'd"e')]
    grid.addTier(textgrid.IntervalTier("words", entries, 0, 9))
    grid.addTier(textgrid.PointTier("beats", [(1.0, "x")], 0, 9))
    for form in ("short_textgrid", "long_textgrid"):
        grid.save(str(tmp_path / "a.TextGrid"), form, includeBlankSpaces=True)
        words = read_transcript(tmp_path / "a.TextGrid")
        assert [(word.start, word.end, word.text) for word in words] == [
            (1.0, 2.0, "a"),
            (2.0, 2.75, "b"),
            (2.75, 3.5, "c"),
            (4.0, 9.0, 'd"e'),
        ]


def bad_textgrid(old, new):
    assert old in LONG_TEXTGRID
    return LONG_TEXTGRID.replace(old, new)


BROKEN = [
    ("a.TextGrid", LONG_TEXTGRID[:620], r"line 31: the file ends where .*\n  -> .*cut off"),
    (
        "a.TextGrid",
        bad_textgrid("xmax = 1.0\n", "xmax = one\n"),
        r"line 22: expected an end time, found .*hello",
    ),
    ("a.TextGrid", bad_textgrid('"hello"', '"hello'), r"line \d+: expected"),
    ("a.TextGrid", bad_textgrid("xmax = 1.0\n", "xmax = 0.1\n"), "'hello' ends at 0.1 s, before"),
    ("a.TextGrid", bad_textgrid("size = 5", "size = 99999999999"), "number of intervals is 1e.11"),
    ("a.TextGrid", bad_textgrid('"TextGrid"', '"Sound 2"'), r"line 2: is not a TextGrid"),
    (
        "a.TextGrid",
        bad_textgrid('"words"', '"x"')
        .replace("TextTier", "IntervalTier")
        .replace('mark = "!"', 'xmax = 2 text = "ding"'),
        r"no interval tier is called 'words' \(tiers: 'x', 'bell'",
    ),
    (
        "a.TextGrid",
        SHORT_TEXTGRID.replace("phones", "word"),
        "several tiers hold words .*'word', 'W",
    ),
    ("a.TextGrid", "ooBinaryFile\x08TextGrid\0\0", "binary form\n  -> in Praat"),
    ("a.TextGrid", "hello", "line 1: the file ends where"),
    ("a.json", "{", r"line 1, column 2: is not valid JSON|not valid JSON"),
    ("a.json", "[" * 100_000, "is not a transcript|not valid JSON"),
    ("a.json", "[1" + "0" * 5000 + "]", "is not a transcript"),
    ("a.json", "3", "is JSON but not a transcript of a known shape\n  -> known are .*Gentle"),
    ("a.json", '{"foo": []}', "is JSON but not a transcript"),
    ("a.json", '[{"alternatives": 3}]', "no word in the transcript"),
    ("a.json", '{"words": [{"word": 3}]}', r"words\[0\]: expected a word"),
    (
        "a.json",
        '{"words": [{"word": "a", "start": "x", "end": 1}]}',
        r"words\[0\]: 'x' is not a time",
    ),
    ("a.json", '{"words": [{"word": "a", "start": true, "end": 1}]}', r"True is not a time"),
    ("a.json", '{"words": [{"word": "a", "start": NaN}]}', r"no word in it has a time"),
    (
        "a.json",
        '{"words": [{"word": "a", "start": 0, "end": 1e300}]}',
        r"the time of 'a' is 1e\+300",
    ),
    (
        "a.tsv",
        "0.1\t0.2\ta\n0.3\tb\n",
        r"a\.tsv, line 2: expected start, end and word, found '0.3 b '",
    ),
    ("a.tsv", "0.1\t0.2\t" + "a" * 2000, r"line 1: a word of 2000 letters"),
    ("a.tsv", "0.1\t0.2\t" + "a" * 10_000, r"line 1: a line of 10008 characters"),
    ("a.tsv", "0.5\t0.2\ta\n", r"line 1: 'a' ends at 0.2 s, before it starts at 0.5 s"),
    ("a.ctm", "r 1 0.1 0.2 a\ns 1 0.3 0.1 b\n", r"2 recordings \(r, s"),
    ("a.ctm", "r 1 0.1\n", "line 1: expected recording, channel, start"),
    ("a.ctm", "r 1 0.1 0.2\n", "line 1: no word"),
    ("a.txt", "['a', 0.1, 0.2]\n['b', 0.2]\n", r"line 2: expected \['word', start, end\]"),
    (
        "a.txt",
        "['a', 0.1, 0.2]\n['b', __import__('os').getcwd(), 1]\n",
        r"line 2: expected \['word'",
    ),
    ("a.txt", "['a', 0.1, 0.2]\n" + "(" * 4000, r"line 2: expected \['word'"),
    ("a.srt", "1\n00:00:01 --> 00:00:02\nhello\n", "line 2: expected times"),
    ("a.srt", "1\n00:00:03,000 --> 00:00:02,000\nhello\n", "'hello' ends at 2 s, before"),
    ("a.txt", "a\0b", "is a binary file"),
]


@pytest.mark.parametrize(("name", "content", "message"), BROKEN)
def test_broken_files_name_the_place(tmp_path, name, content, message):
    (tmp_path / name).write_text(content)
    with pytest.raises(InputFileError, match=message):
        read_transcript(tmp_path / name)


EMPTY = {
    "b.tsv": "start\tend\tword\n0.0\t1.0\tsil\n",
    "a.json": "[]",
    "b.json": '{"words": [], "transcript": ""}',
    "a.srt": "1\n00:00:01,000 --> 00:00:02,000\n[music]\n",
    "a.TextGrid": LONG_TEXTGRID.replace('"hello"', '""').replace('"world"', '"sp"'),
}


@pytest.mark.parametrize(("name", "content"), EMPTY.items())
def test_an_empty_transcript_points_to_the_audio_alone(tmp_path, name, content):
    (tmp_path / name).write_text(content)
    with pytest.raises(InputFileError, match=r"(?s)transcript.*leave it out.*the audio alone"):
        read_transcript(tmp_path / name, duration_s=1.0)


@pytest.mark.parametrize("name", ["a.txt", "a.cha", "a.tsv"])
@pytest.mark.parametrize("head", ["@Begin", "@UTF8\n@PID:\t11312/c-00016447-1\n@Begin"])
def test_chat_is_refused_by_its_name(tmp_path, name, head):
    said = "*CHI:\tmore cookie . \x151234_5678\x15\n%mor:\tqn|more n|cookie .\n@End\n"
    (tmp_path / name).write_text(f"{head}\n@Languages:\teng\n{said}")
    with pytest.raises(InputFileError, match=r"is a CHAT transcript\n  -> .*chat2praat"):
        read_transcript(tmp_path / name, 6.0)


@pytest.mark.parametrize("name", ["a.txt", "a.tsv", "a.json", "a.TextGrid"])
@pytest.mark.parametrize("content", [b"", b" \n\n", b"\xef\xbb\xbf", b"\xff\xfe\n\0"])
def test_nobody_speaks_where_the_file_is_empty(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    found = read_transcript_with_timing(tmp_path / name)
    assert found.words == ()
    assert "nobody speaks" in found.notes[0]


def test_missing_folder_encoding_and_size(tmp_path, monkeypatch):
    with pytest.raises(InputFileError, match="no such transcript"):
        read_transcript(tmp_path / "none.json")
    with pytest.raises(InputFileError, match="is not a file"):
        read_transcript(tmp_path)
    (tmp_path / "latin.txt").write_bytes("na\u00efve".encode("latin-1"))
    with pytest.raises(InputFileError, match=r"byte 2 is 0xef\)\n  -> save it as UTF-8"):
        read_transcript(tmp_path / "latin.txt")
    monkeypatch.setattr("cospeech.speech.transcript.reader.MAX_FILE_BYTES", 1 << 20)
    (tmp_path / "big.txt").write_bytes(b"a " * (1 << 20))
    with pytest.raises(InputFileError, match=r"too long for a transcript \(over 1048576"):
        read_transcript(tmp_path / "big.txt")


JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(
                ["words", "word", "start", "end", "results", "alternatives", "segments"]
            )
            | st.sampled_from(["text", "case", "tiers", "entries", "seconds", "startTime"]),
            inner,
            max_size=3,
        )
    ),
    max_leaves=15,
)


@given(JSON_VALUES)
def test_any_json_is_read_or_refused(tmp_path_factory, document):
    path = tmp_path_factory.getbasetemp() / "any.json"
    path.write_text(json.dumps(document))
    try:
        words = read_transcript(path)
    except InputFileError:
        return
    assert all(word.end >= word.start for word in words)


@given(
    st.sampled_from([*SAME_WORDS.values(), SRT, VTT]),
    st.sampled_from([".TextGrid", ".json", ".tsv", ".ctm", ".srt", ".txt"]),
    st.integers(0, 1000),
    st.text(alphabet="\"'[]{}<>-0123456789.:,\t\n aé", max_size=4),
    st.integers(0, 10),
)
def test_damaged_files_are_read_or_refused(tmp_path_factory, content, suffix, place, new, removed):
    path = tmp_path_factory.getbasetemp() / f"damaged{suffix}"
    place %= len(content)
    path.write_text(content[:place] + new + content[place + removed :])
    try:
        words = read_transcript(path)
    except InputFileError:
        return
    assert words
    assert all(word.end >= word.start for word in words)
    assert [word.start for word in words] == sorted(word.start for word in words)
