"""Words with times from any transcript a forced aligner, a recogniser or a person wrote."""

from cospeech.speech.transcript.entries import Timing, Transcript
from cospeech.speech.transcript.reader import read_transcript, read_transcript_with_timing
from cospeech.speech.transcript.spreading import spread_text
from cospeech.speech.transcript.units import TIME_UNITS

__all__ = [
    "TIME_UNITS",
    "Timing",
    "Transcript",
    "read_transcript",
    "read_transcript_with_timing",
    "spread_text",
]
