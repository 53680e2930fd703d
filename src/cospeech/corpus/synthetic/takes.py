"""Takes: what is said, by whom, and with which pauses, before anything is spoken or moved."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.synthetic.sentences import Sentence, talk
from cospeech.corpus.synthetic.speakers import Speaker, cast
from cospeech.speech.speech import SAMPLE_RATE, Speech, Word
from cospeech.speech.tts import Phoneme, Utterance, Voice

_TAKES_PER_CORPUS = 48
_SHORTEST_S, _LONGEST_S = 20.0, 90.0
_LETTERS_PER_SECOND_AT_175 = 18.9  # measured over the sixteen voices
_PAUSE_S, _TOPIC_PAUSE_S = 0.45, 1.3  # medians
_MEAN_PAUSE_PER_LETTER_S = 0.6 / 52.0
_GRID_S = 0.2  # takes last a whole number of these, so frames and samples end together
_ROOM_NOISE = 2e-4

# children of the corpus seed; child 0 deals the speakers' styles
_TAKE_STREAM = 1
TEXT_STREAM, PHRASING_STREAM, FORM_STREAM, BODY_STREAM = range(4)


@dataclass(frozen=True)
class Line:
    """A sentence as it will be spoken.

    Attributes:
        sentence: What is said.
        voice: The speaker's voice, varied for this sentence.
        arousal: -1 (flat) to 1 (excited): raises pitch, volume, rate and the size of gestures.
        pause_before: Silence before it, s.
    """

    sentence: Sentence
    voice: Voice
    arousal: float
    pause_before: float


@dataclass(frozen=True)
class TakePlan:
    """Everything about a take that is known before it is spoken.

    Attributes:
        index: Position in the corpus.
        id: Recording id.
        seed: Seed of the corpus; with ``index`` it fixes every random choice of the take.
        speaker: Who talks.
        lines: What is said.
        silence_after: Silence after the last line, s.
    """

    index: int
    id: str
    seed: int
    speaker: Speaker
    lines: tuple[Line, ...]
    silence_after: float

    def rng(self, stream: int) -> np.random.Generator:
        """An independent source of randomness for one part of the take."""
        return _stream(self.seed, self.index, stream)


def _stream(seed: int, index: int, stream: int) -> np.random.Generator:
    return np.random.default_rng(
        np.random.SeedSequence(seed, spawn_key=(_TAKE_STREAM, index, stream))
    )


def plan(minutes: float, seed: int, speakers: int = 16) -> list[TakePlan]:
    """The takes of a corpus, in order; cheap, so a caller can show how many there will be.

    One hour is 48 takes of about 75 s. Smaller corpora have shorter takes, down to 20 s, so that
    even a minute has several. Speakers take turns.

    Args:
        minutes: Speech wanted, pauses included; kept to about 5 %.
        seed: Seed of every choice.
        speakers: Size of the cast.

    Raises:
        ValueError: ``minutes`` is not positive or ``speakers`` is below 1.
    """
    if not minutes > 0:
        raise ValueError(f"minutes must be positive, got {minutes}")
    seconds = minutes * 60
    length = float(np.clip(seconds / _TAKES_PER_CORPUS, _SHORTEST_S, _LONGEST_S))
    count = max(1, round(seconds / length))
    length = seconds / count
    people = cast(speakers, seed)
    return [_plan_take(i, seed, people[i % speakers], length) for i in range(count)]


def _plan_take(index: int, seed: int, speaker: Speaker, seconds: float) -> TakePlan:
    rng = _stream(seed, index, TEXT_STREAM)
    lead_in, silence_after = rng.uniform(0.9, 1.9), rng.uniform(1.4, 2.4)
    wanted = (seconds - lead_in - silence_after) * rng.uniform(0.92, 1.08)
    letters_per_second = _LETTERS_PER_SECOND_AT_175 * speaker.voice.rate / 175
    seconds_per_letter = 1 / letters_per_second + _MEAN_PAUSE_PER_LETTER_S
    sentences = talk(rng, wanted / seconds_per_letter - 25)
    lines = []
    arousal = rng.normal(0, 0.3)
    for i, sentence in enumerate(sentences):
        arousal = float(np.clip(0.6 * arousal + rng.normal(0, 0.4), -1, 1))
        median = _TOPIC_PAUSE_S if sentence.opens_topic else _PAUSE_S
        pause = lead_in if i == 0 else float(np.clip(rng.lognormal(np.log(median), 0.4), 0.2, 3.0))
        lines.append(Line(sentence, _vary(speaker.voice, arousal, rng), arousal, float(pause)))
    take_id = f"syn-{index:03d}-{speaker.name}"
    return TakePlan(index, take_id, seed, speaker, tuple(lines), float(silence_after))


def _vary(voice: Voice, arousal: float, rng: np.random.Generator) -> Voice:
    """The voice of one sentence: excitement is audible, and no two sentences are quite alike."""
    return replace(
        voice,
        rate=round(voice.rate * (1 + 0.06 * arousal + rng.normal(0, 0.03))),
        pitch=int(np.clip(voice.pitch + 7 * arousal + rng.normal(0, 2), 0, 99)),
        pitch_range=int(np.clip(voice.pitch_range + 20 * arousal, 10, 100)),
        volume=int(np.clip(voice.volume * (1 + 0.35 * arousal), 40, 140)),
    )


@dataclass(frozen=True)
class SpokenWord:
    """A word of the take with what the gesturer needs to know about it.

    Attributes:
        text: As transcribed.
        onset: Onset of its most stressed syllable, s.
        stress: Of that syllable: 2 primary, 1 secondary, 0 none.
        loudness: Root mean square of the audio in the 0.2 s from the onset, dB.
        line: Index of its line.
        list_position: Which item of a list it is, counted from 0; None elsewhere.
    """

    text: str
    onset: float
    stress: int
    loudness: float
    line: int
    list_position: int | None


@dataclass(frozen=True, eq=False)
class SpokenTake:
    """The audio track of a take.

    Attributes:
        speech: Waveform and words.
        phonemes: Phonemes with times on the take's clock.
        words: One per word of ``speech``.
        line_starts: Onset of every line, s.
        line_ends: End of every line, s.
    """

    speech: Speech
    phonemes: tuple[Phoneme, ...]
    words: tuple[SpokenWord, ...]
    line_starts: NDArray[np.float64]
    line_ends: NDArray[np.float64]


def assemble(take: TakePlan, utterances: list[Utterance]) -> SpokenTake:
    """Puts the spoken lines and the pauses on one clock.

    Args:
        take: The plan.
        utterances: Its lines, spoken.

    Raises:
        ValueError: There are not as many utterances as lines.
    """
    if len(utterances) != len(take.lines):
        raise ValueError(f"{take.id}: {len(utterances)} utterances for {len(take.lines)} lines")
    starts, cursor = [], 0
    for line, utterance in zip(take.lines, utterances, strict=True):
        cursor += round(line.pause_before * SAMPLE_RATE)
        starts.append(cursor)
        cursor += len(utterance.waveform)
    grid = round(_GRID_S * SAMPLE_RATE)
    total = -(-(cursor + round(take.silence_after * SAMPLE_RATE)) // grid) * grid
    # digital silence exists in no recording, and its logarithm is a feature of its own
    noise = take.rng(TEXT_STREAM).standard_normal(total, dtype=np.float32)
    waveform = noise * np.float32(_ROOM_NOISE)
    words: list[Word] = []
    phonemes: list[Phoneme] = []
    spoken: list[SpokenWord] = []
    for i, (line, utterance, start) in enumerate(zip(take.lines, utterances, starts, strict=True)):
        waveform[start : start + len(utterance.waveform)] += utterance.waveform
        shift = start / SAMPLE_RATE
        position = {word: k for k, word in enumerate(line.sentence.listed)}
        phonemes += [
            replace(p, start=p.start + shift, end=p.end + shift, word=p.word + len(words))
            for p in utterance.phonemes
        ]
        for k, (word, (onset, stress)) in enumerate(
            zip(utterance.words, utterance.syllable_onsets(), strict=True)
        ):
            first = round(onset * SAMPLE_RATE)
            syllable = utterance.waveform[first : first + round(0.2 * SAMPLE_RATE)]
            power = float(np.mean(np.square(syllable, dtype=np.float64))) if len(syllable) else 0.0
            loudness = float(10 * np.log10(power + 1e-8))
            spoken.append(
                SpokenWord(word.text, onset + shift, stress, loudness, i, position.get(k))
            )
        words += [replace(w, start=w.start + shift, end=w.end + shift) for w in utterance.words]
    lengths = np.array([len(utterance.waveform) for utterance in utterances]) / SAMPLE_RATE
    line_starts = np.array(starts) / SAMPLE_RATE
    return SpokenTake(
        Speech(np.clip(waveform, -1, 1), tuple(words)),
        tuple(phonemes),
        tuple(spoken),
        line_starts,
        line_starts + lengths,
    )
