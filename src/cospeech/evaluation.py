"""Judging methods on a store: the recordings protocol and the reference rows."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from pathlib import Path

import torch
from torch import Tensor

from cospeech.corpus.splits import Span
from cospeech.corpus.store import EVALUATION_FPS, Store
from cospeech.errors import CospeechError, InputFileError
from cospeech.foreign import read_json, understood
from cospeech.methods.base import GestureMethod
from cospeech.metrics import protocol
from cospeech.metrics.encoder import GestureEncoder
from cospeech.progress import progress_bar
from cospeech.reporting.record import write_json

logger = logging.getLogger(__name__)

References = dict[str, dict[str, float]]
"""Row name -> metric name -> value."""

FRAMES_AT_ONCE = 10_000
"""Training frames whose windows are in memory together, for the reference rows."""


def real_windows(store: Store, spans: list[Span]) -> tuple[Tensor, list[str]]:
    """The real motion of spans, cut on the fixed evaluation grid.

    Args:
        store: The corpus.
        spans: Which stretches.

    Returns:
        ``(n, 34, 10, 3)`` windows and, of each, the id of the recording that it is from; the
        speaker's name where each recording is a sample of one window.

    Raises:
        CospeechError: No span is as long as a window.
    """
    windows = [protocol.to_evaluation_windows(store.upper_body_motion(span)) for span in spans]
    # Recordings of a single window are samples cut from longer takes, neighbours overlapping: what
    # is independent is the speaker (of the TED samples, the video).
    columns = store.recordings.columns
    are_samples = all(len(cut) < 2 for cut in windows)
    names = columns["speaker" if are_samples and len(store.speaker_ids) > 1 else "id"]
    ids = [names[span.recording] for span, cut in zip(spans, windows, strict=True) for _ in cut]
    if not ids:
        raise _too_little(store, spans, 0)
    return torch.cat(windows), ids


def _judged_windows(store: Store, spans: list[Span]) -> tuple[Tensor, list[str]]:
    """As `real_windows`, of what is judged on: two or more, or there is no distribution.

    Raises:
        CospeechError: There are fewer.
    """
    windows, ids = real_windows(store, spans)
    if len(windows) < 2:
        raise _too_little(store, spans, len(windows))
    return windows, ids


def _too_little(store: Store, spans: list[Span], windows: int) -> CospeechError:
    lengths = [(span.stop - span.start) / EVALUATION_FPS for span in spans]
    longest = f", the longest of {max(lengths):.2f} s" if lengths else ""
    seconds = protocol.EVALUATION_FRAMES / EVALUATION_FPS
    return CospeechError(
        f"{store.name}: {len(spans)} recordings to judge on{longest}, hold {windows} evaluation"
        f" windows of {seconds:.2f} s, and judging takes two or more",
        "add recordings or longer ones; raise data.val_share and data.test_share; or, with a"
        " handful of long takes, data.split=time_blocks",
    )


def reference_rows(store: Store, encoder: GestureEncoder, split: str, seed: int) -> References:
    """The split's reference rows, computed once per store and encoder and kept under the store.

    Args:
        store: The corpus.
        encoder: The evaluation space.
        split: ``"val"`` or ``"test"``.
        seed: Of the rows' noise and mismatch.
    """
    name = f"{split}-{encoder.sha256[:12]}-s{seed}-v{protocol.PROTOCOL_VERSION}.json"
    path = store.path / "references" / name
    kept = read_rows(path)
    if kept is not None:
        return kept
    real, ids = _judged_windows(store, store.splits[split])
    train = (real_windows(store, spans)[0] for spans in _groups(_long_enough(store, "train")))
    rows = protocol.reference_rows(encoder, train, real, ids, seed)
    write_json(path, rows)
    return rows


def _long_enough(store: Store, split: str) -> list[Span]:
    return [
        span for span in store.splits[split] if span.stop - span.start >= protocol.EVALUATION_FRAMES
    ]


def _groups(spans: list[Span]) -> Iterator[list[Span]]:
    """Spans in groups of about `FRAMES_AT_ONCE`: to encode a short one by itself is slow."""
    group: list[Span] = []
    frames = 0
    for span in spans:
        group.append(span)
        frames += span.stop - span.start
        if frames >= FRAMES_AT_ONCE:
            yield group
            group, frames = [], 0
    if group:
        yield group


def read_rows(path: Path) -> References | None:
    """Reference rows that were kept; None, with a warning where the file is damaged, if none are.

    Args:
        path: What `reference_rows` wrote.
    """
    if not path.is_file():
        return None
    try:
        rows = read_json(path, "reference rows")
        with understood(path, "reference rows"):
            values = [value for row in rows.values() for value in row.values()]
        if not values or not all(type(v) in (float, int, type(None)) for v in values):
            raise InputFileError(path, "holds no rows of numbers")
    except InputFileError as error:
        logger.warning("%s: %s; the reference rows are computed again", path, error.problem)
        return None
    found: References = rows
    return found


def evaluate_recordings(
    method: GestureMethod,
    store: Store,
    split: str,
    encoder: GestureEncoder,
    limit: int | None = None,
) -> dict[str, float]:
    """The recordings protocol: generate over each whole recording, cut, compare.

    No seed motion is given: the motion comes from speech (and the speaker, where known) alone.
    Recording i is generated from seed i. Recordings without sound can't be generated for, and are
    left out with a warning.

    Args:
        method: A trained method.
        store: The corpus.
        split: The split to judge on.
        encoder: The evaluation space.
        limit: At most so many recordings (debug runs).

    Returns:
        The values of `protocol.paired_row`.

    Raises:
        CospeechError: No recording of the split has sound and the length of a window.
    """
    spans = _long_enough(store, split)
    if not spans:
        raise _too_little(store, store.splits[split], 0)
    spans = store.spans_with_sound(spans, f"{split} recordings")[:limit]
    real, ids = _judged_windows(store, spans)
    generated = []
    training = method.training
    method.eval()
    for number, span in enumerate(
        progress_bar(spans, len(spans), f"generating {split} recordings")
    ):
        speaker = store.recordings[span.recording].speaker
        motion = method.generate(
            store.speech(span),
            speaker=speaker if speaker in store.speaker_ids else None,
            generator=torch.Generator().manual_seed(number),
        )
        windows = protocol.to_evaluation_windows(motion)
        expected = len(protocol.to_evaluation_windows(store.upper_body_motion(span)))
        if len(windows) != expected:
            raise CospeechError(
                f"{type(method).__name__} made {motion.duration:.2f} s of motion for recording"
                f" {store.recordings[span.recording].id}: {len(windows)} windows, not {expected}"
            )
        generated.append(windows)
    method.train(training)
    return protocol.paired_row(encoder, torch.cat(generated), real, ids)
