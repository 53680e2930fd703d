"""How strongly motion is moved, beside how strongly recorded motion is."""

from __future__ import annotations

from typing import ClassVar, Literal, get_args

import torch
from torch import Tensor

from cospeech.metrics.evaluation_windows import EvaluationWindows
from cospeech.metrics.movement import derivative_sizes
from cospeech.metrics.window_metric import Comparison, MeanOverWindows
from cospeech.motion.upper_body import EVALUATION_FPS, MOVING_JOINTS

UnitOfTime = Literal["second", "frame"]
"""What a derivative is by."""


class _MeanDerivative(MeanOverWindows):
    """Mean size of a derivative of position, over time and the nine joints that can move.

    `cospeech.metrics.movement.derivative_sizes`. Neither more nor less is better: recorded motion's
    own value stands in the rows real train and mismatched.

    Args:
        per: Unit of time: ``"second"``, or ``"frame"`` of the evaluation's 15 a second, without a
            factor for the rate, as Kucherenko et al. 2020 printed theirs.

    Raises:
        ValueError: ``per`` is neither.
    """

    compares: ClassVar[Comparison] = "nothing"
    higher_is_better = None
    plot_lower_bound = 0.0

    order: ClassVar[int]
    power: ClassVar[str]

    def __init__(self, per: UnitOfTime = "second") -> None:
        super().__init__()
        if per not in get_args(UnitOfTime):
            raise ValueError(f"per={per!r} is neither second nor frame")
        self.per = per
        self.unit = f"m/{'s' if per == 'second' else 'frame'}{self.power}"

    def mean(self, generated: EvaluationWindows, real: EvaluationWindows) -> Tensor:
        """The mean size in these windows."""
        positions = generated.positions[:, :, list(MOVING_JOINTS)].cpu().numpy()
        fps = EVALUATION_FPS if self.per == "second" else 1.0
        return torch.tensor(derivative_sizes(positions, self.order, fps).mean())


class Speed(_MeanDerivative):
    """Mean speed of the joints."""

    title, order, power = "speed", 1, ""


class Acceleration(_MeanDerivative):
    """Mean acceleration of the joints."""

    title, order, power = "acceleration", 2, "²"


class Jerk(_MeanDerivative):
    """Mean jerk of the joints."""

    title, order, power = "jerk", 3, "³"
