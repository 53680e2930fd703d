"""The prepared corpus on disk: flat arrays beside one JSON manifest, read by memory map.

Layout of a store folder::

    manifest.json      schema version, parameters, fingerprint, recordings, splits, statistics
    vocabulary.json    word list; a word's id is its index
    annotations.jsonl  one JSON object per recording, in manifest order
    positions.bin      float32, every recording's (T, J, 3) one after another
    upper_body.bin     float32, (T', 10, 3) at the evaluation rate, root-relative
    audio.bin          int16, 16 kHz
    words.bin          (start s, end s, word id) float64 rows
    phases.bin         int8, one per motion frame

A store is built in a temporary folder beside its final place and renamed when it is complete, so a
killed build leaves nothing that looks like a store.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.facts import CorpusFacts
from cospeech.corpus.splits import Span
from cospeech.errors import InputFileError
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.speech.speech import SAMPLE_RATE, Speech, Word

SCHEMA_VERSION = 1
EVALUATION_FPS = 15.0

STREAMS: dict[str, tuple[str, int]] = {
    "positions": ("<f4", 3),
    "upper_body": ("<f4", 30),
    "audio": ("<i2", 1),
    "words": ("<f8", 3),
    "phases": ("|i1", 1),
}
"""Stream name -> (dtype, numbers per row). A row of `positions` is one joint of one frame."""


@dataclass(frozen=True)
class StoredRecording:
    """What the manifest says of one recording.

    Attributes:
        id: Recording id.
        speaker: Speaker name.
        skeleton: Index into the store's skeletons.
        fps: Native motion rate.
        rows: Stream name -> (first row, number of rows).
        has_words: Whether a transcript exists (an empty list of words differs from none).
        has_phases: Whether gesture phases are annotated.
        source: Where it came from.
        licence: Licence of the data.
    """

    id: str
    speaker: str
    skeleton: int
    fps: float
    rows: dict[str, tuple[int, int]]
    has_words: bool
    has_phases: bool
    source: str
    licence: str


class Store:
    """A prepared corpus, opened by memory map: instant whatever its size, shared by processes.

    Args:
        path: The store's folder.

    Raises:
        InputFileError: It isn't a store, is of another schema version, or a stream is cut short.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        manifest_path = self.path / "manifest.json"
        rebuild = f"delete {self.path} and start again: it will be rebuilt"
        try:
            manifest = json.loads(manifest_path.read_text())
        except FileNotFoundError:
            raise InputFileError(self.path, "not a store (no manifest.json)") from None
        except ValueError as error:
            raise InputFileError(manifest_path, f"damaged: {error}", hint=rebuild) from None
        if manifest.get("schema") != SCHEMA_VERSION:
            raise InputFileError(
                manifest_path,
                f"schema {manifest.get('schema')}, this version reads {SCHEMA_VERSION}",
                hint=rebuild,
            )
        self.manifest = manifest
        self.name: str = manifest["name"]
        self.fingerprint: str = manifest["fingerprint"]
        self.skeletons = [Skeleton.from_dict(values) for values in manifest["skeletons"]]
        self.recordings = [
            StoredRecording(**{**values, "rows": {k: tuple(v) for k, v in values["rows"].items()}})
            for values in manifest["recordings"]
        ]
        self.splits: dict[str, list[Span]] = {
            name: [Span(*span) for span in spans] for name, spans in manifest["splits"].items()
        }
        self._streams = {
            stream: self._open(stream, **facts, rebuild=rebuild)
            for stream, facts in manifest["streams"].items()
        }
        self.speaker_ids = {name: i + 1 for i, name in enumerate(manifest["speakers"])}

    def _open(self, stream: str, dtype: str, width: int, rows: int, rebuild: str) -> NDArray[Any]:
        path = self.path / f"{stream}.bin"
        expected = np.dtype(dtype).itemsize * width * rows
        size = path.stat().st_size if path.is_file() else -1
        if size != expected:
            raise InputFileError(
                path, f"holds {size} bytes where the manifest says {expected}", hint=rebuild
            )
        if rows == 0:
            return np.zeros((0, width), dtype=dtype)
        return np.memmap(path, dtype=dtype, mode="r", shape=(rows, width))

    def read(self, recording: int, stream: str, start: int = 0, stop: int | None = None) -> NDArray:
        """Rows of one stream of one recording, without copying.

        Args:
            recording: Index of the recording.
            stream: A stream name.
            start: First row, relative to the recording.
            stop: Row after the last; None for all.

        Returns:
            ``(rows, width)``; rows outside the recording are not given.
        """
        first, count = self.recordings[recording].rows[stream]
        stop = count if stop is None else min(stop, count)
        start = max(0, min(start, stop))
        return self._streams[stream][first + start : first + stop]

    def upper_body(self, recording: int, start: int = 0, stop: int | None = None) -> NDArray:
        """``(T, 10, 3)`` float32 upper-body positions at the evaluation rate."""
        return self.read(recording, "upper_body", start, stop).reshape(-1, 10, 3)

    def audio(self, recording: int, start: int, count: int) -> NDArray[np.float32]:
        """``(count,)`` float32 samples; past the recording's end they are mirrored (spec 3.6)."""
        samples = self.read(recording, "audio", start, start + count)[:, 0]
        audio = samples.astype(np.float32) * np.float32(1 / 32767)
        missing = count - len(audio)
        if missing and len(audio):
            return np.pad(audio, (0, missing), mode="symmetric")
        return audio if not missing else np.zeros(count, dtype=np.float32)

    def words(self, recording: int) -> NDArray[np.float64]:
        """``(W, 3)`` float64: start s, end s, word id, in order of onset."""
        return self.read(recording, "words")

    def speech(self, span: Span) -> Speech:
        """Speech of a span, its clock starting at the span's first frame."""
        offset = span.start / EVALUATION_FPS
        duration = (span.stop - span.start) / EVALUATION_FPS
        first = round(offset * SAMPLE_RATE)
        # Rounded down: a sample too many would be a frame too many of motion that covers the audio.
        audio = self.audio(span.recording, first, int(duration * SAMPLE_RATE + 1e-6))
        if not self.recordings[span.recording].has_words:
            return Speech(audio, None)
        rows = self.words(span.recording)
        inside = rows[(rows[:, 0] < offset + duration) & (rows[:, 1] > offset)]
        words = tuple(
            Word(self.vocabulary[int(i)], start - offset, end - offset) for start, end, i in inside
        )
        return Speech(audio, words)

    def motion(self, recording: int) -> Motion:
        """Full-skeleton motion at its native rate."""
        stored = self.recordings[recording]
        skeleton = self.skeletons[stored.skeleton]
        positions = self.read(recording, "positions").reshape(-1, len(skeleton), 3)
        return Motion(skeleton, stored.fps, positions)

    def upper_body_motion(self, span: Span) -> Motion:
        """Upper-body motion of a span at the evaluation rate."""
        positions = np.array(self.upper_body(span.recording, span.start, span.stop))
        return Motion(UPPER_BODY, EVALUATION_FPS, positions)

    def phases(self, recording: int) -> NDArray[np.int8] | None:
        """``(T,)`` phase label per native motion frame, or None."""
        if not self.recordings[recording].has_phases:
            return None
        return self.read(recording, "phases")[:, 0]

    @cached_property
    def vocabulary(self) -> list[str]:
        """Word list; a word's id is its index."""
        return json.loads((self.path / "vocabulary.json").read_text())

    def annotations(self, recording: int) -> dict[str, Any]:
        """Whatever else is known of a recording."""
        with (self.path / "annotations.jsonl").open() as file:
            for i, line in enumerate(file):
                if i == recording:
                    return json.loads(line)
        raise IndexError(recording)

    def facts(self) -> CorpusFacts:
        """What a method needs to be built and to generate without the store."""
        return {
            "words": self.vocabulary,
            "speakers": list(self.speaker_ids),
            "mean_direction": self.manifest["statistics"]["mean_direction"],
            "bone_lengths": self.manifest["statistics"]["bone_lengths"],
        }

    def speaker_id(self, recording: int) -> int:
        """Speaker id, 1..n; 0 for a speaker who isn't in the training split."""
        return self.speaker_ids.get(self.recordings[recording].speaker, 0)

    def describe(self) -> str:
        """One line for the terminal."""
        minutes = {
            name: sum(span.stop - span.start for span in spans) / EVALUATION_FPS / 60
            for name, spans in self.splits.items()
        }
        shares = ", ".join(f"{name} {value:.1f}" for name, value in minutes.items())
        return (
            f"{self.name}: {len(self.recordings)} recordings, {len(self.speaker_ids)} training"
            f" speakers, {sum(minutes.values()):.1f} min ({shares}),"
            f" {len(self.vocabulary) - 4} words"
        )
