"""What methods must know of the training split's motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.corpus.splits import Span
from cospeech.motion.codecs import direction_vectors
from cospeech.motion.upper_body import UPPER_BODY


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
    for span in spans:
        first = first_rows[span.recording]
        positions = np.array(upper_body[first + span.start : first + span.stop], dtype=np.float64)
        direction_sum += direction_vectors(torch.from_numpy(positions)).sum(0).numpy()
        bones = positions[:, 1:] - positions[:, parents]
        length_sum += np.linalg.norm(bones, axis=-1).sum(0)
        count += len(positions)
    return {
        "mean_direction": (direction_sum / count).reshape(27).tolist(),
        "bone_lengths": (length_sum / count).tolist(),
    }
