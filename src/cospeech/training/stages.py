"""The stages of a training, and how far it has come. Pure values.

A run goes through the stages in order. Where it stands is a `Progress`, which a checkpoint holds as
plain values.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

FINISHED = "finished"
"""What comes after the last stage."""


@dataclass(frozen=True)
class Progress:
    """Where a training stands.

    Attributes:
        stage: The stage that the next step belongs to.
        step: Steps done in it.
    """

    stage: str
    step: int = 0

    def after_step(self) -> Progress:
        """The progress after one more step of the same stage."""
        return replace(self, step=self.step + 1)


@dataclass(frozen=True)
class Schedule:
    """The stages of one training.

    Attributes:
        names: All that the method has, in their order.
        lengths: Stage -> steps, of those that the training goes through; None for a stage that
            ends by a rule of its own.
    """

    names: tuple[str, ...]
    lengths: dict[str, int | None]

    def number(self, stage: str) -> int:
        """The stage's number, from 1; those that are left out count."""
        return (*self.names, FINISHED).index(stage) + 1

    def first(self, done: Collection[str] = ()) -> str:
        """The first stage that isn't done."""
        left = (name for name in self.names if name in self.lengths and name not in done)
        return next(left, FINISHED)

    def next_after(self, stage: str, done: Collection[str] = ()) -> str:
        """The next stage that isn't done."""
        return self.first({*done, *self.names[: self.number(stage)]})

    def steps_left(
        self, progress: Progress, done: Collection[str], open_ended: Mapping[str, int]
    ) -> int:
        """Steps to the end of the last stage.

        Args:
            progress: Where the training stands.
            done: Stages that products have taken the place of.
            open_ended: Steps that stages without a length need at least.
        """
        before = self.names[: self.number(progress.stage) - 1]
        left = 0
        for stage, length in self.lengths.items():
            if stage in done or stage in before:
                continue
            if length is None:
                left += open_ended[stage]
            else:
                left += length - (progress.step if stage == progress.stage else 0)
        return left
