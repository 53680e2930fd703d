"""The losses of one step, each with its weight."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor


class WeighedLosses:
    """Losses that are added up as they are evaluated; one of weight 0 is logged and not felt.

    Attributes:
        values: Name -> loss, without its weight.
        total: Sum of the losses times their weights, in the order of adding; None where none has a
            weight.
    """

    def __init__(self) -> None:
        self.values: dict[str, Tensor] = {}
        self.total: Tensor | None = None

    def add(self, name: str, weight: float, loss: Callable[..., Tensor], *inputs: Any) -> None:
        """Evaluate a loss, without gradient where its weight is 0.

        Args:
            name: Under which it is logged.
            weight: Its factor in the total, at least 0.
            loss: Gives the scalar.
            inputs: Of ``loss``.
        """
        is_felt = weight > 0
        with torch.set_grad_enabled(is_felt):
            value = self.values[name] = loss(*inputs)
        if is_felt:
            weighed = weight * value
            self.total = weighed if self.total is None else self.total + weighed
