"""Transcripts that don't fit, drift, or have impossible times."""

import numpy as np
import pytest

from cospeech.doctor import Check, Files, Severity, compare, examine, examine_closely
from cospeech.doctor.audio import level_db
from cospeech.doctor.transcript import check_transcript
from cospeech.doctor.word_fit import fit_words, shift_profile
from cospeech.speech.audio import load_audio
from cospeech.speech.speech import Word
from cospeech.speech.transcript import read_transcript
from tests.doctor.planted import moved_words, the_error, the_warning, with_words

FILES = Files("take.bvh", "take.wav", "take.tsv")


def test_the_profile_is_pearsons_correlation_at_every_shift():
    rng = np.random.default_rng(0)
    level = rng.normal(-40, 10, 1500)
    words = np.array([[2.0, 4.0], [5.5, 6.0], [7.0, 9.5], [10.0, 12.5]])
    profile = shift_profile(level, words, 5.0)
    spoken = np.zeros(1500)
    for start, end in words:
        spoken[round(start * 100) : round(end * 100)] = 1
    clear = np.maximum(level, np.percentile(level, 99) - 50)
    for shift in (-500, -250, -37, 0, 99, 200, 250, 500):
        frames = np.arange(200, 1250)
        frames = frames[(frames + shift >= 0) & (frames + shift < 1500)]
        expected = np.corrcoef(clear[frames + shift], spoken[frames])[0, 1]
        assert profile[500 + shift] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("offset", [-3.0, -0.5, 0.3, 1.7])
def test_words_that_come_late_or_early(long_take, offset):
    words = moved_words(long_take, offset)
    words = [word for word in words if word.start > 0]
    finding = the_error(examine(with_words(long_take, words), FILES), Check.TRANSCRIPT)
    assert finding.file == "take.tsv"
    assert f"{abs(offset):.1f}" in finding.problem
    assert f"{'late' if offset > 0 else 'early'}:" in finding.problem


@pytest.mark.parametrize("rate", [0.99, 1.006, 24 / 25, 44.1 / 48])
def test_words_that_run_apart_from_the_audio(long_take, rate):
    words = moved_words(long_take, rate=rate)
    words = [word for word in words if word.end < long_take.speech.duration]
    finding = the_error(examine(with_words(long_take, words), FILES), Check.DRIFT)
    assert finding.file == "take.tsv"
    ratio = float(finding.next_step.removeprefix("multiply the word times by ").split()[0])
    assert ratio == pytest.approx(1 / rate, abs=0.002)


def test_transcripts_of_each_other(takes):
    swapped = [*takes]
    swapped[1] = with_words(takes[1], takes[4].speech.words)
    swapped[4] = with_words(takes[4], takes[1].speech.words)
    examinations = [
        examine_closely(take, Files(take.id, take.id, f"{take.id}.tsv")) for take in swapped
    ]
    findings = [f for f in compare(examinations) if f.check is Check.TRANSCRIPT]
    assert [finding.file for finding in findings] == [f"{takes[i].id}.tsv" for i in (1, 4)]
    assert all(finding.severity is Severity.ERROR for finding in findings)
    assert f"those of {takes[4].id}.tsv do" in findings[0].problem
    assert f"those of {takes[1].id}.tsv do" in findings[1].problem


def test_a_transcript_of_no_recording(long_take, takes):
    foreign = [word for i in (0, 2, 5, 3) for word in takes[i].speech.words]
    words, clock = [], 0.0
    for i in (0, 2, 5, 3):
        words += [Word(w.text, w.start + clock, w.end + clock) for w in takes[i].speech.words]
        clock += takes[i].speech.duration
    assert len(words) == len(foreign)
    words = [word for word in words if word.end < long_take.speech.duration]
    finding = the_error(examine(with_words(long_take, words), FILES), Check.TRANSCRIPT)
    assert "no shift up to 5 s mends it" in finding.problem or "shifted by" in finding.problem


def test_words_after_the_end(takes):
    words = [*takes[0].speech.words, Word("more", 40.0, 40.4)]
    finding = the_error(examine(with_words(takes[0], words), FILES), Check.WORD_TIMES, 40.0)
    assert "'more'" in finding.problem
    assert "40.40 s" in finding.problem


def test_milliseconds(takes):
    finding = the_error(
        examine(with_words(takes[0], moved_words(takes[0], rate=1000)), FILES), Check.WORD_TIMES
    )
    assert finding.next_step == "divide them by 1000"


def test_words_faster_than_anybody(takes):
    start = 8.0
    words = [word for word in takes[0].speech.words if word.end < start or word.start > start + 3]
    words += [Word("la", start + 0.07 * i, start + 0.07 * i + 0.05) for i in range(40)]
    words.sort(key=lambda word: word.start)
    finding = the_error(examine(with_words(takes[0], words), FILES), Check.WORD_TIMES, start)
    assert "words per second" in finding.problem


def test_reversed_and_unordered_words(takes):
    words = list(takes[0].speech.words)
    words[5] = Word(words[5].text, words[5].end, words[5].start)
    assert (
        "end before they start"
        in the_error(examine(with_words(takes[0], words)), Check.WORD_TIMES, words[5].start).problem
    )
    words = list(takes[0].speech.words)
    words[3], words[9] = words[9], words[3]
    finding = the_error(examine(with_words(takes[0], words)), Check.WORD_TIMES, words[4].start)
    assert finding.problem.startswith("2 words are out of order")


def test_an_empty_transcript(takes):
    finding = the_warning(examine(with_words(takes[0], ()), FILES), Check.WORD_TIMES)
    assert "somebody speaks" in finding.problem


def test_a_word_that_swallowed_a_pause(takes):
    words = list(takes[0].speech.words)
    words[-1] = Word(words[-1].text, words[-1].start, words[-1].start + 0.4)
    words[10] = Word(words[10].text, words[10].start, words[10].start + 5)
    the_warning(examine(with_words(takes[0], words)), Check.WORD_TIMES, words[10].start)


def real_speech(shared, name, transcript):
    """Level curve and word intervals of a real recording."""
    folder = shared / "data/real"
    words = read_transcript(folder / transcript)
    times = np.array([(word.start, word.end) for word in words])
    return level_db(load_audio(folder / name)), times


REAL = (
    ("beat/2_scott_0_1_1.wav", "beat/2_scott_0_1_1.TextGrid"),
    ("beat/2_scott_0_2_2.wav", "beat/2_scott_0_2_2.TextGrid"),
    ("speech/mfa/acoustic_corpus.wav", "speech/mfa/acoustic_corpus.long.TextGrid"),
)


@pytest.mark.parametrize(("audio", "transcript"), REAL)
def test_real_transcripts_fit_in_their_place_alone(shared, audio, transcript):
    """As the reference data's own check found: a clear fit at 0, gone at a quarter second."""
    level, times = real_speech(shared, audio, transcript)
    fit = fit_words(level, times)
    assert fit.at_zero > 0.45
    assert abs(fit.shift_s) <= 0.06
    assert fit.best - fit.runner_up > 0.3
    assert check_transcript(level, times, FILES).findings == []
    for shift in (-1.0, -0.3, 0.3, 1.0):
        (finding,) = check_transcript(level, times + shift, FILES).findings
        assert finding.severity is Severity.ERROR
        assert fit_words(level, times + shift).shift_s == pytest.approx(-shift, abs=0.07)


def test_real_transcripts_of_each_other(shared):
    (one, its), (two, others) = (real_speech(shared, *names) for names in REAL[:2])
    for level, times in ((one, others), (two, its)):
        (finding,) = check_transcript(level, times, FILES).findings
        assert (finding.check, finding.severity) == (Check.TRANSCRIPT, Severity.ERROR)
