"""The prepared corpus on disk: flat arrays beside one JSON manifest, read by memory map.

Layout of a store folder::

    checksums.json          of the manifest and the vocabulary
    manifest.json           schema version, parameters, fingerprint, recordings, splits, statistics
    vocabulary.json         word list; a word's id is its index
    annotations.jsonl       one JSON object per recording, in manifest order
    positions.bin           float32, every recording's (T, J, 3) one after another; (T, J, 2) in a
                            corpus of 2-D keypoints
    rotations_local.bin     float32, (T, J, 4) quaternions, scalar last, of the recordings that have
                            them; those of the root are its orientation in the world
    rest_offsets.bin        float64, (J, 3) metres, of the same recordings: their own bone lengths
    upper_body.bin          float32, (T', 10, 3) at the evaluation rate, root-relative
    audio.bin               int16, 16 kHz
    words.bin               (start s, end s, word id) float64 rows
    phases.bin              int8, one per motion frame
    interlocutor_audio.bin  as audio: the other side of a dialogue
    interlocutor_words.bin  as words
    windows.bin             (start frame, start sample) int64 rows: published windows

A store is built in a temporary folder beside its final place and renamed when it is complete, so a
killed build leaves nothing that looks like a store.
"""

from __future__ import annotations

import logging
import mmap
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.facts import CorpusFacts
from cospeech.corpus.manifest import (
    MANIFEST,
    VOCABULARY,
    read_manifest,
    read_vocabulary,
    rebuild,
)
from cospeech.corpus.recording_table import RecordingTable
from cospeech.corpus.splits import Span
from cospeech.errors import ConfigError, InputFileError
from cospeech.foreign import open_file, parse_json, understood
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import EVALUATION_FPS, UPPER_BODY
from cospeech.speech.speech import SAMPLE_RATE, Speech, Word

__all__ = ["SCHEMA_VERSION", "Store"]

logger = logging.getLogger(__name__)

SCHEMA_VERSION = 4


class Store:
    """A prepared corpus, opened by memory map: instant whatever its size, shared by processes.

    Args:
        path: The store's folder.

    Raises:
        InputFileError: It isn't a store, is of another schema version, or a stream is cut short.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        manifest = read_manifest(self.path, SCHEMA_VERSION)
        self.manifest = manifest
        self.name: str = manifest["name"]
        self.fingerprint: str = manifest["fingerprint"]
        with understood(self.path / MANIFEST, "a store's manifest", rebuild(self.path)):
            self.skeletons = [Skeleton.from_dict(values) for values in manifest["skeletons"]]
        self.dimensions: int = manifest["dimensions"]
        self.has_upper_body: bool = manifest["has_upper_body"]
        self.window_grid: dict[str, float] | None = manifest["window_grid"]
        self.recordings = RecordingTable(manifest["recordings"])
        self.splits: dict[str, list[Span]] = {
            name: [Span(*span) for span in spans] for name, spans in manifest["splits"].items()
        }
        self._streams = {
            stream: self._open(stream, **facts) for stream, facts in manifest["streams"].items()
        }
        counts = {
            stream: np.array(manifest["rows"][stream], dtype=np.int64) for stream in self._streams
        }
        self.first_rows = {stream: np.cumsum(rows) - rows for stream, rows in counts.items()}
        self.row_counts = counts
        self.speaker_ids = {name: i + 1 for i, name in enumerate(manifest["speakers"])}

    def _open(self, stream: str, dtype: str, width: int, rows: int) -> NDArray[Any]:
        path = self.path / f"{stream}.bin"
        expected = np.dtype(dtype).itemsize * width * rows
        size = path.stat().st_size if path.is_file() else -1
        if size != expected:
            raise InputFileError(
                path,
                f"holds {size} bytes where the manifest says {expected}",
                hint=rebuild(self.path),
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
        first, count = (
            int(self.first_rows[stream][recording]),
            int(self.row_counts[stream][recording]),
        )
        stop = count if stop is None else min(stop, count)
        start = max(0, min(start, stop))
        return self._streams[stream][first + start : first + stop]

    def upper_body(self, recording: int, start: int = 0, stop: int | None = None) -> NDArray:
        """``(T, 10, 3)`` float32 upper-body positions at the evaluation rate."""
        return self.read(recording, "upper_body", start, stop).reshape(-1, 10, 3)

    def stream(self, stream: str) -> NDArray[Any]:
        """Every row of a stream, ``(rows, width)``; recording i has those from `first_rows` on."""
        return self._streams[stream]

    def audio(self, recording: int, start: int, count: int) -> NDArray[np.float32]:
        """``(count,)`` float32 samples; past the recording's end they are mirrored.

        See docs/facts/trimodal.md, section 3.6.
        """
        audio = np.empty(count, dtype=np.float32)
        self.copy_audio(recording, start, audio)
        return audio

    def copy_audio(self, recording: int, start: int, into: NDArray[np.float32]) -> None:
        """Fill ``into`` with samples from ``start`` on; past the end they are mirrored."""
        if start < 0:  # silence before the recording begins
            silent = min(-start, len(into))
            into[:silent] = 0
            into, start = into[silent:], 0
        samples = self.read(recording, "audio", start, start + len(into))[:, 0]
        there = len(samples)
        np.multiply(samples, np.float32(1 / 32767), out=into[:there])
        missing = len(into) - there
        if missing and there:
            into[there:] = np.pad(into[:there], (0, missing), mode="symmetric")[there:]
        else:
            into[there:] = 0

    def will_read(self, stream: str, first_rows: NDArray[np.int64], rows: int) -> None:
        """Ask the system to fetch stretches of a stream from disk, all at once.

        Reading them one by one would wait for the disk once per stretch.

        Args:
            stream: A stream name.
            first_rows: First row of each stretch, counted over the whole stream.
            rows: Rows of each.
        """
        values = self._streams[stream]
        pages: mmap.mmap | None = getattr(values, "_mmap", None)
        if pages is None or not hasattr(pages, "madvise"):  # an empty stream, or no such call here
            return
        row_bytes = values.itemsize * values.shape[1]
        for first in np.sort(first_rows).clip(min=0).tolist():
            start = first * row_bytes // mmap.PAGESIZE * mmap.PAGESIZE
            stop = min((first + rows) * row_bytes, len(pages))
            pages.madvise(mmap.MADV_WILLNEED, start, stop - start)

    def words(self, recording: int) -> NDArray[np.float64]:
        """``(W, 3)`` float64: start s, end s, word id, in order of onset."""
        return self.read(recording, "words")

    def speech(self, span: Span) -> Speech:
        """Speech of a span, its clock starting at the span's first frame."""
        return self._speech(span, "audio", "words", self.recordings[span.recording].has_words)

    def interlocutor(self, span: Span) -> Speech | None:
        """Speech of the other side of the dialogue in a span; None where there is none."""
        if not self.recordings[span.recording].has_interlocutor:
            return None
        return self._speech(span, "interlocutor_audio", "interlocutor_words", True)

    def _speech(self, span: Span, audio: str, words: str, has_words: bool) -> Speech:
        offset = span.start / EVALUATION_FPS
        duration = (span.stop - span.start) / EVALUATION_FPS
        first = round(offset * SAMPLE_RATE)
        # Rounded down: a sample too many would be a frame too many of motion that covers the audio.
        count = int(duration * SAMPLE_RATE + 1e-6)
        samples = self.read(span.recording, audio, first, first + count)[:, 0]
        waveform = samples * np.float32(1 / 32767)
        if 0 < len(waveform) < count:
            waveform = np.pad(waveform, (0, count - len(waveform)), mode="symmetric")
        if not has_words:
            return Speech(waveform, None)
        rows = self.read(span.recording, words)
        inside = rows[(rows[:, 0] < offset + duration) & (rows[:, 1] > offset)]
        vocabulary = self.vocabulary
        with understood(self.path / VOCABULARY, "the vocabulary of this store", rebuild(self.path)):
            # Transcripts may hold a word that ends before it begins; no method takes such.
            found = tuple(
                Word(vocabulary[int(i)], start - offset, max(start, end) - offset)
                for start, end, i in inside
            )
        return Speech(waveform, found)

    def motion(self, recording: int) -> Motion:
        """Full-skeleton motion at its native rate; 2-D in a corpus of keypoints.

        With rotations where the recording has them, on a skeleton with the recording's own bones:
        forward kinematics from the root's positions gives the other positions.
        """
        stored = self.recordings[recording]
        skeleton = self.skeletons[stored.skeleton]
        positions = self.read(recording, "positions").reshape(-1, len(skeleton), self.dimensions)
        if not stored.has_rotations:
            return Motion(skeleton, stored.fps, positions)
        rotations = self.read(recording, "rotations_local").reshape(-1, len(skeleton), 4)
        offsets = self.read(recording, "rest_offsets")
        known = skeleton.offsets
        if len(offsets) and (known is None or not np.array_equal(offsets, known)):
            skeleton = replace(skeleton, offsets=np.array(offsets))
        return Motion(skeleton, stored.fps, positions, rotations)

    def upper_body_motion(self, span: Span) -> Motion:
        """Upper-body motion of a span at the evaluation rate."""
        positions = np.array(self.upper_body(span.recording, span.start, span.stop))
        return Motion(UPPER_BODY, EVALUATION_FPS, positions)

    def spans_with_sound(self, spans: Sequence[Span], what_for: str) -> list[Span]:
        """The spans of recordings that have sound; a warning says how many have none.

        Args:
            spans: Any.
            what_for: What the sound is wanted for, for the messages.

        Raises:
            ConfigError: None has.
        """
        has_audio = self.recordings.columns["has_audio"]
        heard = [span for span in spans if has_audio[span.recording]]
        if spans and not heard:
            raise ConfigError(
                f"{self.name}: no recording has sound, which is needed for {what_for}",
                "use a corpus with audio, or a method that reads none",
            )
        if len(heard) < len(spans):
            silent = len(spans) - len(heard)
            text = "%s: %d of %d recordings have no sound and are left out of %s"
            logger.warning(text, self.name, silent, len(spans), what_for)
        return heard

    def phases(self, recording: int) -> NDArray[np.int8] | None:
        """``(T,)`` phase label per native motion frame, or None."""
        if not self.recordings[recording].has_phases:
            return None
        return self.read(recording, "phases")[:, 0]

    @cached_property
    def vocabulary(self) -> list[str]:
        """Word list; a word's id is its index."""
        return read_vocabulary(self.path)

    def annotations(self, recording: int) -> dict[str, Any]:
        """Whatever else is known of a recording."""
        path, what = self.path / "annotations.jsonl", "annotations of a store"
        with understood(path, what, rebuild(self.path)):
            with open_file(path) as file:
                file.seek(self._annotation_offsets[recording])
                line = file.readline().decode("utf-8")
            values: dict[str, Any] = dict(parse_json(path, line, what, rebuild(self.path)))
        return values

    @cached_property
    def _annotation_offsets(self) -> list[int]:
        offsets, offset = [], 0
        with open_file(self.path / "annotations.jsonl") as file:
            for line in file:
                offsets.append(offset)
                offset += len(line)
        return offsets

    def facts(self) -> CorpusFacts:
        """What a method needs to be built and to generate without the store."""
        return {
            "words": self.vocabulary,
            "speakers": list(self.speaker_ids),
            "mean_direction": self.manifest["statistics"].get("mean_direction", []),
            "bone_lengths": self.manifest["statistics"].get("bone_lengths", []),
            "skeleton": self.manifest["skeletons"][0],
            "fingerprint": self.fingerprint,
            "store": str(self.path.absolute()),
        }

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
