"""The phase discriminator's way through the generator's history (section 6.1). Pure values."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np


@dataclass(frozen=True)
class CurriculumRules:
    """When the phase discriminator has had enough of a level (section 6.1).

    Attributes:
        levels: Snapshots of the pre-trained generator, the untrained one first.
        accuracy: A batch with at least this accuracy counts.
        streak: So many of them in a row end a level.
        most_batches: So many batches end it anyway, or a late level could last for ever.
    """

    levels: int
    accuracy: float
    streak: int
    most_batches: int


@dataclass(frozen=True)
class Curriculum:
    """How far the phase discriminator has come through the generator's history.

    Attributes:
        level: Snapshot that it plays against.
        streak: Good batches in a row.
        batches: Batches of this level.
        spent: Batches that each level before took.
        capped: Levels that ended by the limit.
    """

    level: int = 0
    streak: int = 0
    batches: int = 0
    spent: tuple[int, ...] = ()
    capped: tuple[int, ...] = ()

    def after(self, accuracy: float, rules: CurriculumRules) -> Curriculum:
        """The state after a batch of this accuracy."""
        batches = self.batches + 1
        streak = self.streak + 1 if accuracy >= rules.accuracy else 0
        if streak < rules.streak and batches < rules.most_batches:
            return replace(self, streak=streak, batches=batches)
        capped = self.capped if streak >= rules.streak else (*self.capped, self.level)
        return Curriculum(self.level + 1, 0, 0, (*self.spent, batches), capped)

    def least_steps_left(self, rules: CurriculumRules) -> int:
        """Batches to the end of the last level, if every one were good."""
        return (rules.levels - self.level) * rules.streak - self.streak

    def to_dict(self) -> dict[str, Any]:
        """Plain values; `from_dict` reads them back."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Curriculum:
        """What `to_dict` wrote."""
        lists = {key: tuple(values[key]) for key in ("spent", "capped")}
        return cls(**{**values, **lists})


def snapshot_steps(steps: int, count: int) -> tuple[int, ...]:
    """When the pre-training keeps its weights: at the start, then ever more rarely, and at the end.

    Args:
        steps: Length of the pre-training.
        count: Snapshots wanted, at least two; a short pre-training has fewer.

    Returns:
        Ascending numbers of finished steps from 0 to ``steps``, the others spaced evenly in their
        logarithm.
    """
    spaced = np.geomspace(steps, 1, count - 1).round().astype(int)
    return (0, *sorted(set(spaced.tolist())))
