"""What a store's manifest says of a split, and stores that differ by their split alone."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.manifest import write_manifest
from cospeech.corpus.splits import SPLITS, Span, in_groups
from cospeech.corpus.store import Store
from cospeech.errors import CospeechError
from cospeech.motion.upper_body import UPPER_BODY

FRAMES_AT_ONCE = 2048
"""Short spans are averaged together: a corpus of cached samples has a quarter of a million."""


def upper_body_statistics(
    upper_body: NDArray[np.float32], first_rows: NDArray[np.int64], spans: Sequence[Span]
) -> dict[str, list[float]]:
    """Mean direction vectors (27 numbers) and mean bone lengths (9, metres) of some spans.

    Args:
        upper_body: ``(T, 10, 3)``, all recordings one after another.
        first_rows: First row of each recording.
        spans: What to average over; together they have a frame at least.
    """
    direction_sum, length_sum, count = np.zeros((9, 3)), np.zeros(9), 0
    parents = list(UPPER_BODY.parents[1:])
    upper_body = np.asarray(upper_body)  # slices of a memory map are slow to make
    for group in in_groups(spans, FRAMES_AT_ONCE):
        firsts = [int(first_rows[span.recording]) for span in group]
        rows = [slice(f + span.start, f + span.stop) for f, span in zip(firsts, group, strict=True)]
        positions = np.concatenate([upper_body[chosen] for chosen in rows], dtype="f8")
        bones = positions[:, 1:] - positions[:, parents]
        lengths = np.sqrt(np.einsum("tjc,tjc->tj", bones, bones))
        # As `cospeech.motion.codecs.direction_vectors`: a bone without length has no direction.
        direction_sum += np.einsum("tjc,tj->jc", bones, 1 / np.maximum(lengths, 1e-12))
        length_sum += lengths.sum(0)
        count += len(positions)
    return {
        "mean_direction": (direction_sum / count).reshape(27).tolist(),
        "bone_lengths": (length_sum / count).tolist(),
    }


def split_facts(
    splits: dict[str, list[Span]],
    speakers: Sequence[str],
    folder: Path,
    upper_body_rows: Sequence[int],
) -> dict[str, Any]:
    """The manifest's splits, training speakers and statistics of the training split.

    Args:
        splits: Spans of each split.
        speakers: Speaker of each recording.
        folder: Where the streams are.
        upper_body_rows: Frames of each recording's upper body, all 0 in a corpus without.

    Raises:
        CospeechError: Nothing trains.
    """
    train = {span.recording for span in splits["train"]}
    if not train:
        raise CospeechError("the training split is empty", "give the corpus more recordings")
    statistics: dict[str, list[float]] = {}
    if total := sum(upper_body_rows):
        stream = np.memmap(folder / "upper_body.bin", "<f4", mode="r", shape=(total, 10, 3))
        first_rows = np.cumsum([0, *upper_body_rows])
        statistics = upper_body_statistics(stream, first_rows, splits["train"])
    return {
        # In order of the recordings, as the published ids are (docs/facts/trimodal.md, section
        # 3.9).
        "speakers": list(dict.fromkeys(speakers[i] for i in sorted(train))),
        "splits": {
            name: [[span.recording, span.start, span.stop] for span in splits[name]]
            for name in SPLITS
        },
        "statistics": statistics,
    }


def split_anew(
    store: Store,
    path: Path,
    parameters: dict[str, Any],
    fingerprint: str,
    splits: dict[str, list[Span]],
) -> Store:
    """A store of the same recordings with other splits; the streams are shared, not copied.

    Args:
        store: The store there is.
        path: Folder of the new one.
        parameters: As for `StoreWriter`.
        fingerprint: As for `StoreWriter`.
        splits: Spans of each split.
    """
    building = path.with_name(f".{path.name}.splitting")
    shutil.rmtree(building, ignore_errors=True)
    building.mkdir()
    streams = [f"{stream}.bin" for stream in store.manifest["streams"]]
    for name in (*streams, "vocabulary.json", "annotations.jsonl"):
        try:
            os.link(store.path / name, building / name)
        except OSError:  # a file system without hard links
            shutil.copyfile(store.path / name, building / name)
    manifest = {
        **store.manifest,
        "parameters": parameters,
        "fingerprint": fingerprint,
        **split_facts(
            splits,
            store.recordings.columns["speaker"],
            store.path,
            store.manifest["rows"]["upper_body"],
        ),
    }
    write_manifest(building, manifest)
    building.rename(path)
    return Store(path)
