"""What a method must know of a corpus to be built."""

from __future__ import annotations

from typing import Any, TypedDict


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
