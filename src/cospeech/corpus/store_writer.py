"""Building a store: in a temporary folder beside its place, renamed when complete."""

from __future__ import annotations

import json
import logging
import os
import shutil
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.corpus.recording import Recording
from cospeech.corpus.splits import SPLITS, Span
from cospeech.corpus.store import (
    EVALUATION_FPS,
    SCHEMA_VERSION,
    STREAMS,
    Store,
    StoredRecording,
)
from cospeech.errors import CospeechError
from cospeech.motion.codecs import direction_vectors
from cospeech.motion.joint_map import JointMap
from cospeech.motion.motion import resample_positions
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import UPPER_BODY, to_upper_body
from cospeech.speech.speech import SAMPLE_RATE
from cospeech.speech.vocabulary import Vocabulary, normalise_word

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
        self._rows = dict.fromkeys(STREAMS, 0)
        self._recordings: list[StoredRecording] = []
        self._skeletons: list[Skeleton] = []
        self._word_texts: list[list[str]] = []
        self._annotations: list[dict[str, Any]] = []
        self.skipped: list[dict[str, str]] = []

    def __enter__(self) -> StoreWriter:
        # What killed builds left; a build that is alive is kept out by the caller's lock.
        for stale in self.path.parent.glob(f".{self.path.name}.building-*"):
            shutil.rmtree(stale, ignore_errors=True)
        self._building.mkdir(parents=True)
        for stream in STREAMS:
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
            dtype, _ = STREAMS[stream]
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
                for stream, (dtype, width) in STREAMS.items()
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


def _write_json(path: Path, values: Any) -> None:
    with path.open("w") as file:
        json.dump(values, file)
        file.flush()
        os.fsync(file.fileno())
