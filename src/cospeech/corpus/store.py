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
import logging
import os
import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.corpus.facts import CorpusFacts
from cospeech.corpus.recording import Recording
from cospeech.corpus.splits import SPLITS, Span
from cospeech.errors import CospeechError, InputFileError
from cospeech.motion.codecs import direction_vectors
from cospeech.motion.joint_map import JointMap
from cospeech.motion.motion import Motion, resample_positions
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import UPPER_BODY, to_upper_body
from cospeech.speech.speech import SAMPLE_RATE, Speech, Word
from cospeech.speech.vocabulary import Vocabulary, normalise_word

SCHEMA_VERSION = 1
EVALUATION_FPS = 15.0

_STREAMS: dict[str, tuple[str, int]] = {
    "positions": ("<f4", 3),
    "upper_body": ("<f4", 30),
    "audio": ("<i2", 1),
    "words": ("<f8", 3),
    "phases": ("|i1", 1),
}
"""Stream name -> (dtype, numbers per row). A row of `positions` is one joint of one frame."""

logger = logging.getLogger(__name__)


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


class StoreWriter:
    """Builds a store; use as a context manager, then `finish`.

    Args:
        path: Final folder.
        name: Corpus name.
        parameters: How the corpus was made, as JSON values; kept in the manifest.
        fingerprint: Hash of the sources and parameters.
        joint_map: Where the evaluation joints are in every skeleton; found by the joints' names
            when None.
    """

    def __init__(
        self,
        path: Path,
        name: str,
        parameters: dict[str, Any],
        fingerprint: str,
        joint_map: JointMap | None = None,
    ) -> None:
        self.path = path
        self._joint_map = joint_map
        self._building = path.with_name(f".{path.name}.building-{os.getpid()}")
        self._meta = {"name": name, "parameters": parameters, "fingerprint": fingerprint}
        self._files: dict[str, IO[bytes]] = {}
        self._rows = dict.fromkeys(_STREAMS, 0)
        self._recordings: list[StoredRecording] = []
        self._skeletons: list[Skeleton] = []
        self._word_texts: list[list[str]] = []
        self._annotations: list[dict[str, Any]] = []
        self.skipped: list[dict[str, str]] = []

    def __enter__(self) -> StoreWriter:
        shutil.rmtree(self._building, ignore_errors=True)
        self._building.mkdir(parents=True)
        for stream in _STREAMS:
            self._files[stream] = (self._building / f"{stream}.bin").open("wb")
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for file in self._files.values():
            file.close()
        shutil.rmtree(self._building, ignore_errors=True)

    def add(self, recording: Recording) -> None:
        """Append one recording.

        Raises:
            CospeechError: The motion holds NaN, or its joints have no map to the upper body.
        """
        motion = recording.motion
        bad = motion.first_bad_frame()
        if bad is not None:
            joint = int((~np.isfinite(motion.positions[bad])).any(axis=1).argmax())
            raise CospeechError(
                f"recording {recording.id}: NaN or infinite position at frame {bad},"
                f" joint {motion.skeleton.joints[joint]}"
            )
        upper = to_upper_body(motion, self._joint_map)
        # A token without a letter or digit is no word (spec 3.4: empty words are skipped).
        words = [w for w in recording.speech.words or () if normalise_word(w.text)]
        arrays: dict[str, NDArray[Any]] = {
            "positions": motion.positions.reshape(-1, 3),
            "upper_body": resample_positions(upper.positions, motion.fps, EVALUATION_FPS).reshape(
                -1, 30
            ),
            "audio": np.rint(np.clip(recording.speech.waveform, -1, 1) * 32767)[:, None],
            "words": np.array([(w.start, w.end, -1) for w in words]).reshape(-1, 3),
            "phases": np.zeros((0, 1))
            if recording.phases is None
            else np.asarray(recording.phases)[:, None],
        }
        rows = {}
        for stream, array in arrays.items():
            dtype, _ = _STREAMS[stream]
            if stream != "words":  # word ids are known only once every recording was seen
                self._files[stream].write(np.ascontiguousarray(array, dtype=dtype).tobytes())
            rows[stream] = (self._rows[stream], len(array))
            self._rows[stream] += len(array)
        self._word_texts.append([w.text for w in words])
        self._files["words"].write(np.ascontiguousarray(arrays["words"], dtype="<f8").tobytes())
        self._annotations.append({"id": recording.id, **recording.annotations})
        self._recordings.append(
            StoredRecording(
                id=recording.id,
                speaker=recording.speaker,
                skeleton=self._skeleton_index(motion.skeleton),
                fps=motion.fps,
                rows=rows,
                has_words=recording.speech.words is not None,
                has_phases=recording.phases is not None,
                source=recording.source,
                licence=recording.licence,
            )
        )

    def skip(self, recording_id: str, reason: str) -> None:
        """Note a recording that could not be used, with the reason, for the report."""
        self.skipped.append({"id": recording_id, "reason": reason})
        logger.warning("skipped %s: %s", recording_id, reason)

    @property
    def recordings(self) -> Sequence[StoredRecording]:
        """What has been added so far."""
        return self._recordings

    def evaluation_frames(self) -> list[int]:
        """Evaluation-rate frames of each recording added.

        Raises:
            CospeechError: None was added; the message says why each was skipped.
        """
        if not self._recordings:
            reasons = "\n".join(f"  {s['id']}: {s['reason']}" for s in self.skipped[:10])
            raise CospeechError(f"no usable recording for {self._meta['name']}\n{reasons}")
        return [recording.rows["upper_body"][1] for recording in self._recordings]

    def finish(self, splits: dict[str, list[Span]]) -> Store:
        """Write the manifest, move the store to its place and open it.

        Args:
            splits: Spans of each split. Vocabulary and statistics come from ``"train"`` alone, but
                for the words, which as published come from all (spec 3.8).
        """
        vocabulary = Vocabulary.build(
            normalise_word(text) for texts in self._word_texts for text in texts
        )
        for file in self._files.values():
            file.close()
        ids = np.array(
            [vocabulary.encode(text) for texts in self._word_texts for text in texts], dtype="<f8"
        )
        if len(ids):
            words = np.memmap(
                self._building / "words.bin", dtype="<f8", mode="r+", shape=(len(ids), 3)
            )
            words[:, 2] = ids
            words.flush()
        train = sorted({span.recording for span in splits["train"]})
        speakers = sorted({self._recordings[i].speaker for i in train})
        manifest = {
            "schema": SCHEMA_VERSION,
            **self._meta,
            "sample_rate": SAMPLE_RATE,
            "evaluation_fps": EVALUATION_FPS,
            "streams": {
                stream: {"dtype": dtype, "width": width, "rows": self._rows[stream]}
                for stream, (dtype, width) in _STREAMS.items()
            },
            "skeletons": [skeleton.to_dict() for skeleton in self._skeletons],
            "speakers": speakers,
            "splits": {
                name: [[span.recording, span.start, span.stop] for span in splits[name]]
                for name in SPLITS
            },
            "statistics": self._statistics(splits["train"]),
            "skipped": self.skipped,
            "recordings": [asdict(recording) for recording in self._recordings],
        }
        _write_json(self._building / "vocabulary.json", vocabulary.words)
        with (self._building / "annotations.jsonl").open("w") as lines:
            for annotation in self._annotations:
                lines.write(json.dumps(annotation) + "\n")
        _write_json(self._building / "manifest.json", manifest)
        try:
            self._building.rename(self.path)
        except OSError:
            # Another process finished the same store first; its bytes are as good as ours.
            if not (self.path / "manifest.json").is_file():
                raise
        return Store(self.path)

    def _skeleton_index(self, skeleton: Skeleton) -> int:
        for i, known in enumerate(self._skeletons):
            if known.joints == skeleton.joints and known.parents == skeleton.parents:
                return i
        self._skeletons.append(skeleton)
        return len(self._skeletons) - 1

    def _statistics(self, spans: Sequence[Span]) -> dict[str, list[float]]:
        """Mean direction vector (27) and mean bone lengths (9, metres) of the training split."""
        total = self._rows["upper_body"]
        upper = np.memmap(
            self._building / "upper_body.bin", dtype="<f4", mode="r", shape=(total, 10, 3)
        )
        direction_sum, length_sum, count = np.zeros((9, 3)), np.zeros(9), 0
        parents = list(UPPER_BODY.parents[1:])
        for span in spans:
            first = self._recordings[span.recording].rows["upper_body"][0]
            positions = np.array(upper[first + span.start : first + span.stop], dtype=np.float64)
            direction_sum += direction_vectors(torch.from_numpy(positions)).sum(0).numpy()
            bones = positions[:, 1:] - positions[:, parents]
            length_sum += np.linalg.norm(bones, axis=-1).sum(0)
            count += len(positions)
        if count == 0:
            raise CospeechError("the training split is empty", "give the corpus more recordings")
        return {
            "mean_direction": (direction_sum / count).reshape(27).tolist(),
            "bone_lengths": (length_sum / count).tolist(),
        }


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
        audio = self.audio(span.recording, first, round(duration * SAMPLE_RATE))
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


def _write_json(path: Path, values: Any) -> None:
    with path.open("w") as file:
        json.dump(values, file)
        file.flush()
        os.fsync(file.fileno())
