"""Ctrl-C, or a system that ends the process, gets its way after the step, with all saved."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
from types import FrameType
from typing import Any

from lightning import Callback, LightningModule, Trainer

from cospeech.experiment import RunContext, RunInterrupted
from cospeech.experiment.stopping import STOP_SIGNALS


class GracefulInterrupt(Callback):
    """On Ctrl-C, SIGTERM or SIGHUP: finish the step (or the validation), save ``last.ckpt``, stop.

    A second Ctrl-C stops at once; the run then continues from the checkpoint before.

    Args:
        run: The run's context.
    """

    def __init__(self, run: RunContext) -> None:
        self.run = run
        self._asked = False
        self._previous: dict[int, Any] = {}

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Take over the signals (Python allows that in the main thread only)."""
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, *STOP_SIGNALS):
                if signal.getsignal(number) is not signal.SIG_IGN:
                    self._previous[number] = signal.signal(number, self._ask)

    def _ask(self, number: int, frame: FrameType | None) -> None:
        if self._asked:
            raise KeyboardInterrupt
        self._asked = True
        with contextlib.suppress(OSError):  # the terminal may be what has gone
            sys.stderr.write("\nfinishing this step, then saving (Ctrl-C again: stop at once)\n")

    def on_train_batch_end(
        self,
        trainer: Trainer,
        pl_module: LightningModule,
        outputs: Any,
        batch: Any,
        batch_idx: int,
    ) -> None:
        """Save and stop, unless this was the epoch's last batch: then the epoch is ended first."""
        if self._agreed(trainer) and not trainer.is_last_batch:
            path = self.run.folder / "checkpoints" / "last.ckpt"
            trainer.save_checkpoint(path, weights_only=False)
            self._stop()

    def on_train_epoch_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Stop between epochs, after the checkpoint of the one that ended."""
        if self._agreed(trainer):
            self._stop()

    def on_train_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Stop before the final evaluation if asked during the last epoch."""
        if self._agreed(trainer):
            self._stop()

    def teardown(self, trainer: Trainer, pl_module: LightningModule, stage: str) -> None:
        """Give the signals back."""
        for number, handler in self._previous.items():
            signal.signal(number, handler)
        self._previous.clear()

    def on_exception(
        self, trainer: Trainer, pl_module: LightningModule, exception: BaseException
    ) -> None:
        """Give the signals back."""
        self.teardown(trainer, pl_module, "fit")

    def _agreed(self, trainer: Trainer) -> bool:
        """Whether any process was asked: the signal may reach them in different steps."""
        return trainer.strategy.reduce_boolean_decision(self._asked, all=False)

    def _stop(self) -> None:
        raise RunInterrupted(
            f"stopped; {self.run.folder / 'checkpoints' / 'last.ckpt'} is saved",
            f"continue with: {self.run.resume_command}",
        )
