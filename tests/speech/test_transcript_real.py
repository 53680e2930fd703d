"""Transcripts that came with real recordings."""

import difflib

import pytest

from cospeech.speech.audio import load_audio
from cospeech.speech.transcript import read_transcript, read_transcript_with_timing


@pytest.mark.parametrize(
    ("name", "count", "first", "last"),
    [
        ("2_scott_0_1_1", 199, ("the", 1.42, 1.52), ("better", 61.89, 62.42)),
        ("2_scott_0_2_2", 201, ("so", 1.45, 1.87), ("restaurants", 60.1, 60.81)),
    ],
)
def test_beat_textgrids(shared, name, count, first, last):
    words = read_transcript(shared / f"data/real/beat/{name}.TextGrid")
    assert len(words) == count
    assert (words[0].text, words[0].start, words[0].end) == first
    assert (words[-1].text, words[-1].start, words[-1].end) == last


def test_aligner_textgrids_agree_with_each_other_and_the_text(shared):
    folder = shared / "data/real/speech/mfa"
    text = (folder / "acoustic_corpus.lab").read_text().split()
    long = read_transcript(folder / "acoustic_corpus.long.TextGrid")
    short = read_transcript(folder / "acoustic_corpus.short.TextGrid")
    assert [word.text for word in long] == text  # 59 words
    # the short file is another annotation: it has no "uh", and one "words" is a "word"
    matcher = difflib.SequenceMatcher(
        None, [word.text for word in long], [word.text for word in short], autojunk=False
    )
    pairs = [
        (long[block.a + i], short[block.b + i])
        for block in matcher.get_matching_blocks()
        for i in range(block.size)
    ]
    assert (len(long), len(short), len(pairs)) == (59, 58, 57)
    # 0.18 s: "we're", which begins where the other file has "uh"
    assert max(abs(a.start - b.start) for a, b in pairs) < 0.2
    assert sorted(abs(a.start - b.start) for a, b in pairs)[len(pairs) // 2] < 0.02


def test_gesticulator_json(shared):
    words = read_transcript(shared / "data/real/trinity/gesticulator_jeremy_howard.json")
    assert len(words) == 69 + 8  # two segments
    assert (words[0].text, words[0].start) == ("deep", 0.4)
    assert (words[-1].text, words[-1].end) == ("understand.", 26.0)


def test_ted_culture_lines(shared):
    files = sorted((shared / "data/real/ted_culture").glob("*_with_timing.txt"))
    assert len(files) == 10
    negative = 0
    for path in files:
        transcript = read_transcript_with_timing(path)
        assert transcript.timing == "words"
        assert len(transcript.words) == len(path.read_text().splitlines())
        negative += transcript.words[0].start < 0
        seconds = len(load_audio(str(path).replace("_with_timing.txt", ".wav"))) / 16000
        assert transcript.words[-1].start < seconds
    assert negative == 8


def test_text_without_times_is_spread_over_the_recording(shared):
    folder = shared / "data/real/speech/jfk"
    seconds = len(load_audio(folder / "jfk.flac")) / 16000
    transcript = read_transcript_with_timing(folder / "jfk.txt", duration_s=seconds)
    assert transcript.timing == "spread"
    assert len(transcript.words) == len((folder / "jfk.txt").read_text().split())
    assert transcript.words[0].start == 0.0
    assert transcript.words[-1].end == pytest.approx(seconds)
