"""Keeps `record.json` up to date while a run is under way."""

from __future__ import annotations

from lightning import Callback, LightningModule, Trainer

from cospeech.experiment import RunContext


class WriteRunRecord(Callback):
    """Writes each epoch's metrics into the record as soon as they are known.

    Args:
        run: The run's context.
    """

    def __init__(self, run: RunContext) -> None:
        self.run = run

    def on_train_epoch_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Add the epoch's row; epochs count from 0."""
        if trainer.is_global_zero:
            metrics = {
                name: float(value)
                for name, value in trainer.callback_metrics.items()
                if name.startswith(("train/", "val/")) and not name.endswith("_step")
            }
            self.run.record.add_epoch(trainer.current_epoch, metrics)

    def on_train_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Note the epochs that were asked for and those it took; a resumed run adds none."""
        if trainer.is_global_zero:
            asked = self.run.record.values["config"]["training"]["epochs"]
            self.run.record.update(fit={"asked": asked, "ended": trainer.current_epoch})
