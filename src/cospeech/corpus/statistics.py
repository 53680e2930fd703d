"""What methods must know of the training split's motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.splits import Span
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
    for rows in _row_groups(first_rows, spans):
        positions = np.concatenate([upper_body[start:stop] for start, stop in rows], dtype="f8")
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


def _row_groups(
    first_rows: NDArray[np.int64], spans: Sequence[Span]
) -> Iterator[list[tuple[int, int]]]:
    """First row and row after the last of each span, in groups of about `FRAMES_AT_ONCE` rows."""
    group: list[tuple[int, int]] = []
    frames = 0
    for span in spans:
        first = int(first_rows[span.recording])
        group.append((first + span.start, first + span.stop))
        frames += span.stop - span.start
        if frames >= FRAMES_AT_ONCE:
            yield group
            group, frames = [], 0
    if group:
        yield group
