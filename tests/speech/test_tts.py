"""Spoken text: words, phonemes and audio on one clock."""

import io
import json
import os
import struct
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from cospeech.errors import CospeechError
from cospeech.speech import espeak
from cospeech.speech.tts import Voice, speak, speak_all, spell_out

pytest.importorskip("espeakng_loader", reason='needs pip install "cospeech[tts]"')

SENTENCE = "The guide carried an enormous basket, out of the tiny kitchen."


@pytest.fixture(scope="module")
def utterance():
    return speak(SENTENCE, Voice("en-us+f3"))


def test_one_word_per_token_with_the_tokens_text(utterance):
    # "out of" and "of the" are single entries of the engine's dictionary and must come apart
    expected = [token.strip(",.") for token in SENTENCE.split()]
    assert [word.text for word in utterance.words] == expected


def test_words_are_in_order_and_inside_the_audio(utterance):
    starts = [word.start for word in utterance.words]
    ends = [word.end for word in utterance.words]
    assert starts == sorted(starts)
    assert all(start < end for start, end in zip(starts, ends, strict=True))
    assert all(end <= start for end, start in zip(ends, starts[1:], strict=False))
    assert ends[-1] <= utterance.speech.duration
    assert utterance.speech.duration - ends[-1] < 0.3


def test_the_pause_at_the_comma_is_silent_and_the_words_are_not(utterance):
    basket, out = utterance.words[5], utterance.words[6]
    assert (basket.text, out.text) == ("basket", "out")
    assert out.start - basket.end > 0.08

    def level(start, end):
        samples = utterance.waveform[round(start * 16000) : round(end * 16000)]
        return float(np.sqrt(np.mean(samples.astype(np.float64) ** 2)))

    words = np.mean([level(word.start, word.end) for word in utterance.words])
    assert level(basket.end + 0.03, out.start - 0.03) < 0.02 * words


def test_waveform_is_mono_float32_within_range(utterance):
    assert utterance.waveform.dtype == np.float32
    assert utterance.waveform.ndim == 1
    assert 0.2 < np.abs(utterance.waveform).max() <= 1.0


def test_stress_is_on_the_syllables_english_stresses(utterance):
    onsets = dict(
        zip(
            (word.text for word in utterance.words),
            zip(utterance.words, utterance.syllable_onsets(), strict=True),
            strict=True,
        )
    )
    word, (onset, stress) = onsets["enormous"]
    assert stress == 2
    # e-NOR-mous: the stressed syllable is not the first and begins with the n
    own = [p for p in utterance.phonemes if p.word == utterance.words.index(word)]
    assert own[1].symbol == "n"
    assert onset == own[1].start > word.start
    word, (onset, stress) = onsets["kitchen"]
    assert stress == 2
    assert onset - word.start < 0.06  # less the closure of the k
    assert onsets["an"][1][1] == 0


def test_phonemes_belong_to_their_words(utterance):
    for phoneme in utterance.phonemes:
        word = utterance.words[phoneme.word]
        assert word.start - 1e-9 <= phoneme.start < phoneme.end
        assert phoneme.start <= word.end


def test_contractions_and_numbers():
    utterance = speak("We don't know why it's 21.")
    texts = [word.text for word in utterance.words]
    assert texts == ["We", "don't", "know", "why", "it's", "twenty", "one"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("wait.. what?!", "wait, what?"),
        ("50% of 1,250 m", "fifty percent of one thousand two hundred and fifty m"),
        ("the 3rd — (really) well-known", "the third, really, well known"),
        ("it’s “fine”", "it's fine"),  # noqa: RUF001
        ("2.5 km/h, 'so'", "two point five km h, so"),
    ],
)
def test_spell_out(text, expected):
    assert spell_out(text) == expected


def test_nothing_to_say():
    with pytest.raises(CospeechError, match="nothing to say"):
        speak(" ... ?! ")


def test_the_same_lines_give_the_same_samples():
    lines = [(SENTENCE, Voice("en-us+m3", pitch=40)), ("No, never.", Voice("en+f2", rate=140))]
    first = list(speak_all(lines))
    time.sleep(1.1)  # left alone, the engine seeds its noise from the clock's whole seconds
    second = list(speak_all(lines))
    for one, other in zip(first, second, strict=True):
        assert one.waveform.tobytes() == other.waveform.tobytes()
        assert one.words == other.words
        assert one.phonemes == other.phonemes


def test_rate_and_pitch_are_heard():
    slow = speak(SENTENCE, Voice(rate=110))
    fast = speak(SENTENCE, Voice(rate=220))
    assert 1.6 < slow.speech.duration / fast.speech.duration < 2.4

    def f0(pitch):
        utterance = speak("ah ah ah ah ah ah", Voice("en-us+m3", pitch=pitch, pitch_range=0))
        wave = utterance.waveform.astype(np.float64)
        correlation = np.fft.irfft(np.abs(np.fft.rfft(wave, 2 * len(wave))) ** 2)
        lags = np.arange(16000 // 300, 16000 // 50)
        return 16000 / lags[np.argmax(correlation[lags])]

    assert f0(90) > 1.25 * f0(10)


def test_unknown_voice_and_variant_are_refused():
    # the engine itself accepts an unknown variant without a word
    with pytest.raises(CospeechError, match=r"variant 'f33'.*'f3'"):
        speak("hello", Voice("en-us+f33"))
    with pytest.raises(CospeechError, match="unknown voice 'xx-zz'"):
        speak("hello", Voice("xx-zz"))


def test_closing_early_ends_the_worker():
    lines = [(SENTENCE, Voice())] * 200
    utterances = speak_all(lines)
    assert next(utterances).words[0].text == "The"
    utterances.close()
    with pytest.raises(StopIteration):
        next(utterances)


def test_missing_extra_names_the_command(monkeypatch):
    monkeypatch.setitem(sys.modules, "espeakng_loader", None)
    answer = io.BytesIO()
    espeak.serve([], answer)
    header = answer.getvalue()
    assert json.loads(header[4:]) == {"missing": "espeakng-loader"}
    assert struct.unpack("<I", header[:4])[0] == len(header) - 4

    from cospeech.speech.tts import _read_answer

    answer.seek(0)
    with pytest.raises(CospeechError, match=r'pip install "cospeech\[tts\]"'):
        _read_answer(answer, io.BytesIO())


def test_a_dead_worker_is_reported_with_its_last_words():
    from cospeech.speech.tts import _read_answer

    with pytest.raises(CospeechError, match="ended early: Segmentation"):
        _read_answer(io.BytesIO(b""), io.BytesIO(b"Segmentation fault"))


def test_missing_number_speller_names_the_command(monkeypatch):
    monkeypatch.setitem(sys.modules, "num2words", None)
    with pytest.raises(CospeechError, match=r'pip install "cospeech\[tts\]"'):
        spell_out("21 apples")


def test_a_long_data_path_is_shortened(tmp_path):
    # beyond about 160 characters the engine silently looks for its data elsewhere
    deep = tmp_path / ("d" * 80) / ("e" * 80) / "espeak-ng-data"
    deep.mkdir(parents=True)
    (deep / "phontab").write_text("x")
    with espeak.short_data_path(deep) as path:
        assert len(os.fsencode(path)) <= espeak.LONGEST_DATA_PATH
        assert (path / "phontab").read_text() == "x"
        link = path
    assert not link.exists()
    short = Path("/short")
    with espeak.short_data_path(short) as path:
        assert path == short
