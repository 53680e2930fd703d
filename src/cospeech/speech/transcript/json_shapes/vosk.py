"""Recognisers that run on one's own machine: Vosk, DeepSpeech and Coqui."""

from __future__ import annotations

from cospeech.speech.transcript.entries import Entries
from cospeech.speech.transcript.json_shapes.items import Document, Item, children, has


def read_vosk(document: Document) -> Entries | None:
    """``{"result": [{"word", "start", "end", "conf"}], "text"}``, or one per utterance.

    With several alternatives of each utterance, the first is taken.
    """
    value = document.value
    is_list = has(value, "result") or (has(value, "alternatives") and has(value, "text"))
    utterances: list[Item]
    if is_list:
        utterances = [(f"[{index}]", item) for index, item in enumerate(value)]
    elif document.list_of("result") is not None or has(document.get("alternatives"), "result"):
        utterances = [("", value)]
    else:
        return None
    entries = []
    for place, utterance in utterances:
        for inner, alternative in children(utterance, "alternatives", place):
            place, utterance = inner, alternative
            break
        entries += [document.entry(*item) for item in children(utterance, "result", place)]
    return Entries(tuple(entries))


def read_deepspeech(document: Document) -> Entries | None:
    """``{"transcripts": [{"words": [{"word", "start_time", "duration"}]}]}``, the best first."""
    if not has(document.get("transcripts"), "words"):
        return None
    entries = []
    for place, transcript in children(document.value, "transcripts"):
        for inner, item in children(transcript, "words", place):
            if isinstance(item, dict):  # some versions write "start_time "
                item = {str(key).strip(): value for key, value in item.items()}
            entries.append(document.entry(inner, item))
        break
    return Entries(tuple(entries))
