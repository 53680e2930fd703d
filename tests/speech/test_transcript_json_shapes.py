"""The JSON of every aligner and speech service that is read, as it writes it."""

import json
from pathlib import Path

import pytest

from cospeech.errors import InputFileError
from cospeech.speech.speech import Word
from cospeech.speech.transcript import read_transcript, read_transcript_with_timing

WILD = Path(__file__).parents[1] / "data/wild"

TURNING = [
    ("so", 0.4, 0.62),
    ("the", 0.62, 0.75),
    ("big", 0.75, 1.1),
    ("wheel", 1.1, 1.52),
    ("turns", 1.6, 2.05),
    ("slowly", 2.05, 2.6),
]


def times(words):
    return [(word.text, pytest.approx(word.start), pytest.approx(word.end)) for word in words]


def listed(scale=1.0, text="word", start="start", end="end"):
    """The six words as a list of mappings; milliseconds are whole numbers."""
    number = round if scale != 1.0 else float
    return [{text: w, start: number(s * scale), end: number(e * scale)} for w, s, e in TURNING]


def with_durations(start="start_time", scale=1.0, name="word", length="duration"):
    number = round if scale != 1.0 else (lambda value: round(value, 2))
    return [
        {name: w, start: number(s * scale), length: number((e - s) * scale)} for w, s, e in TURNING
    ]


@pytest.mark.parametrize("duration_s", [3.0, None])
@pytest.mark.parametrize(
    "name",
    [
        "asr_json_shapes/aws.json",
        "asr_json_shapes/deepgram.json",
        "asr_json_shapes/deepspeech.json",
        "asr_json_shapes/vosk_list.json",
        "asr_json_shapes/vosk_stream.json",
        "asr_json_shapes/watson.json",
        "asr_json_shapes/whispercpp.json",
        "asr_milliseconds/assemblyai.json",
    ],
)
def test_files_of_speech_services(name, duration_s):
    transcript = read_transcript_with_timing(WILD / name, duration_s)
    assert times(transcript.words) == TURNING
    assert transcript.timing == "words"


SHAPES = {
    "vosk": {"result": listed(), "text": "so the big wheel turns slowly"},
    "vosk alternatives": {"alternatives": [{"result": listed(), "text": ""}, {"result": []}]},
    "coqui": {
        "transcripts": [
            {"confidence": -1, "words": with_durations()},
            {"confidence": -9, "words": [{"word": "zo", "start_time": 0.4, "duration": 0.2}]},
        ]
    },
    "deepspeech 0.7": {"transcripts": [{"words": with_durations("start_time ")}]},
    "google v2": {
        "results": [
            {
                "alternatives": [
                    {
                        "words": [
                            {"word": w, "startOffset": f"{s:.3f}s", "endOffset": f"{e:.3f}s"}
                            for w, s, e in TURNING
                        ]
                    }
                ]
            }
        ]
    },
    "google operation": {"response": {"results": [{"alternatives": [{"words": listed()}]}]}},
    "watson, two results": {
        "results": [
            {"alternatives": [{"timestamps": [list(word) for word in TURNING[:4]]}]},
            {"alternatives": [{"timestamps": [list(word) for word in TURNING[4:]]}]},
        ]
    },
    "deepgram, one channel silent": {
        "results": {
            "channels": [
                {"alternatives": [{"words": []}]},
                {"alternatives": [{"words": listed()}, {"words": listed()[:2]}]},
            ]
        }
    },
    "speechmatics": {
        "results": [
            *(
                {"type": "word", "start_time": s, "end_time": e, "alternatives": [{"content": w}]}
                for w, s, e in TURNING
            ),
            {"type": "punctuation", "start_time": 2.6, "alternatives": [{"content": "."}]},
        ]
    },
    "assemblyai utterances": {
        "audio_duration": 3,
        "words": None,
        "utterances": [{"start": 400, "end": 2600, "words": listed(1000, "text")}],
    },
    "assemblyai in seconds": {"audio_duration": 3.0, "words": listed(text="text")},
    "azure": {"NBest": [{"Words": with_durations("Offset", 1e7, "Word", "Duration")}]},
    "azure batch": {
        "recognizedPhrases": [
            {"nBest": [{"words": with_durations("offsetInTicks", 1e7, "word", "durationInTicks")}]}
        ]
    },
    "rev": {
        "monologues": [
            {
                "speaker": 0,
                "elements": [
                    *({"type": "text", "value": w, "ts": s, "end_ts": e} for w, s, e in TURNING),
                    {"type": "punct", "value": "."},
                ],
            }
        ]
    },
    "hugging face": {
        "text": "",
        "chunks": [{"text": f" {w}", "timestamp": [s, e]} for w, s, e in TURNING],
    },
    "openai, words asked for": {
        "duration": 3.0,
        "words": listed(),
        "segments": [{"start": 0.4, "end": 2.6, "text": " So the big wheel"}],
    },
    "faster-whisper list": [{"start": 0.4, "end": 2.6, "text": "", "words": listed()}],
    "whisperx word_segments alone": {"segments": [], "word_segments": listed()},
    "mfa of one speaker": {
        "tiers": {
            "Bob - words": {"entries": [[s, e, w] for w, s, e in TURNING]},
            "Bob - phones": {"entries": [[0.4, 0.5, "S"]]},
        }
    },
    "nemo": {"words": [word | {"start_offset": 5, "end_offset": 7} for word in listed()]},
}


def test_words_of_several_speakers_are_told(tmp_path):
    speakers = [{**word, "speaker": f"S{i % 2}"} for i, word in enumerate(listed())]
    aws = [
        {"type": "pronunciation", "start_time": s, "end_time": e, "speaker_label": f"spk_{w}"}
        | {"alternatives": [{"content": w}]}
        for w, s, e in TURNING[:2]
    ]
    google = [{"channelTag": i + 1, "alternatives": [{"words": [listed()[i]]}]} for i in (0, 1)]
    for document in (
        {"audio_duration": 3.0, "words": speakers},
        {"segments": [{"start": 0.4, "end": 2.6, "text": "", "words": speakers}]},
        {"results": {"items": aws}},
        {"results": google},
    ):
        (tmp_path / "a.json").write_text(json.dumps(document))
        notes = read_transcript_with_timing(tmp_path / "a.json").notes
        assert notes == ("holds the words of 2 speakers or channels, all of which are taken",)


def test_dates_of_speechmatics_are_read_as_they_were_said(tmp_path):
    def word(text, start, end, kind="word", **more):
        times = {"start_time": start, "end_time": end}
        return {"type": kind, **times, "alternatives": [{"content": text}], **more}

    said = [word(*one) for one in TURNING[1:3]]
    items = [word(*TURNING[0]), word("1 big", 0.62, 1.1, "entity", spoken_form=said)]
    items.append(word("7", 1.2, 1.4, "entity"))
    (tmp_path / "a.json").write_text(json.dumps({"results": items}))
    assert times(read_transcript(tmp_path / "a.json")) == [*TURNING[:3], ("7", 1.2, 1.4)]


def test_guesses_while_listening_are_left_out(tmp_path):
    guess = {"final": False, "alternatives": [{"timestamps": [["sow", 0.41, 0.63]]}]}
    final = {"final": True, "alternatives": [{"timestamps": [list(word) for word in TURNING]}]}
    (tmp_path / "a.json").write_text(json.dumps({"results": [guess, final]}))
    assert times(read_transcript(tmp_path / "a.json")) == TURNING


def test_times_that_are_none_are_not_taken_for_some(tmp_path):
    marks = [
        {"time": 400 + 300 * i, "type": kind, "start": 5 * i, "end": 5 * i + 3, "value": word}
        for i, (kind, word) in enumerate((("sentence", "so on"), ("word", "so"), ("word", "on")))
    ]
    (tmp_path / "a.json").write_text("\n".join(map(json.dumps, marks)))
    words = read_transcript(tmp_path / "a.json")
    assert [(word.text, round(word.start, 6)) for word in words] == [("so", 0.7), ("on", 1.0)]
    frames = [{"word": "so", "start_offset": 5, "end_offset": 7}]
    (tmp_path / "a.json").write_text(json.dumps(frames))
    with pytest.raises(InputFileError, match="have no times under a name that is known"):
        read_transcript(tmp_path / "a.json")
    few = {"audio_duration": 3600, "words": listed(1000, "text")}
    (tmp_path / "a.json").write_text(json.dumps(few))
    assert times(read_transcript(tmp_path / "a.json", 3600.0)) == TURNING


@pytest.mark.parametrize(("document"), SHAPES.values(), ids=SHAPES.keys())
def test_shapes(tmp_path, document):
    (tmp_path / "a.json").write_text(json.dumps(document))
    assert times(read_transcript(tmp_path / "a.json", 3.0)) == TURNING


def test_parts_of_words_are_joined(tmp_path):
    tokens = [
        ("[_BEG_]", 0, 0),
        (" So", 400, 620),
        (" the", 620, 750),
        (" whe", 1100, 1300),
        ("el", 1300, 1520),
        (".", 1520, 1520),
        ("[_TT_76]", 1520, 1520),
    ]
    offsets = {"from": 400, "to": 1520}
    listed = [{"text": t, "offsets": {"from": s, "to": e}} for t, s, e in tokens]
    document = {"transcription": [{"text": " So the wheel.", "offsets": offsets, "tokens": listed}]}
    (tmp_path / "a.json").write_text(json.dumps(document))
    expected = [("So", 0.4, 0.62), ("the", 0.62, 0.75), ("wheel.", 1.1, 1.52)]
    assert times(read_transcript(tmp_path / "a.json")) == expected
    # Languages without blanks have a word per token.
    tokens = [
        {"text": t, "offsets": {"from": 400 * i, "to": 400 * i + 400}} for i, t in enumerate("你好")
    ]
    document = {"transcription": [{"text": "你好", "offsets": offsets, "tokens": tokens}]}
    (tmp_path / "a.json").write_text(json.dumps(document))
    assert times(read_transcript(tmp_path / "a.json")) == [("你", 0.0, 0.4), ("好", 0.4, 0.8)]


def azure_phrase(text, offset, **more):
    best = {"lexical": text.lower(), "display": text} | more
    ticks = {"offsetInTicks": offset * 1e7, "durationInTicks": 1e7}
    return ticks | {"offset": f"PT{offset}S", "duration": "PT1S", "nBest": [best]}


def test_phrases_of_azure_without_word_times_are_spread(tmp_path):
    path = tmp_path / "a.json"
    phrases = [azure_phrase("So it.", 1), azure_phrase("", 2), azure_phrase("Turns.", 3)]
    path.write_text(json.dumps({"recognizedPhrases": phrases}))
    transcript = read_transcript_with_timing(path, 6.0)
    assert times(transcript.words) == [("So", 1.0, 1.5), ("it.", 1.5, 2.0), ("Turns.", 3.0, 4.0)]
    assert (transcript.timing, transcript.notes) == ("spread", ())
    words = [{"word": "slowly", "offsetInTicks": 5e7, "durationInTicks": 4e6}]
    phrases.append(azure_phrase("Slowly.", 5, words=words))
    path.write_text(json.dumps({"recognizedPhrases": phrases[2:]}))
    transcript = read_transcript_with_timing(path, 6.0)
    assert times(transcript.words) == [("Turns.", 3.0, 4.0), ("slowly", 5.0, 5.4)]
    assert transcript.notes == ("1 segment of 2 without word times: the words were spread over it",)


def test_a_segment_that_was_not_aligned_is_spread():
    failed = WILD / "whisperx_unaligned_segment/whisperx_failed_segment.json"
    transcript = read_transcript_with_timing(failed, 7.0)
    assert [(word.text, word.start, word.end) for word in transcript.words] == [
        ("So", 0.4, 0.62),
        ("the", 0.62, 0.75),
        ("big", 0.75, 1.1),
        ("wheel", 1.1, 1.52),
        ("15.09.2021", 2.0, 4.0),
        ("turns", 5.0, 5.4),
        ("slowly", 5.4, 6.0),
    ]
    assert transcript.timing == "words"
    assert transcript.notes == ("1 segment of 3 without word times: the words were spread over it",)
    mixed = WILD / "whisperx_unaligned_segment/whisper_mixed_segments.json"
    # 8 and 7 letters over 2 s
    assert times(read_transcript(mixed)[3:]) == [
        ("nineteen", 2.0, 2 + 16 / 15),
        ("hundred", 2 + 16 / 15, 4.0),
    ]


def test_whisper_cpp_joins_no_words_across_segments(tmp_path):
    def segment(text, start, end, *tokens):
        listed = [{"text": t, "offsets": {"from": s, "to": e}} for t, s, e in tokens]
        return {"text": text, "offsets": {"from": start, "to": end}, "tokens": listed}

    segments = [
        segment(" the wheel", 400, 1000, (" the", 400, 600), (" wheel", 600, 900), (",", 900, 990)),
        segment("turns on", 1600, 2000, ("turns", 1600, 1800), (" on", 1800, 2000), ("♪", 0, 0)),
        segment("- slowly", 2000, 2600, ("-", 2000, 2010), (" slowly", 2100, 2600)),
    ]
    expected = [("the", 0.4, 0.6), ("wheel,", 0.6, 0.9), ("turns", 1.6, 1.8), ("on", 1.8, 2.0)]
    (tmp_path / "a.json").write_text(json.dumps({"transcription": segments}))
    assert times(read_transcript(tmp_path / "a.json")) == [*expected, ("slowly", 2.1, 2.6)]
    for part in segments:
        del part["tokens"]
    (tmp_path / "a.json").write_text(json.dumps({"transcription": segments}))
    words = read_transcript(tmp_path / "a.json")
    assert [word.text for word in words] == ["the", "wheel", "turns", "on", "slowly"]
    # With -ml 1, a segment is a part of a word.
    parts = [
        segment(t, s, e) for t, s, e in ((" whe", 400, 500), ("el", 500, 700), (".", 700, 900))
    ]
    (tmp_path / "a.json").write_text(json.dumps({"transcription": parts}))
    assert times(read_transcript(tmp_path / "a.json")) == [("wheel.", 0.4, 0.7)]


def test_words_without_times_lie_within_their_segment(tmp_path):
    def segment(start, end, *words):
        listed = [
            {"word": w} | ({} if s is None else {"start": s, "end": s + 0.3}) for w, s in words
        ]
        text = " ".join(word for word, _ in words)
        return {"start": start, "end": end, "text": text, "words": listed}

    segments = [
        segment(1.0, 2.0, ("go", 1.0), ("on", 1.5)),
        segment(20.0, 21.0, ("1984.", None)),
        segment(40.0, 42.0, ("12", None), ("it", 40.5), ("is", 41.0), ("7", None)),
    ]
    (tmp_path / "a.json").write_text(json.dumps({"segments": segments}))
    words = read_transcript(tmp_path / "a.json")
    assert times(words)[2:4] == [("1984.", 20.0, 21.0), ("12", 40.0, 40.5)]
    assert times(words)[-1] == ("7", 41.3, 42.0)
    none = {"segments": segments[1:2], "word_segments": segments[1]["words"]}
    (tmp_path / "a.json").write_text(json.dumps(none))
    assert times(read_transcript(tmp_path / "a.json")) == [("1984.", 20.0, 21.0)]


def test_a_word_without_numbers_for_times_lies_between_its_neighbours(tmp_path):
    words = [*listed()[:2], {"word": "odd", "start": float("nan"), "end": float("nan")}]
    (tmp_path / "a.json").write_text(json.dumps({"segments": [{"words": [*words, listed()[4]]}]}))
    transcript = read_transcript_with_timing(tmp_path / "a.json")
    assert transcript.words[2] == Word("odd", 0.75, 1.6)
    assert transcript.notes == ("1 of 4 words lacks a time: placed by neighbours",)


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ({"names": [], "frames": []}, r"known shape \(it has 'names', 'frames'\)\n  -> known are"),
        ({"words": [{"word": "so", "t": 1}]}, r"words\[0\]: its words have no times .*'word', 't'"),
        ([{"word": "a", "start": 0, "end": float("inf")}], r"\[0\]: the time of 'a' is inf"),
        (
            {"results": {"channels": [{"alternatives": [{"words": listed()}]}] * 2}},
            "holds the words of 2 channels",
        ),
        (
            {"tiers": {"phones": {"entries": [[0, 1, "AA1"], [1, 2, "B"]]}}},
            r"holds phones and no words \(tiers: 'phones'\)",
        ),
        ({"words": [{"word": "a", "start": 0, "end": "1" * 400}]}, "is not a time"),
        (
            {
                "chunks": [
                    {"text": " so on", "timestamp": [0.0, 29.0]},
                    {"text": " more", "timestamp": [0.0, 5.0]},
                ]
            },
            r"chunks\[1\]: its times start again at 0 s, after 29 s",
        ),
        ({"results": [{"alternatives": [{"transcript": "so on"}]}]}, "a text but no word times"),
        (
            {"recognizedPhrases": [{"offset": "PT0.4S", "nBest": [{"display": "So on."}]}]},
            "a text but no word times",
        ),
        (
            {"results": {"channels": [{"alternatives": [{"transcript": "so on", "words": []}]}]}},
            "a text but no word times",
        ),
    ],
)
def test_what_is_not_read_says_so(tmp_path, document, message):
    (tmp_path / "a.json").write_text(json.dumps(document))
    with pytest.raises(InputFileError, match=message):
        read_transcript(tmp_path / "a.json")


def test_a_stream_that_is_cut_off_names_the_place(tmp_path):
    (tmp_path / "a.json").write_text('{"result": []}\n{"result": [\n')
    with pytest.raises(InputFileError, match="line 3, column 1: is not valid JSON"):
        read_transcript(tmp_path / "a.json")


def test_half_a_surrogate_pair_is_replaced():
    path = Path(__file__).parents[1] / "data/hostile/json_lone_surrogate/a.json"
    assert read_transcript(path) == (Word("a\ufffdb", 0.0, 1.0),)


def segments_of(*segments):
    return {
        "segments": [
            {
                "start": start,
                "end": end,
                "text": "",
                "words": [{"word": w, "start": s, "end": e} for w, s, e in words],
            }
            for start, end, words in segments
        ]
    }


def test_words_whose_times_count_from_their_segment(tmp_path):
    path = tmp_path / "a.json"
    first = (0.4, 1.5, [("so", 0.0, 0.2), ("the", 0.2, 0.4), ("big", 0.4, 1.1)])
    path.write_text(json.dumps(segments_of(first, (1.6, 2.6, [("wheel", 0.1, 1.0)]))))
    transcript = read_transcript_with_timing(path, 3.0)
    assert [(w.text, round(w.start, 3), round(w.end, 3)) for w in transcript.words] == [
        ("so", 0.4, 0.6),
        ("the", 0.6, 0.8),
        ("big", 0.8, 1.5),
        ("wheel", 1.7, 2.6),
    ]
    assert transcript.notes == (
        "its words' times count from their segment's start, which was added",
    )


def test_words_before_their_segments_are_refused_and_loose_ones_left(tmp_path):
    path = tmp_path / "a.json"
    path.write_text(json.dumps(segments_of((1.6, 2.0, [("so", 0.1, 1.2)]))))
    with pytest.raises(InputFileError, match=r"starts at 1\.6 has words up to 1\.2"):
        read_transcript_with_timing(path, 3.0)
    path.write_text(json.dumps(segments_of((1.6, 2.0, [("so", 1.2, 1.7), ("on", 1.8, 2.5)]))))
    transcript = read_transcript_with_timing(path, 3.0)
    assert [word.start for word in transcript.words] == [1.2, 1.8]
    assert transcript.notes == ("words reach up to 0.5 s out of their segments",)
    path.write_text(json.dumps(segments_of((1.0, 2.9, [("so", 0.5, 1.7), ("on", 1.7, 2.0)]))))
    transcript = read_transcript_with_timing(path, 3.0)
    assert [word.start for word in transcript.words] == [0.5, 1.7]
    assert transcript.notes == ("words reach up to 0.5 s out of their segments",)
    path.write_text(json.dumps(segments_of((400, 1500, [("so", 0.4, 0.7), ("on", 0.7, 1.5)]))))
    assert [word.start for word in read_transcript_with_timing(path, 3.0).words] == [0.4, 0.7]
    in_ms = [(word, start * 1000, end * 1000) for word, start, end in TURNING]
    path.write_text(json.dumps(segments_of((0.4, 2.6, in_ms))))
    (note,) = read_transcript_with_timing(path, 3.0).notes
    assert note.startswith("its times are milliseconds")
