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

from cospeech.corpus.build_folder import BuildFolder, json_line, write_json
from cospeech.corpus.packing import (
    EVALUATION_FPS,
    STREAMS,
    PackedSource,
    journal_entry,
    pack,
)
from cospeech.corpus.recording import Recording
from cospeech.corpus.recording_table import RECORDING_FACTS
from cospeech.corpus.source import Dropped
from cospeech.corpus.splits import SPLITS, Span
from cospeech.corpus.statistics import upper_body_statistics
from cospeech.corpus.store import SCHEMA_VERSION, Store
from cospeech.errors import CospeechError
from cospeech.motion.joint_map import JointMap
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
        self._meta = {"name": name, "parameters": parameters, "fingerprint": fingerprint}
        self._rows: dict[str, list[int]] = {stream: [] for stream in STREAMS}
        self._columns: dict[str, list[Any]] = {name: [] for name in RECORDING_FACTS}
        self._skeletons: list[dict[str, Any]] = []
        self._word_ids = {token: i for i, token in enumerate(SPECIAL_TOKENS)}
        self._window_grid: dict[str, Any] | None = None
        self.dropped_windows: Counter[str] = Counter()
        self.skipped: list[Dropped] = []
        self.sources_done: list[str] = []

    def __enter__(self) -> StoreWriter:
        made_by = {"schema": SCHEMA_VERSION, "fingerprint": self._meta["fingerprint"]}
        folder = self.path.with_name(f".{self.path.name}.building")
        names = (*(f"{stream}.bin" for stream in STREAMS), ANNOTATIONS)
        self._folder = BuildFolder(folder, made_by, names)
        for entry in self._folder.take_up():
            self._keep(entry)
        if self.sources_done:
            logger.info("going on with %s after %d sources", folder, len(self.sources_done))
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
        packed = pack(recording, self.joint_map, self.has_upper_body)
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

    def finish(self, splits: dict[str, list[Span]]) -> Store:
        """Write the manifest, move the store to its place and open it.

        Args:
            splits: Spans of each split. Statistics come from ``"train"`` alone, but the words, as
                published, from all (spec 3.8).
        """
        self._folder.close()
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
            "statistics": self._statistics(splits["train"]),
            "sources": len(self.sources_done),
            "skipped": [
                {"id": item.id, "reason": item.reason, "kind": item.kind, "is_fault": item.is_fault}
                for item in self.skipped
            ],
            "dropped_windows": dict(sorted(self.dropped_windows.items())),
            "recordings": self._columns,
            "rows": self._rows,
        }
        write_json(self._folder.path / "vocabulary.json", list(self._word_ids))
        write_json(self._folder.path / "manifest.json", manifest)
        if not self._folder.become(self.path):
            if not (self.path / "manifest.json").is_file():
                raise CospeechError(
                    f"{self.path} is in the way: it is no store, and not empty",
                    "move it away and start again; what is done is kept",
                )
            # Another process finished the same store first; its bytes are as good as ours.
            self._folder.discard()
        return Store(self.path)

    def _statistics(self, spans: Sequence[Span]) -> dict[str, list[float]]:
        if not self.has_upper_body:
            return {}
        rows = self._rows["upper_body"]
        upper_body = np.memmap(
            self._folder.path / "upper_body.bin", "<f4", mode="r", shape=(sum(rows), 10, 3)
        )
        return upper_body_statistics(upper_body, np.cumsum([0, *rows]), spans)

    def _dimensions(self) -> int:
        dimensions = set(self._columns["dimensions"])
        if len(dimensions) > 1:
            raise CospeechError("2-D and 3-D motion in one corpus", "prepare them as two corpora")
        return int(dimensions.pop())

    def _width(self, stream: str) -> int:
        return self._dimensions() if stream == "positions" else STREAMS[stream][1]


def _index_of(skeleton: dict[str, Any], known: list[dict[str, Any]]) -> int:
    """Index of the skeleton with the same joints and parents; appended when it is new."""
    for i, other in enumerate(known):
        if other["joints"] == skeleton["joints"] and other["parents"] == skeleton["parents"]:
            return i
    known.append(skeleton)
    return len(known) - 1
