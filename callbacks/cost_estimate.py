"""Says at the start what a run will cost."""

from __future__ import annotations

import time
from typing import Any

from lightning import Callback, LightningModule, Trainer

from cospeech.experiment import RunContext
from cospeech.methods.capabilities import HasSchedule

WARM_UP_STEPS = 1
MEASURED_STEPS = 3


class CostEstimate(Callback):
    """Prints steps, measured seconds per step and the estimate, and names the quick variant.

    The first step is left out of the measurement (allocation, first-call costs). When the time per
    step of an epoch is more than a quarter off the last estimate (an adversary has started, say),
    the estimate is printed again.

    Args:
        run: The run's context.
        quick: What to add to the command line for the model's quick variant, or None.
    """

    def __init__(self, run: RunContext, quick: str | None) -> None:
        self.quick = quick
        self._seen = 0
        self._started = 0.0
        self._epoch_started = 0.0
        self._epoch_steps = 0
        self._announced: float | None = None

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """The number of steps. Starts a clock for an epoch entered in its middle, too."""
        self._epoch_started = time.perf_counter()
        if trainer.is_global_zero and trainer.max_epochs is not None:
            steps = int(trainer.num_training_batches)
            left = trainer.max_epochs - trainer.current_epoch
            total = _steps_left(trainer, pl_module)
            epochs = f"{left} epochs x {steps} steps ="
            if trainer.max_epochs < 0:
                epochs = f"epochs of {steps} steps, about"
            elif total < left * steps:
                epochs = f"at most {left} epochs of {steps} steps, about"
            parameters = sum(p.numel() for p in pl_module.parameters() if p.requires_grad)
            print(
                f"training {type(pl_module).__name__}: {parameters / 1e6:.2f} M parameters,"
                f" {epochs} {total:,} steps",
                flush=True,
            )

    def on_train_epoch_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Start the epoch's clock."""
        self._epoch_started, self._epoch_steps = time.perf_counter(), 0

    def on_train_batch_end(
        self,
        trainer: Trainer,
        pl_module: LightningModule,
        outputs: Any,
        batch: Any,
        batch_idx: int,
    ) -> None:
        """Measure the first steps."""
        self._seen += 1
        self._epoch_steps += 1
        if self._seen == WARM_UP_STEPS:
            self._started = time.perf_counter()
        elif self._seen == WARM_UP_STEPS + MEASURED_STEPS:
            seconds = (time.perf_counter() - self._started) / MEASURED_STEPS
            self._announce(trainer, pl_module, seconds, batch_idx + 1)
            if self.quick and trainer.is_global_zero:
                print(f"for a quick look add {self.quick}", flush=True)

    def on_validation_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Correct the estimate where an epoch was much slower or faster."""
        if self._announced is None or self._epoch_steps == 0:
            return
        seconds = (time.perf_counter() - self._epoch_started) / self._epoch_steps
        if not 0.8 < seconds / self._announced < 1.25:
            self._announce(trainer, pl_module, seconds, self._epoch_steps)

    def _announce(
        self, trainer: Trainer, pl_module: LightningModule, seconds: float, done_in_epoch: int
    ) -> None:
        self._announced = seconds
        if trainer.max_epochs is None or not trainer.is_global_zero:
            return
        total = _steps_left(trainer, pl_module, done_in_epoch) * seconds
        print(
            f"\nmeasured {seconds:.2f} s per step: about {_duration(total)} of training left",
            flush=True,
        )


def _steps_left(trainer: Trainer, pl_module: LightningModule, done_in_epoch: int = 0) -> int:
    """By the epochs that are left, or by the method where it knows that it needs fewer."""
    assert trainer.max_epochs is not None
    by_schedule = pl_module.steps_left if isinstance(pl_module, HasSchedule) else None
    if trainer.max_epochs < 0:
        return by_schedule or 0
    batches = int(trainer.num_training_batches)
    by_epochs = (trainer.max_epochs - trainer.current_epoch) * batches - done_in_epoch
    return by_epochs if by_schedule is None else min(by_epochs, by_schedule)


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    if seconds < 5400:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"
