"""Joint position error."""

from __future__ import annotations

from torch import Tensor

from cospeech.metrics.evaluation_windows import EvaluationWindows
from cospeech.metrics.functional import SEED_FRAMES, joint_mae
from cospeech.metrics.window_metric import MeanOverWindows


class JointMAE(MeanOverWindows):
    """Mean absolute error per joint coordinate, metres (docs/facts/trimodal.md, section 4.3).

    Args:
        seed_frames: Leading frames that were given to the method and are left out.
    """

    title, unit = "joint error", "m"
    higher_is_better = False
    plot_lower_bound = 0.0

    def __init__(self, seed_frames: int = SEED_FRAMES) -> None:
        super().__init__()
        self.seed_frames = seed_frames

    def mean(self, generated: EvaluationWindows, real: EvaluationWindows) -> Tensor:
        """As `joint_mae`."""
        return joint_mae(generated.positions, real.positions, self.seed_frames)
