"""A user's recording as speech."""

from __future__ import annotations

import logging
from pathlib import Path

from cospeech.speech.audio import load_audio
from cospeech.speech.speech import SAMPLE_RATE, Speech
from cospeech.speech.transcript import read_transcript_with_timing

logger = logging.getLogger(__name__)


def read_speech(audio: str | Path, transcript: str | Path | None = None) -> Speech:
    """Read a sound file and, where there is one, its transcript; what is odd about them is logged.

    Args:
        audio: wav, flac, ogg, mp3 ...
        transcript: TextGrid, JSON, TSV, CTM, SRT, VTT or txt; None: no words.

    Raises:
        InputFileError: One of them can't be read.
    """
    waveform = load_audio(audio)
    if transcript is None:
        return Speech(waveform)
    read = read_transcript_with_timing(transcript, len(waveform) / SAMPLE_RATE)
    for note in read.notes:
        logger.warning("%s: %s", transcript, note)
    return Speech(waveform, read.words)
