"""How far a row's numbers can be trusted: intervals over recordings."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

from torch import Tensor

from cospeech.metrics.moments import recording_moments
from cospeech.metrics.uncertainty import fgd_interval

INTERVAL_OF = "fgd"
"""The metric that has an interval over recordings."""

EXTRAPOLATED = {"key": "fgd_extrapolated", "title": "FGD at n → ∞", "better": "lower"}
"""The column that the interval adds to a table."""


def interval_of(
    generated: Tensor, real: Tensor, recording_ids: Sequence[Hashable], seed: int
) -> dict[str, float]:
    """The interval of an FGD, over recordings.

    Args:
        generated: ``(n, 32)`` features of the windows judged.
        real: ``(n, 32)``, of the real windows of the same speech.
        recording_ids: The recording of each.
        seed: Of the draws.

    Returns:
        ``fgd_low``, ``fgd_high`` (95 %), ``fgd_extrapolated`` and ``recordings``; nothing where
        there are fewer than two recordings.
    """
    if len(set(recording_ids)) < 2:
        return {}
    interval = fgd_interval(
        recording_moments(real, recording_ids),
        recording_moments(generated, recording_ids),
        seed=seed,
    )
    return {
        "fgd_low": interval.low,
        "fgd_high": interval.high,
        "fgd_extrapolated": interval.extrapolated,
        "recordings": float(interval.recordings),
    }
