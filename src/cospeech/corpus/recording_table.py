"""What a store's manifest says of its recordings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any, overload


@dataclass(frozen=True)
class StoredRecording:
    """What the manifest says of one recording.

    Attributes:
        id: Recording id.
        speaker: Speaker name.
        skeleton: Index into the store's skeletons.
        fps: Native motion rate.
        frames: Frames at the evaluation rate.
        dimensions: 3, or 2 for keypoints of a picture; one number for the whole corpus.
        split: The split that the corpus publishes, if any.
        has_words: Whether a transcript exists (an empty list of words differs from none).
        has_audio: Whether there is sound.
        has_phases: Whether gesture phases are annotated.
        has_rotations: Whether the joints' rotations are known, not their positions alone.
        has_interlocutor: Whether the other side of a dialogue is there.
        source: Where it came from.
        licence: Licence of the data.
    """

    id: str
    speaker: str
    skeleton: int
    fps: float
    frames: int
    dimensions: int
    split: str | None
    has_words: bool
    has_audio: bool
    has_phases: bool
    has_rotations: bool
    has_interlocutor: bool
    source: str
    licence: str


RECORDING_FACTS = tuple(fact.name for fact in fields(StoredRecording))
"""The columns of a manifest's recordings."""


class RecordingTable(Sequence[StoredRecording]):
    """The manifest's recordings, kept as columns: a large corpus has a quarter of a million.

    Args:
        columns: Attribute of `StoredRecording` -> its value for every recording.
    """

    def __init__(self, columns: dict[str, list[Any]]) -> None:
        self.columns = columns

    def __len__(self) -> int:
        return len(self.columns["id"])

    @overload
    def __getitem__(self, index: int) -> StoredRecording: ...

    @overload
    def __getitem__(self, index: slice) -> list[StoredRecording]: ...

    def __getitem__(self, index: int | slice) -> StoredRecording | list[StoredRecording]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        return StoredRecording(**{name: self.columns[name][index] for name in RECORDING_FACTS})

    def __iter__(self) -> Iterator[StoredRecording]:
        return (self[i] for i in range(len(self)))
