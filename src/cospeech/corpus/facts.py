"""What a method must know of a corpus to be built."""

from __future__ import annotations

from typing import Any, TypedDict

from cospeech.corpus.synthetic.body import SKELETON
from cospeech.motion.upper_body import UPPER_BODY


class CorpusFacts(TypedDict):
    """Facts of a prepared corpus, as plain values, so that a checkpoint holds them.

    Attributes:
        words: The vocabulary: a word's id is its index; the first four are PAD, SOS, EOS, UNK.
        speakers: Training speakers; speaker i has id i + 1, and id 0 means unknown.
        mean_direction: 27 numbers, mean direction vectors of the training split, house axes.
        bone_lengths: Nine mean bone lengths of the training split, metres.
        skeleton: The recordings' skeleton (`Skeleton.to_dict`); of several, the first.
        fingerprint: Hash of the corpus's sources and settings.
        store: Folder of the prepared corpus, for methods that look things up in it.
    """

    words: list[str]
    speakers: list[str]
    mean_direction: list[float]
    bone_lengths: list[float]
    skeleton: dict[str, Any]
    fingerprint: str
    store: str


def placeholder_facts() -> CorpusFacts:
    """Facts of a corpus that isn't there, with every joint and statistic that a method may want.

    A method built with them shows whether its settings are possible.
    """
    bones = len(UPPER_BODY) - 1
    return {
        "words": ["<PAD>", "<SOS>", "<EOS>", "<UNK>"],
        "speakers": ["speaker"],
        "mean_direction": [0.0, 1.0, 0.0] * bones,
        "bone_lengths": [0.25] * bones,
        "skeleton": SKELETON.to_dict(),
        "fingerprint": "",
        "store": "",
    }
