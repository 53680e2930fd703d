"""Recognisers that run on one's own machine: Vosk, DeepSpeech and Coqui."""

from __future__ import annotations

from cospeech.speech.transcript.entries import Entries
from cospeech.speech.transcript.json_shapes.items import (
    Document,
    Item,
    below,
    children,
    has,
    numbered,
)


def read_vosk(document: Document) -> Entries | None:
    """``{"result": [{"word", "start", "end", "conf"}], "text"}``, or one per utterance.

    With several alternatives of each utterance, the first is taken.
    """
    value = document.value
    is_list = has(value, "result") or (has(value, "alternatives") and has(value, "text"))
    utterances: list[Item]
    if is_list:
        utterances = numbered(value)
    elif document.list_of("result") is not None or has(document.get("alternatives"), "result"):
        utterances = [("", value)]
    else:
        return None
    entries = []
    for place, utterance in utterances:
        best, said = next(children(utterance, "alternatives", place), (place, utterance))
        entries += document.entries(children(said, "result", best))
    return Entries(tuple(entries))


def read_deepspeech(document: Document) -> Entries | None:
    """``{"transcripts": [{"words": [{"word", "start_time", "duration"}]}]}``, the best first."""
    if not has(document.get("transcripts"), "words"):
        return None
    entries = []
    for place, item in below(document.value, "transcripts[0].words"):
        if isinstance(item, dict):  # some versions write "start_time "
            item = {str(key).strip(): value for key, value in item.items()}
        entries.append(document.entry(place, item))
    return Entries(tuple(entries))
