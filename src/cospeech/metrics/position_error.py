"""Distances of joints from where they were recorded."""

from __future__ import annotations

from torch import Tensor

from cospeech.metrics.evaluation_windows import EvaluationWindows
from cospeech.metrics.functional import position_error, root_mean_square_error
from cospeech.metrics.window_metric import PositionMetric
from cospeech.motion.upper_body import MOVING_JOINTS


class AveragePositionError(PositionMetric):
    """Mean distance of the nine joints that can move from where they were recorded (APE)."""

    title = "position error"

    def mean(self, generated: EvaluationWindows, real: EvaluationWindows) -> Tensor:
        """As `position_error`."""
        return position_error(_moving(generated), _moving(real), self.seed_frames).mean()


class RootMeanSquareError(PositionMetric):
    """Mean over windows of the root of the mean squared distance of the same joints (RMSE)."""

    title = "RMSE"

    def mean(self, generated: EvaluationWindows, real: EvaluationWindows) -> Tensor:
        """As `root_mean_square_error`."""
        return root_mean_square_error(_moving(generated), _moving(real), self.seed_frames).mean()


def _moving(windows: EvaluationWindows) -> Tensor:
    return windows.positions[:, :, list(MOVING_JOINTS)]
