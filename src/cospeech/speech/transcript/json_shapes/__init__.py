"""Transcripts in JSON: one reader per shape that aligners and speech services write.

A new shape is a function from the document to entries, None where the document is of another
shape, and a line in `SHAPES`; `items` has what most of them need.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from cospeech import foreign
from cospeech.errors import InputFileError
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


def parse_json(path: Path, text: str) -> Entries:
    """Entries of a JSON transcript; a word without times (not found in the audio) has None.

    Several documents in one file, one after another, are taken as a list of them.

    Raises:
        InputFileError: Not JSON, or of no known shape.
    """
    hint = "the file is cut off or was edited by hand: export it again"
    documents = foreign.parse_json_stream(path, text, "a transcript", hint)
    document: Any = documents[0] if len(documents) == 1 else documents
    for read in SHAPES.values():
        found = read(Document(path, document))
        if found is not None:
            require_few(path, len(found.entries))
            return found
    keys = ", ".join(map(repr, list(document)[:6])) if isinstance(document, dict) else ""
    problem = "is JSON but not a transcript of a known shape"
    raise InputFileError(
        path,
        f"{problem} (it has {keys:.200})" if keys else problem,
        hint=f"known are the outputs of {', '.join(SHAPES)}, and lists of "
        '{"word": ..., "start": ..., "end": ...} in seconds',
    )
