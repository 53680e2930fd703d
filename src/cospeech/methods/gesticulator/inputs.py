"""What Gesticulator hears and reads of a frame: fields of speech, and their values in silence."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.cepstra import GESTICULATOR_CEPSTRA
from cospeech.corpus.features.field import SpeechField
from cospeech.corpus.features.mel import gesticulator_mel
from cospeech.corpus.features.prosody import GESTICULATOR_PROSODY
from cospeech.corpus.features.spoken_words import silence, spoken_words
from cospeech.corpus.features.word_vectors import Packaged
from cospeech.errors import ConfigError, InputFileError, require_choice
from cospeech.speech.speech import SAMPLE_RATE, Speech
from cospeech.speech.text.contextual import ContextualVectors, require_extra
from cospeech.speech.text.vectors import StaticVectors, WordVectors

Audio = Literal["spectrogram", "mfcc", "prosody", "mfcc_prosody", "spectrogram_prosody", "none"]
Text = Literal["contextual", "static", "none"]

SILENT_SPECTROGRAM = -12.0
"""Of every band, before and after a speech, as published; digital silence would be -23.026."""

OF_A_RUN = (
    "a finished run needs what it was trained with: put it back, or say where it lies now:"
    " cospeech.load(RUN, {0}=PATH), Gesticulator.load_from_checkpoint(FILE, {0}=PATH)"
)
"""Advice about the argument that names where text has its vectors from."""


@dataclass(frozen=True, eq=False)
class SpeechInputs:
    """What of a speech goes into a frame.

    Attributes:
        fields: In the order of a frame's numbers, sound first.
        silence: ``(width,)`` a frame before or after the speech.
        text_version: Of the vectors of words (`WordVectors`); None without text.
    """

    fields: tuple[SpeechField, ...]
    silence: NDArray[np.float32]
    text_version: str | None


def speech_inputs(
    audio: Audio,
    text: Text,
    language_model: str | None = None,
    special_tokens: bool = False,
    word_vectors: str | None = None,
    published_hop: bool = True,
    published_timing: bool = True,
    words: Sequence[str] = (),
) -> SpeechInputs:
    """The fields that some settings choose; arguments as `Gesticulator`'s.

    ``words`` are the corpus's: static vectors of theirs are looked up at once.

    Around a speech there are -12 in every band of a spectrogram and zeros of prosody, as published.
    The published code refuses cepstra there; here they are those of digital silence.

    Raises:
        ConfigError: An unknown choice, neither sound nor text, or static text without a file.
        CospeechError: What a text setting names can't be read.
    """
    require_choice("model.audio", audio, get_args(Audio))
    require_choice("model.text", text, get_args(Text))
    if audio == text == "none":
        raise ConfigError(
            "model.audio=none and model.text=none leave nothing to gesture to",
            "leave one of the two in",
        )
    fields, edges = list[SpeechField](), list[NDArray[np.float32]]()
    for kind in audio.split("_"):
        if kind != "none":
            field, edge = _OF_SOUND[kind](published_hop)
            fields.append(field)
            edges.append(edge)
    text_version = None
    if text != "none":
        provider = _provider(text, language_model, special_tokens, word_vectors, words)
        fields.append(spoken_words(provider, published_timing))
        edges.append(silence(provider))
        text_version = provider.version
    return SpeechInputs(tuple(fields), np.concatenate(edges), text_version)


def _spectrogram(published_hop: bool) -> tuple[SpeechField, NDArray[np.float32]]:
    field = gesticulator_mel(published_hop)
    return field, np.full(field.width or 0, SILENT_SPECTROGRAM, dtype=np.float32)


def _cepstra(published_hop: bool) -> tuple[SpeechField, NDArray[np.float32]]:
    silent = Speech(np.zeros(SAMPLE_RATE // 10, dtype=np.float32))
    return GESTICULATOR_CEPSTRA, GESTICULATOR_CEPSTRA.of_speech(silent, 20.0, 1)[0]


def _prosody(published_hop: bool) -> tuple[SpeechField, NDArray[np.float32]]:
    return GESTICULATOR_PROSODY, np.zeros(GESTICULATOR_PROSODY.width or 0, dtype=np.float32)


_OF_SOUND: dict[str, Callable[[bool], tuple[SpeechField, NDArray[np.float32]]]] = {
    "spectrogram": _spectrogram,
    "mfcc": _cepstra,
    "prosody": _prosody,
}
"""By the words of a setting: takes ``published_hop``."""


def _provider(
    text: Text,
    language_model: str | None,
    special_tokens: bool,
    word_vectors: str | None,
    words: Sequence[str],
) -> WordVectors:
    if text == "static":
        if word_vectors is None:
            raise ConfigError(
                "model.text=static has no vectors", "name a fastText file: model.word_vectors=FILE"
            )
        if not Path(word_vectors).is_file():
            problem = "the file of word vectors is gone, or was never there"
            hint = f"name a fastText file; {OF_A_RUN.format('word_vectors')}"
            raise InputFileError(word_vectors, problem, hint=hint)
        return StaticVectors(word_vectors, words)
    if language_model is None:
        require_extra()  # which is read when the first vector is asked for
        return Packaged(special_tokens)
    try:
        return ContextualVectors(language_model, special_tokens=special_tokens)
    except InputFileError as error:
        hint = f"{error.hint}; {OF_A_RUN.format('language_model')}"
        problem = error.problem.removeprefix(f"{error.path}: ")
        raise InputFileError(error.path, problem, hint=hint) from error
