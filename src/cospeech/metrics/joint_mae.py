"""Joint position error."""

from __future__ import annotations

from torch import Tensor

from cospeech.metrics.evaluation_windows import EvaluationWindows
from cospeech.metrics.functional import joint_mae
from cospeech.metrics.window_metric import PositionMetric


class JointMAE(PositionMetric):
    """Mean absolute error per joint coordinate, metres (docs/facts/trimodal.md, section 4.3)."""

    title = "joint error"

    def mean(self, generated: EvaluationWindows, real: EvaluationWindows) -> Tensor:
        """As `joint_mae`."""
        return joint_mae(generated.positions, real.positions, self.seed_frames)
