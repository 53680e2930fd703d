"""Building a store: in a temporary folder beside its place, renamed when complete.

A build that was killed goes on where it stopped. What is appended is noted, source by source, in a
journal; whatever was written after its last whole line is cut off again.
"""

from __future__ import annotations

import json
import logging
import os
import shutil
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import numpy as np
import torch

from cospeech.corpus.packing import (
    EVALUATION_FPS,
    STREAMS,
    PackedSource,
    journal_line,
    pack,
)
from cospeech.corpus.recording import Recording
from cospeech.corpus.source import Dropped
from cospeech.corpus.splits import SPLITS, Span
from cospeech.corpus.store import RECORDING_FACTS, SCHEMA_VERSION, Store
from cospeech.errors import CospeechError
from cospeech.motion.codecs import direction_vectors
from cospeech.motion.joint_map import JointMap
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.speech.speech import SAMPLE_RATE
from cospeech.speech.vocabulary import Vocabulary

logger = logging.getLogger(__name__)


class StoreWriter:
    """Builds a store; use as a context manager, then `finish`. One at a time for a path.

    Args:
        path: Final folder.
        name: Corpus name.
        parameters: How the corpus was made, as JSON values; kept in the manifest.
        fingerprint: Hash of the sources and parameters.
        joint_map: Where the evaluation joints are in every skeleton; found by the joints' names
            when None.
        upper_body: Whether the corpus has the ten evaluation joints.
    """

    def __init__(
        self,
        path: Path,
        name: str,
        parameters: dict[str, Any],
        fingerprint: str,
        joint_map: JointMap | None = None,
        upper_body: bool = True,
    ) -> None:
        self.path = path
        self.joint_map, self.has_upper_body = joint_map, upper_body
        self._building = path.with_name(f".{path.name}.building")
        self._meta = {"name": name, "parameters": parameters, "fingerprint": fingerprint}
        self._files: dict[str, IO[bytes]] = {}
        self._ends: dict[str, int] = {}
        self._rows: dict[str, list[int]] = {stream: [] for stream in STREAMS}
        self._columns: dict[str, list[Any]] = {name: [] for name in RECORDING_FACTS}
        self._skeletons: list[dict[str, Any]] = []
        self._texts: dict[str, int] = {}
        self._window_grid: dict[str, Any] | None = None
        self.dropped_windows: Counter[str] = Counter()
        self.skipped: list[Dropped] = []
        self.sources_done: list[str] = []

    # The building folder ------------------------------------------------------------------------

    def __enter__(self) -> StoreWriter:
        made_by = {"schema": SCHEMA_VERSION, "fingerprint": self._meta["fingerprint"]}
        if self._read_json("build.json") != made_by:
            shutil.rmtree(self._building, ignore_errors=True)
            self._building.mkdir(parents=True)
            _write_json(self._building / "build.json", made_by)
        for stream in STREAMS:
            self._files[stream] = (self._building / f"{stream}.bin").open("ab")
        for name in ("annotations.jsonl", "journal.jsonl"):
            self._files[name] = (self._building / name).open("ab")
        self._take_up()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for file in self._files.values():
            file.close()
        if not self.sources_done:
            shutil.rmtree(self._building, ignore_errors=True)

    def _read_json(self, name: str) -> Any:
        try:
            return json.loads((self._building / name).read_text())
        except (OSError, ValueError):
            return None

    def _take_up(self) -> None:
        """Go through the journal of an earlier build, and cut off what is not in it."""
        journal = self._building / "journal.jsonl"
        whole = 0
        ends = dict.fromkeys((*STREAMS, "annotations.jsonl"), 0)
        sizes = {name: self._path(name).stat().st_size for name in ends}
        with journal.open("rb") as lines:
            for line in lines:
                try:
                    entry = json.loads(line)
                except ValueError:
                    break  # the line that the kill cut short
                if any(entry["ends"][name] > sizes[name] for name in ends):
                    break  # noted, but its bytes never reached the disk
                ends = entry["ends"]
                self._note(entry)
                whole += len(line)
        self._files["journal.jsonl"].truncate(whole)
        for name, end in ends.items():
            self._files[name].truncate(end)
        self._ends = ends
        if self.sources_done:
            logger.info("going on with %s after %d sources", self._building, len(self.sources_done))

    def _path(self, name: str) -> Path:
        return self._building / (name if "." in name else f"{name}.bin")

    # Appending ----------------------------------------------------------------------------------

    def append(self, source: PackedSource) -> None:
        """Append everything that came out of one source."""
        skeletons = list(self._skeletons)
        indices = []
        self._number(source.texts)
        for packed in source.recordings:
            indices.append(_index_of(packed.skeleton, skeletons))
            data = dict(packed.data)
            for stream, texts in (
                ("words", packed.texts),
                ("interlocutor_words", packed.interlocutor_texts),
            ):
                if texts:
                    data[stream] = self._with_ids(data[stream], texts)
            for stream, values in data.items():
                self._write(stream, values)
            self._write("annotations.jsonl", _line(packed.annotations))
        for name in self._ends:
            self._files[name].flush()
        entry = journal_line(source, self._ends, indices)
        entry["new_skeletons"] = skeletons[len(self._skeletons) :]
        self._files["journal.jsonl"].write(_line(entry))
        self._files["journal.jsonl"].flush()
        for fault in source.faults:
            logger.warning("skipped %s: %s", fault.id, fault.reason)
        self._note(entry)

    def _write(self, name: str, data: bytes) -> None:
        self._files[name].write(data)
        self._ends[name] += len(data)

    def _with_ids(self, rows: bytes, texts: Sequence[str]) -> bytes:
        """Word rows with ids in order of first appearance; `finish` makes them the vocabulary's."""
        words = np.frombuffer(rows, dtype="<f8").reshape(-1, 3).copy()
        words[:, 2] = [self._texts[text] for text in texts]
        return words.tobytes()

    def _number(self, texts: Sequence[str]) -> None:
        for text in texts:
            self._texts.setdefault(text, len(self._texts))

    def add(self, recording: Recording) -> None:
        """Append one recording.

        Raises:
            CospeechError: The motion holds NaN, or its joints have no map to the upper body.
        """
        packed = pack(recording, self.joint_map, self.has_upper_body)
        texts = list(dict.fromkeys(packed.texts + packed.interlocutor_texts))
        self.append(PackedSource(recording.id, [packed], texts=texts))

    def _note(self, entry: dict[str, Any]) -> None:
        """Keep what a journal entry says; the same for a new one and one of an earlier build."""
        self.sources_done.append(entry["source"])
        self._number(entry["texts"])
        for values in entry["dropped"]:
            self.skipped.append(Dropped(**values))
            self.dropped_windows.update(values["windows"])
        self._skeletons += entry["new_skeletons"]
        for values in entry["recordings"]:
            facts = values["facts"]
            for name in RECORDING_FACTS:
                self._columns[name].append(facts[name])
            for stream in STREAMS:
                self._rows[stream].append(values["rows"][stream])
            self.dropped_windows.update(facts["dropped_windows"])
            if facts["window_grid"] is not None:
                if self._window_grid not in (None, facts["window_grid"]):
                    raise ValueError("recordings of one corpus have different window grids")
                self._window_grid = facts["window_grid"]

    @property
    def recording_count(self) -> int:
        """How many recordings have been added."""
        return len(self._columns["id"])

    def column(self, name: str) -> Sequence[Any]:
        """One attribute of `StoredRecording` for every recording added."""
        return self._columns[name]

    def evaluation_frames(self) -> list[int]:
        """Evaluation-rate frames of each recording added.

        Raises:
            CospeechError: None was added; the message says why each was skipped.
        """
        if not self.recording_count:
            reasons = "\n".join(
                f"  {dropped.id}: {dropped.reason}" for dropped in self.skipped[:10]
            )
            raise CospeechError(f"no usable recording for {self._meta['name']}\n{reasons}")
        return self._columns["frames"]

    # Finishing ----------------------------------------------------------------------------------

    def finish(self, splits: dict[str, list[Span]]) -> Store:
        """Write the manifest, move the store to its place and open it.

        Args:
            splits: Spans of each split. Statistics come from ``"train"`` alone, but the words, as
                published, from all (spec 3.8).
        """
        for file in self._files.values():
            file.close()
        vocabulary = Vocabulary.build(self._texts)
        ids = np.array([vocabulary.encode(text) for text in self._texts], dtype="<f8")
        for stream in ("words", "interlocutor_words"):
            rows = sum(self._rows[stream])
            if rows:
                words = np.memmap(
                    self._path(stream), dtype="<f8", mode="r+", shape=(rows, STREAMS[stream][1])
                )
                words[:, 2] = ids[words[:, 2].astype(np.int64)]
                words.flush()
        train = {span.recording for span in splits["train"]}
        if not train:
            raise CospeechError("the training split is empty", "give the corpus more recordings")
        manifest = {
            "schema": SCHEMA_VERSION,
            **self._meta,
            "sample_rate": SAMPLE_RATE,
            "evaluation_fps": EVALUATION_FPS,
            "dimensions": self._dimensions(),
            "has_upper_body": self.has_upper_body,
            "window_grid": self._window_grid,
            "streams": {
                stream: {
                    "dtype": dtype,
                    "width": self._width(stream),
                    "rows": sum(self._rows[stream]),
                }
                for stream, (dtype, _) in STREAMS.items()
            },
            "skeletons": self._skeletons,
            "speakers": sorted({self._columns["speaker"][i] for i in train}),
            "splits": {
                name: [[span.recording, span.start, span.stop] for span in splits[name]]
                for name in SPLITS
            },
            "statistics": self._statistics(splits["train"]) if self.has_upper_body else {},
            "sources": len(self.sources_done),
            "skipped": [
                {"id": item.id, "reason": item.reason, "kind": item.kind, "is_fault": item.is_fault}
                for item in self.skipped
            ],
            "dropped_windows": dict(sorted(self.dropped_windows.items())),
            "recordings": self._columns,
            "rows": self._rows,
        }
        _write_json(self._building / "vocabulary.json", vocabulary.words)
        _write_json(self._building / "manifest.json", manifest)
        for name in ("journal.jsonl", "build.json"):
            (self._building / name).unlink()
        try:
            self._building.rename(self.path)
        except OSError:
            # Another process finished the same store first; its bytes are as good as ours.
            if not (self.path / "manifest.json").is_file():
                raise
            shutil.rmtree(self._building, ignore_errors=True)
        return Store(self.path)

    def _dimensions(self) -> int:
        dimensions = set(self._columns["dimensions"])
        if len(dimensions) > 1:
            raise CospeechError("2-D and 3-D motion in one corpus", "prepare them as two corpora")
        return int(dimensions.pop())

    def _width(self, stream: str) -> int:
        return self._dimensions() if stream == "positions" else STREAMS[stream][1]

    def _statistics(self, spans: Sequence[Span]) -> dict[str, list[float]]:
        """Mean direction vector (27) and mean bone lengths (9, metres) of the training split."""
        total = sum(self._rows["upper_body"])
        upper = np.memmap(self._path("upper_body"), dtype="<f4", mode="r", shape=(total, 10, 3))
        firsts = np.cumsum([0, *self._rows["upper_body"]])
        direction_sum, length_sum, count = np.zeros((9, 3)), np.zeros(9), 0
        parents = list(UPPER_BODY.parents[1:])
        for span in spans:
            first = firsts[span.recording]
            positions = np.array(upper[first + span.start : first + span.stop], dtype=np.float64)
            direction_sum += direction_vectors(torch.from_numpy(positions)).sum(0).numpy()
            bones = positions[:, 1:] - positions[:, parents]
            length_sum += np.linalg.norm(bones, axis=-1).sum(0)
            count += len(positions)
        return {
            "mean_direction": (direction_sum / count).reshape(27).tolist(),
            "bone_lengths": (length_sum / count).tolist(),
        }


def _index_of(skeleton: dict[str, Any], known: list[dict[str, Any]]) -> int:
    """Index of the skeleton with the same joints and parents; appended when it is new."""
    for i, other in enumerate(known):
        if other["joints"] == skeleton["joints"] and other["parents"] == skeleton["parents"]:
            return i
    known.append(skeleton)
    return len(known) - 1


def _line(values: Any) -> bytes:
    return json.dumps(values).encode() + b"\n"


def _write_json(path: Path, values: Any) -> None:
    with path.open("w") as file:
        json.dump(values, file)
        file.flush()
        os.fsync(file.fileno())
