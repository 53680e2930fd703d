"""Spoken text: audio with exact word and phoneme times, from espeak-ng.

Needs the extra ``pip install "cospeech[tts]"``. The engine's own events give the times; nothing is
estimated from the audio.
"""

from __future__ import annotations

import json
import os
import re
import struct
import subprocess
import sys
import tempfile
from collections.abc import Generator, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import IO, Any

import numpy as np
import soxr
from numpy.typing import NDArray

from cospeech.errors import CospeechError
from cospeech.speech.espeak import ENGINE_RATE
from cospeech.speech.speech import SAMPLE_RATE, Speech, Word

_INSTALL = 'pip install "cospeech[tts]"'
_WORD, _CLAUSE_END, _PHONEME = 1, 5, 7
_STRESS_MARKS = {"ˈ": 2, "ˌ": 1}  # noqa: RUF001 - the IPA mark
_VOWELS = frozenset("aeiouyæɐɑɒɔəɚɛɜɝɨɪʉʊʌøœɯɤɵᵻ")  # noqa: RUF001 - IPA letters
_NUMBER = re.compile(r"\d+(?:,\d{3})*(?:\.\d+)?(?:st|nd|rd|th)?\b|\d+", re.IGNORECASE)
_SYMBOLS = {"%": " percent ", "&": " and ", "+": " plus ", "=": " equals ", "@": " at "}


@dataclass(frozen=True)
class Voice:
    """How a line is spoken.

    Attributes:
        name: espeak-ng voice, ``language[+variant]``, e.g. ``en-us+f3``.
        rate: Words per minute, 80 to 450.
        pitch: 0 to 99; 50 is the voice's own.
        pitch_range: 0 (monotone) to 100.
        volume: 0 to 200; 100 is the voice's own.
    """

    name: str = "en-us"
    rate: int = 175
    pitch: int = 50
    pitch_range: int = 50
    volume: int = 100


@dataclass(frozen=True)
class Phoneme:
    """A phoneme as the engine spoke it.

    Attributes:
        symbol: IPA, without the stress mark.
        start: Onset, seconds.
        end: Offset, seconds.
        stress: 2 primary, 1 secondary, 0 none; marked on the vowel.
        word: Index of its word.
    """

    symbol: str
    start: float
    end: float
    stress: int
    word: int

    @property
    def is_vowel(self) -> bool:
        """Whether it is the nucleus of a syllable."""
        return bool(self.symbol) and self.symbol[0] in _VOWELS


@dataclass(frozen=True, eq=False)
class Utterance:
    """A spoken text.

    Attributes:
        text: What was spoken, after `spell_out`.
        waveform: ``(N,)`` float32 in [-1, 1], 16 kHz.
        words: One per whitespace-separated token of ``text``, without punctuation.
        phonemes: In order of onset.
    """

    text: str
    waveform: NDArray[np.float32]
    words: tuple[Word, ...]
    phonemes: tuple[Phoneme, ...]

    @property
    def speech(self) -> Speech:
        """Audio and words."""
        return Speech(self.waveform, self.words)

    def syllable_onsets(self) -> list[tuple[float, int]]:
        """Onset (s) and stress (0 to 2) of each word's most stressed syllable.

        The syllable starts with the consonant before its vowel, or at the start of the word when
        the vowel is the word's first.
        """
        onsets = []
        for index, word in enumerate(self.words):
            own = [phoneme for phoneme in self.phonemes if phoneme.word == index]
            vowels = [i for i, phoneme in enumerate(own) if phoneme.is_vowel]
            if not vowels:
                onsets.append((word.start, 0))
                continue
            nucleus = max(vowels, key=lambda i: (own[i].stress, -i))
            if nucleus == vowels[0]:
                onset = own[0].start
            elif own[nucleus - 1].is_vowel:
                onset = own[nucleus].start
            else:
                onset = own[nucleus - 1].start
            onsets.append((onset, own[nucleus].stress))
        return onsets


def spell_out(text: str) -> str:
    """Text that gives exactly one word event per token: numbers in words, single punctuation marks.

    Raises:
        CospeechError: There is a number and the package that spells it isn't installed, or nothing
            is left to say.
    """
    text = text.replace("’", "'").replace("‘", "'")  # noqa: RUF001
    for symbol, spoken in _SYMBOLS.items():
        text = text.replace(symbol, spoken)
    text = _NUMBER.sub(lambda match: f" {_number_in_words(match.group())} ", text)
    text = re.sub(r"\s*(?:\.{2,}|…|--+|[–—;:()\[\]])\s*", ", ", text)  # noqa: RUF001
    text = re.sub(r"(?<=\w)[-/](?=\w)", " ", text)
    text = re.sub(r"[^\w\s,.?!']|_", " ", text)
    text = re.sub(r"(?<!\w)'|'(?!\w)", " ", text)
    text = re.sub(r"\s+(?=[,.?!])", "", text)
    text = re.sub(r"[,.?!]{2,}", lambda run: min(run.group(), key="?!.,".index), text)
    text = re.sub(r"([,.?!])(?=\w)", r"\1 ", text)
    text = re.sub(r"\s+", " ", text).strip(" ,")
    if not re.search(r"\w", text):
        raise CospeechError("there is nothing to say in the text")
    return text


def _number_in_words(digits: str) -> str:
    try:
        from num2words import num2words
    except ImportError as error:
        raise CospeechError(
            f"the number {digits!r} can't be spelled out without num2words", _INSTALL
        ) from error
    plain = digits.replace(",", "")
    ordinal = plain.lower().endswith(("st", "nd", "rd", "th"))
    spoken = num2words(plain[:-2], to="ordinal") if ordinal else num2words(plain)
    return spoken.replace("-", " ").replace(",", "")


def speak(text: str, voice: Voice | None = None) -> Utterance:
    """One text, spoken by a fresh engine, so that the same call gives the same samples.

    Args:
        text: Any English text; numbers are spelled out.
        voice: The speaker; the engine's plain American voice when None.

    Raises:
        CospeechError: The extra is missing, the voice is unknown, or the text can't be spoken word
            by word.
    """
    return next(iter(speak_all([(text, voice or Voice())])))


def speak_all(lines: Sequence[tuple[str, Voice]]) -> Generator[Utterance, None, None]:
    """The lines in order, spoken by one fresh worker process.

    The result depends on the whole list and its order, and on nothing else: the engine carries
    state from line to line. Closing the generator ends the worker.

    Args:
        lines: Texts and voices.

    Yields:
        One utterance per line, as soon as it is spoken.

    Raises:
        CospeechError: As for `speak`.
    """
    texts = [spell_out(text) for text, _ in lines]
    requests = []
    for text, (_, voice) in zip(texts, lines, strict=True):
        settings = asdict(voice)
        requests.append({"text": text, "voice": settings.pop("name"), **settings})
    for text, (events, samples) in zip(texts, _ask_worker(requests), strict=True):
        yield _utterance(text, events, samples)


def _ask_worker(requests: list[dict[str, Any]]) -> Iterator[tuple[list[list[Any]], bytes]]:
    package_root = str(Path(__file__).resolve().parents[2])
    path = os.pathsep.join(filter(None, [package_root, os.environ.get("PYTHONPATH", "")]))
    with tempfile.TemporaryFile() as complaints:
        worker = subprocess.Popen(
            [sys.executable, "-P", "-m", "cospeech.speech.espeak"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=complaints,
            env={**os.environ, "PYTHONPATH": path},
        )
        assert worker.stdin is not None
        assert worker.stdout is not None
        try:
            # the worker reads all of it before it answers, so neither side waits on a full pipe
            worker.stdin.write(json.dumps(requests).encode())
            worker.stdin.close()
            for _ in requests:
                yield _read_answer(worker.stdout, complaints)
        finally:
            # a worker that still has answers meets the closed pipe, cleans up and ends
            worker.stdout.close()
            try:
                worker.wait(timeout=10)
            except subprocess.TimeoutExpired:
                worker.kill()
                worker.wait()


def _read_answer(stream: IO[bytes], complaints: IO[bytes]) -> tuple[list[list[Any]], bytes]:
    prefix = stream.read(4)
    if len(prefix) < 4:
        complaints.seek(0)
        last_words = complaints.read()[-2000:].decode(errors="replace").strip()
        raise CospeechError(f"the espeak-ng worker ended early: {last_words or 'no message'}")
    header = json.loads(stream.read(struct.unpack("<I", prefix)[0]))
    if "missing" in header:
        raise CospeechError("spoken text needs espeak-ng, which isn't installed", _INSTALL)
    if "error" in header:
        raise CospeechError(header["error"])
    return header["events"], stream.read(header["bytes"])


def _utterance(text: str, events: list[list[Any]], samples: bytes) -> Utterance:
    tokens = text.split()
    word_starts = [sample / ENGINE_RATE for kind, _, sample, _ in events if kind == _WORD]
    assert len(word_starts) == len(tokens), "the engine answers with one word event per token"
    phonemes = _phonemes([event for event in events if event[0] in (_PHONEME, _CLAUSE_END)])
    spoken_ends = dict(zip(range(len(tokens)), word_starts, strict=True))
    for phoneme in phonemes:
        spoken_ends[phoneme.word] = max(spoken_ends[phoneme.word], phoneme.end)
    following_starts = [*word_starts[1:], len(samples) / 2 / ENGINE_RATE]
    words = tuple(
        Word(token.strip(",.?!"), start, min(spoken_ends[index], following))
        for index, (token, start, following) in enumerate(
            zip(tokens, word_starts, following_starts, strict=True)
        )
    )
    engine_wave = np.frombuffer(samples, dtype="<i2").astype(np.float32) / 32768
    waveform = soxr.resample(engine_wave, ENGINE_RATE, SAMPLE_RATE, quality="HQ")
    return Utterance(text, np.clip(waveform, -1, 1).astype(np.float32), words, tuple(phonemes))


def _phonemes(marks: list[list[Any]]) -> list[Phoneme]:
    """Phonemes from the engine's marks; one ends where the next mark (or pause) begins."""
    return [
        Phoneme(
            symbol.lstrip("ˈˌ"),
            sample / ENGINE_RATE,
            following[2] / ENGINE_RATE,
            _STRESS_MARKS.get(symbol[0], 0),
            word,
        )
        for (_, word, sample, symbol), following in pairwise(marks)
        if symbol
    ]
