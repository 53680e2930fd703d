"""Acceleration error."""

from __future__ import annotations

from torch import Tensor

from cospeech.metrics.evaluation_windows import EvaluationWindows
from cospeech.metrics.functional import acceleration_error
from cospeech.metrics.window_metric import MeanOverWindows


class AccelerationError(MeanOverWindows):
    """Mean absolute difference of second frame differences (docs/facts/trimodal.md, section 4.3).

    In metres per squared frame, as published: compare it at one frame rate only.
    """

    title, unit = "accel. error", "m/frame²"
    higher_is_better = False
    plot_lower_bound = 0.0

    def mean(self, generated: EvaluationWindows, real: EvaluationWindows) -> Tensor:
        """As `acceleration_error`."""
        return acceleration_error(generated.positions, real.positions)
