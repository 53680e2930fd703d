"""The recorded motion of a corpus on the fixed grid of the evaluation, with what was said."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from cospeech.corpus.features import fields_of
from cospeech.corpus.features.field import FrameField
from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.corpus.tracks import Tracks
from cospeech.corpus.windows import WindowDataset, WindowSpec, spans_having
from cospeech.errors import CospeechError
from cospeech.metrics.encoder import GestureEncoder
from cospeech.metrics.evaluation_windows import EvaluationWindows, to_evaluation_windows
from cospeech.motion.upper_body import EVALUATION_FPS, EVALUATION_FRAMES, EVALUATION_STRIDE

WINDOW = WindowSpec(EVALUATION_FPS, EVALUATION_FRAMES, 0, EVALUATION_STRIDE)
"""The windows of the evaluation, as a method would ask for them."""


def real_windows(store: Store, spans: Sequence[Span]) -> tuple[Tensor, list[str]]:
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
    windows = [to_evaluation_windows(store.upper_body_motion(span)) for span in spans]
    # Recordings of a single window are samples cut from longer takes, neighbours overlapping: what
    # is independent is the speaker (of the TED samples, the video).
    columns = store.recordings.columns
    are_samples = all(len(cut) < 2 for cut in windows)
    names = columns["speaker" if are_samples and len(store.speaker_ids) > 1 else "id"]
    ids = [names[span.recording] for span, cut in zip(spans, windows, strict=True) for _ in cut]
    if not ids:
        raise too_little(store, spans, 0)
    return torch.cat(windows), ids


def judged_windows(
    store: Store, split: str, spans: Sequence[Span], encoder: GestureEncoder, needs: frozenset[str]
) -> tuple[EvaluationWindows, list[str]]:
    """As `real_windows`, of what is judged on: two or more, or there is no distribution.

    Args:
        store: The corpus.
        split: The split that the spans are of.
        spans: Which stretches.
        encoder: The evaluation space.
        needs: Fields of the corpus that the metrics read.

    Raises:
        CospeechError: There are fewer.
    """
    positions, ids = real_windows(store, spans)
    if len(positions) < 2:
        raise too_little(store, spans, len(positions))
    return encoded_windows(store, split, spans, positions, encoder, needs), ids


def encoded_windows(
    store: Store,
    split: str,
    spans: Sequence[Span],
    positions: Tensor,
    encoder: GestureEncoder,
    needs: frozenset[str],
) -> EvaluationWindows:
    """The windows of spans with their features and the fields that metrics read.

    Args:
        store: The corpus.
        split: The split that the spans are of.
        spans: Those that the positions are of.
        positions: Of `real_windows`.
        encoder: The evaluation space.
        needs: Fields of the corpus.
    """
    features = encoder.encode_all(positions)
    if not needs:
        return EvaluationWindows(positions, features)
    places = [
        (sequence, first)
        for sequence, span in enumerate(spans)
        for first in range(0, span.stop - span.start - EVALUATION_FRAMES + 1, EVALUATION_STRIDE)
    ]
    served = evaluation_windows(store, split, spans, np.array(places), needs)
    return EvaluationWindows(positions, features, served.batch(range(len(served))).fields)


def evaluation_windows(
    store: Store,
    split: str,
    spans: Sequence[Span],
    places: NDArray[np.int64],
    needs: frozenset[str],
) -> WindowDataset:
    """Windows of the evaluation at any places, with the fields that metrics read.

    Args:
        store: The corpus.
        split: The split that the spans are of.
        spans: Which stretches.
        places: ``(n, 2)`` span and first frame in it, at the evaluation rate, of each window.
        needs: Fields of the corpus.
    """
    of_frames = [field for field in fields_of(needs) if isinstance(field, FrameField)]
    tracks = Tracks(store, list(spans), EVALUATION_FPS, of_frames, False, f"{split} windows")
    return WindowDataset(store, split, WINDOW, needs, tracks, places)


def with_fields(
    store: Store, split: str, spans: Sequence[Span], needs: frozenset[str]
) -> list[Span]:
    """The stretches of recordings that have what the metrics read.

    Raises:
        ConfigError: There are stretches, and none has it.
    """
    return spans_having(store, split, spans, {field.reads for field in fields_of(needs)})


def long_enough(store: Store, split: str) -> list[Span]:
    """The stretches of a split that hold a window."""
    return [span for span in store.splits[split] if span.stop - span.start >= EVALUATION_FRAMES]


def too_little(store: Store, spans: Sequence[Span], windows: int) -> CospeechError:
    """What to say of spans that hold too few windows to judge on."""
    lengths = [(span.stop - span.start) / EVALUATION_FPS for span in spans]
    longest = f", the longest of {max(lengths):.2f} s" if lengths else ""
    seconds = EVALUATION_FRAMES / EVALUATION_FPS
    return CospeechError(
        f"{store.name}: {len(spans)} recordings to judge on{longest}, hold {windows} evaluation"
        f" windows of {seconds:.2f} s, and judging takes two or more",
        "add recordings or longer ones; raise data.val_share and data.test_share; or, with a"
        " handful of long takes, data.split=time_blocks",
    )
