"""The stages of the training, and how far it has come. Pure values.

A run goes through the stages in order. Where it stands is a `Progress`, which a checkpoint holds as
plain values; what a step does depends on nothing else.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any, Literal, get_args

import numpy as np

Stage = Literal[
    "classifier", "pretraining", "phase_curriculum", "motion_pretraining", "adversarial", "finished"
]

STAGES: tuple[Stage, ...] = get_args(Stage)
"""In their order; the number of a stage in logs counts from 1."""

TRAINED_BEFORE: tuple[Stage, ...] = STAGES[:4]
"""Stages that end with a product."""


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

    def is_complete(self, rules: CurriculumRules) -> bool:
        """Whether the last level, the fully pre-trained generator, is done too."""
        return self.level >= rules.levels


@dataclass(frozen=True)
class Schedule:
    """The stages of one training.

    Attributes:
        lengths: Stage -> steps, in order; None for the curriculum, which ends by its rules.
        curriculum: Its rules.
    """

    lengths: dict[Stage, int | None]
    curriculum: CurriculumRules

    def first(self, done: frozenset[Stage] = frozenset()) -> Stage:
        """The first stage that isn't done."""
        return next((stage for stage in self.lengths if stage not in done), "finished")

    def next_after(self, stage: Stage, done: frozenset[Stage] = frozenset()) -> Stage:
        """The next stage that isn't done."""
        later = [other for other in self.lengths if STAGES.index(other) > STAGES.index(stage)]
        return next((other for other in later if other not in done), "finished")


@dataclass(frozen=True)
class Progress:
    """Where a training stands.

    Attributes:
        stage: The stage that the next step belongs to.
        step: Steps done in it.
        curriculum: Of the phase discriminator.
    """

    stage: Stage
    step: int = 0
    curriculum: Curriculum = Curriculum()

    @property
    def number(self) -> int:
        """The stage's number, from 1."""
        return STAGES.index(self.stage) + 1

    def after_step(self, schedule: Schedule, accuracy: float | None = None) -> Progress:
        """The progress after one more step of the same stage.

        Args:
            schedule: The stages.
            accuracy: The phase discriminator's in this step of the curriculum.
        """
        curriculum = self.curriculum
        if accuracy is not None:
            curriculum = curriculum.after(accuracy, schedule.curriculum)
        return replace(self, step=self.step + 1, curriculum=curriculum)

    def stage_is_complete(self, schedule: Schedule) -> bool:
        """Whether the stage has nothing left to do."""
        length = schedule.lengths[self.stage]
        if length is None:
            return self.curriculum.is_complete(schedule.curriculum)
        return self.step >= length

    def least_steps_left(self, schedule: Schedule, done: frozenset[Stage]) -> int:
        """Steps to the end of the last stage; of the curriculum, as if every batch were good.

        Args:
            schedule: The stages.
            done: Those that products have taken the place of.
        """
        rules, left = schedule.curriculum, 0
        for stage, length in schedule.lengths.items():
            if stage in done or STAGES.index(stage) < STAGES.index(self.stage):
                continue
            if length is None:
                level, streak = self.curriculum.level, self.curriculum.streak
                left += (rules.levels - level) * rules.streak - streak
            else:
                left += length - (self.step if stage == self.stage else 0)
        return left

    def to_dict(self) -> dict[str, Any]:
        """Plain values; `from_dict` reads them back."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Progress:
        """What `to_dict` wrote."""
        curriculum = values["curriculum"]
        lists = {key: tuple(curriculum[key]) for key in ("spent", "capped")}
        return cls(values["stage"], values["step"], Curriculum(**{**curriculum, **lists}))


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
