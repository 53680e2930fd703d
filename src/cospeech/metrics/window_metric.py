"""What a metric of an evaluation is."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar, Literal

import torch
from torch import Tensor
from torchmetrics import Metric

from cospeech.metrics.evaluation_windows import EvaluationWindows
from cospeech.metrics.functional import SEED_FRAMES

Comparison = Literal["pairs", "sets", "nothing"]
"""What windows are compared with."""

VALUE = "value"
"""The name of a metric's value among several that it computes."""


class WindowMetric(Metric):
    """A torchmetric over windows of the evaluation space.

    Named in ``conf/metrics``, it stands in every epoch's values, in the rows of both protocols, in
    the reference rows, in the tables and in the record. ``higher_is_better`` makes the arrow of the
    table; None: neither is. ``compute`` gives a scalar, or several: ``"value"``, which has the
    metric's name, and ``PART``, which is called ``NAME_PART``.

    Attributes:
        title: Heading of its column.
        unit: Of its values; empty for a pure number.
        parts: Headings of the further values that have a column, by their parts.
        needs: Fields of the corpus that it reads of the windows besides motion
            (`cospeech.corpus.features`); the method needn't read them.
        compares: ``"pairs"``: generated window i with real window i, of the same speech;
            ``"sets"``: all generated with all real windows, as distributions; ``"nothing"``: the
            generated windows are looked at, with their speech. Decides in which reference rows a
            value means something.
        are_pairs: Whether window i of both sides is of the same speech. Set before the first
            `update` by whoever asks; only where it is may a metric of sets make use of it.
    """

    is_differentiable = False
    full_state_update = False

    title: ClassVar[str]
    unit: str = ""
    needs: ClassVar[frozenset[str]] = frozenset()
    parts: ClassVar[Mapping[str, str]] = MappingProxyType({})
    compares: ClassVar[Comparison] = "pairs"

    are_pairs: bool = True

    def update(self, generated: EvaluationWindows, real: EvaluationWindows) -> None:
        """Add windows of both sides.

        Args:
            generated: Those judged.
            real: What they are judged by.
        """
        raise NotImplementedError

    def compute(self) -> Tensor | dict[str, Tensor]:
        """The value of all windows, float64 scalars."""
        raise NotImplementedError

    def forward(self, *args: Any, **kwargs: Any) -> None:
        """`update` alone: a batch by itself has no value that could be logged."""
        self.update(*args, **kwargs)


class MeanOverWindows(WindowMetric):
    """The mean over all windows, float64; a subclass says what of."""

    total: Tensor
    count: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.add_state("total", torch.zeros((), dtype=torch.float64), dist_reduce_fx="sum")
        self.add_state("count", torch.zeros((), dtype=torch.float64), dist_reduce_fx="sum")

    def mean(self, generated: EvaluationWindows, real: EvaluationWindows) -> Tensor:
        """The mean over these windows, a scalar."""
        raise NotImplementedError

    @torch.no_grad()
    def update(self, generated: EvaluationWindows, real: EvaluationWindows) -> None:
        """Add windows, each of weight one."""
        self.total = self.total + self.mean(generated, real) * len(generated)
        self.count = self.count + len(generated)

    def compute(self) -> Tensor:
        """The mean, a float64 scalar."""
        return self.total / self.count


class PositionMetric(MeanOverWindows):
    """How far positions are from what was recorded; a subclass says how that is measured.

    Args:
        seed_frames: Leading frames that were given to the method and are left out.
    """

    unit = "m"
    higher_is_better = False
    plot_lower_bound = 0.0

    def __init__(self, seed_frames: int = SEED_FRAMES) -> None:
        super().__init__()
        self.seed_frames = seed_frames
