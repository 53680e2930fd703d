"""Building a store: in a temporary folder beside its place, renamed when complete.

A build that was killed goes on after the last source that was noted.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from cospeech.corpus.build_folder import BuildFolder, json_line
from cospeech.corpus.manifest import write_manifest
from cospeech.corpus.packing import (
    STREAMS,
    PackedRecording,
    PackedSource,
    journal_entry,
    pack,
)
from cospeech.corpus.recording import Recording
from cospeech.corpus.recording_table import RECORDING_FACTS
from cospeech.corpus.source import Dropped
from cospeech.corpus.split_facts import split_facts
from cospeech.corpus.splits import Span
from cospeech.corpus.store import SCHEMA_VERSION, Store
from cospeech.errors import CospeechError
from cospeech.files import write_json
from cospeech.motion.upper_body import EVALUATION_FPS
from cospeech.speech.speech import SAMPLE_RATE
from cospeech.speech.vocabulary import SPECIAL_TOKENS

logger = logging.getLogger(__name__)

ANNOTATIONS = "annotations.jsonl"


class StoreWriter:
    """Builds a store; use as a context manager, then `finish`. One at a time for a path.

    Args:
        path: Final folder.
        name: Corpus name.
        parameters: How the corpus was made, as JSON values; kept in the manifest.
        fingerprint: Hash of the sources and parameters.
        reading: Hash of what the recordings depend on, the split apart: a build that was stopped
            goes on for another split, too. The fingerprint when None.
        building: Folder to build in; beside ``path`` when None.
        upper_body: Whether the corpus has the ten evaluation joints.
    """

    def __init__(
        self,
        path: Path,
        name: str,
        parameters: dict[str, Any],
        fingerprint: str,
        upper_body: bool = True,
        reading: str | None = None,
        building: Path | None = None,
    ) -> None:
        self.path = path
        self._reading = reading or fingerprint
        self._building = building or path.with_name(f".{path.name}.building")
        self.has_upper_body = upper_body
        self._meta = {"name": name, "parameters": parameters, "fingerprint": fingerprint}
        self._rows: dict[str, list[int]] = {stream: [] for stream in STREAMS}
        self._columns: dict[str, list[Any]] = {name: [] for name in RECORDING_FACTS}
        self._skeletons: list[dict[str, Any]] = []
        self._word_ids = {token: i for i, token in enumerate(SPECIAL_TOKENS)}
        self._window_grid: dict[str, Any] | None = None
        self.dropped_windows: Counter[str] = Counter()
        self._remarks: Counter[tuple[str, ...]] = Counter()
        self.skipped: list[Dropped] = []
        self.sources_done: list[str] = []

    def __enter__(self) -> StoreWriter:
        made_by = {"schema": SCHEMA_VERSION, "reading": self._reading}
        names = (*(f"{stream}.bin" for stream in STREAMS), ANNOTATIONS)
        self._folder = BuildFolder(self._building, made_by, names)
        for entry in self._folder.take_up():
            self._keep(entry)
        if self.sources_done:
            done = len(self.sources_done)
            logger.info("going on with %s after %d sources", self._building, done)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._folder.close()
        # Without a recording there is nothing to go on with, and what was wrong may be mended.
        if not self.recording_count:
            self._folder.discard()

    def append(self, source: PackedSource) -> None:
        """Append everything that came out of one source."""
        skeletons = list(self._skeletons)
        indices = []
        self._number(source.texts)
        self._refuse_mixtures(source.recordings)
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
                self._folder.write(f"{stream}.bin", values)
            self._folder.write(ANNOTATIONS, json_line(packed.annotations))
        entry = journal_entry(source, indices)
        entry["new_skeletons"] = skeletons[len(self._skeletons) :]
        self._folder.note(entry)
        for fault in source.faults:
            logger.warning("skipped %s: %s", fault.id, fault.reason)
        self._keep(entry)

    def _refuse_mixtures(self, recordings: Sequence[PackedRecording]) -> None:
        dimensions = set(self._columns["dimensions"])
        dimensions |= {packed.facts["dimensions"] for packed in recordings}
        if len(dimensions) > 1:
            raise CospeechError("2-D and 3-D motion in one corpus", "prepare them as two corpora")
        grid = self._window_grid
        for packed in recordings:
            grid = grid or packed.facts["window_grid"]
            if packed.facts["window_grid"] not in (None, grid):
                raise CospeechError(
                    f"{packed.facts['id']} lists windows of another grid than those before it:"
                    f" {packed.facts['window_grid']}, not {grid}",
                    "prepare them as two corpora",
                )

    def _with_ids(self, rows: bytes, texts: Sequence[str]) -> bytes:
        words = np.frombuffer(rows, dtype="<f8").reshape(-1, 3).copy()
        words[:, 2] = [self._word_ids[text] for text in texts]
        return words.tobytes()

    def _number(self, texts: Sequence[str]) -> None:
        for text in texts:
            self._word_ids.setdefault(text, len(self._word_ids))

    def add(self, recording: Recording) -> None:
        """Append one recording.

        Raises:
            CospeechError: The motion holds NaN, or its joints have no map to the upper body.
        """
        packed = pack(recording, self.has_upper_body)
        texts = list(dict.fromkeys(packed.texts + packed.interlocutor_texts))
        self.append(PackedSource(recording.id, [packed], texts=texts))

    def _keep(self, entry: dict[str, Any]) -> None:
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
            self._remarks.update({tuple(remark) for remark in values["remarks"]})
            self.dropped_windows.update(facts["dropped_windows"])
            self._window_grid = facts["window_grid"] or self._window_grid

    @property
    def recording_count(self) -> int:
        """How many recordings have been added."""
        return len(self._columns["id"])

    def columns(self) -> dict[str, list[Any]]:
        """Each attribute of `StoredRecording` for every recording added.

        Raises:
            CospeechError: None was added; the message says why each was skipped.
        """
        if not self.recording_count:
            reasons = "\n".join(
                f"  {dropped.id}: {dropped.reason}" for dropped in self.skipped[:10]
            )
            raise CospeechError(f"no usable recording for {self._meta['name']}\n{reasons}")
        return self._columns

    def finish(self, splits: dict[str, list[Span]]) -> Store:
        """Write the manifest, move the store to its place and open it.

        Args:
            splits: Spans of each split. Statistics come from ``"train"`` alone, but the words, as
                published, from all (docs/facts/trimodal.md, section 3.8).
        """
        self._folder.close()
        manifest = {
            "schema": SCHEMA_VERSION,
            **self._meta,
            "sample_rate": SAMPLE_RATE,
            "evaluation_fps": EVALUATION_FPS,
            "dimensions": self._width("positions"),
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
            **split_facts(
                splits, self._columns["speaker"], self._folder.path, self._rows["upper_body"]
            ),
            "sources": len(self.sources_done),
            "skipped": [
                {"id": item.id, "reason": item.reason, "kind": item.kind, "is_fault": item.is_fault}
                for item in self.skipped
            ],
            "remarks": [[*remark, count] for remark, count in self._remarks.items()],
            "dropped_windows": dict(sorted(self.dropped_windows.items())),
            "recordings": self._columns,
            "rows": self._rows,
        }
        write_json(self._folder.path / "vocabulary.json", list(self._word_ids))
        write_manifest(self._folder.path, manifest)
        if not self._folder.become(self.path):
            if not (self.path / "manifest.json").is_file():
                raise CospeechError(
                    f"{self.path} is in the way: it is no store, and not empty",
                    "move it away and start again; what is done is kept",
                )
            # Another process finished the same store first; its bytes are as good as ours.
            self._folder.discard()
        return Store(self.path)

    def _width(self, stream: str) -> int:
        if stream == "positions":
            return int(self._columns["dimensions"][0])
        return STREAMS[stream][1]


def _index_of(skeleton: dict[str, Any], known: list[dict[str, Any]]) -> int:
    """Index of the skeleton with the same joints and joint map; appended when it is new."""
    for i, other in enumerate(known):
        if all(other[key] == skeleton[key] for key in ("joints", "parents", "joint_map")):
            return i
    known.append(skeleton)
    return len(known) - 1
