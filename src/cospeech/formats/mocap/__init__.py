"""Folders of BVH motion with matching audio and, where there are any, transcripts.

What Trinity, GENEA, BEAT, ZeroEGGS and anybody's own recordings share: files belong together when
their stems are equal, side by side or in folders such as ``Audio``, ``Motion`` and ``Transcripts``.
"""

from cospeech.formats.mocap.finding import MissingAudio, find_takes
from cospeech.formats.mocap.reading import read_take, take_sources
from cospeech.formats.mocap.split_list import (
    leave_out_unsplit,
    read_split_list,
    with_split_list,
)
from cospeech.formats.mocap.takes import Excerpt, ReadingSettings, Take, Voice

__all__ = [
    "Excerpt",
    "MissingAudio",
    "ReadingSettings",
    "Take",
    "Voice",
    "find_takes",
    "leave_out_unsplit",
    "read_split_list",
    "read_take",
    "take_sources",
    "with_split_list",
]
