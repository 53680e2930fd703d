"""Transcripts in JSON: one reader per shape that aligners and speech services write.

A new shape is a function from the document to entries, None where the document is of another
shape, and a line in `SHAPES`; `items` has what most of them need.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from cospeech import foreign
from cospeech.errors import ContentError
from cospeech.speech.transcript.entries import Entries, require_few
from cospeech.speech.transcript.json_shapes.aligners import read_tiers, read_word_lists
from cospeech.speech.transcript.json_shapes.items import Document
from cospeech.speech.transcript.json_shapes.services import (
    read_assemblyai,
    read_aws,
    read_azure,
    read_deepgram,
    read_google,
    read_polly,
    read_rev,
    read_watson,
)
from cospeech.speech.transcript.json_shapes.vosk import read_deepspeech, read_vosk
from cospeech.speech.transcript.json_shapes.whispers import (
    read_chunks,
    read_segments,
    read_whisper_cpp,
)

_Shape = Callable[[Document], Entries | None]

SHAPES: dict[str, _Shape] = {
    "Montreal Forced Aligner": read_tiers,
    "whisper.cpp": read_whisper_cpp,
    "AssemblyAI": read_assemblyai,
    "Deepgram": read_deepgram,
    "AWS Transcribe, Speechmatics": read_aws,
    "AWS Polly": read_polly,
    "IBM Watson": read_watson,
    "Google": read_google,
    "Azure": read_azure,
    "Rev": read_rev,
    "Vosk": read_vosk,
    "DeepSpeech, Coqui": read_deepspeech,
    "Hugging Face": read_chunks,
    "Whisper, WhisperX": read_segments,
    "Gentle": read_word_lists,
}
"""Every shape that is read, by what it is called in messages; the first that fits is taken."""


_TEXTS = ("transcript", "text", "display", "Display", "lexical", "DisplayText")


def parse_json_transcript(text: str) -> Entries:
    """Entries of a JSON transcript; a word without times (not found in the audio) has None.

    Several documents in one file, one after another, are taken as a list of them.

    Raises:
        ContentError: Not JSON, or of no known shape.
    """
    hint = "the file is cut off or was edited by hand: export it again"
    documents = foreign.parse_json_stream(text, "a transcript", hint)
    document: Any = documents[0] if len(documents) == 1 else documents
    for read in SHAPES.values():
        source = Document(document)
        found = read(source)
        if found is not None:
            require_few(len(found.entries))
            if not any(entry.text.strip() for entry in found.entries) and _has_text(document):
                raise ContentError(
                    "holds a text but no word times",
                    hint="ask the recogniser for word times (offsets, timestamps), or save the text"
                    " as .txt to have it spread over the sound",
                )
            return _with_speakers(found, len(source.speakers))
    keys = ", ".join(map(repr, list(document)[:6])) if isinstance(document, dict) else ""
    problem = "is JSON but not a transcript of a known shape"
    raise ContentError(
        f"{problem} (it has {keys:.200})" if keys else problem,
        hint=f"known are the outputs of {', '.join(SHAPES)}, and lists of "
        '{"word": ..., "start": ..., "end": ...} in seconds',
    )


def _with_speakers(found: Entries, count: int) -> Entries:
    if count < 2:
        return found
    note = f"holds the words of {count} speakers or channels, all of which are taken"
    return replace(found, notes=(*found.notes, note))


def _has_text(document: Any) -> bool:
    left = [document]
    while left:
        value = left.pop()
        if isinstance(value, dict):
            if any(isinstance(text := value.get(key), str) and text.strip() for key in _TEXTS):
                return True
            left += value.values()
        elif isinstance(value, list):
            left += value
    return False
