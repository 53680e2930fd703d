"""How a run shows its progress: a bar on a terminal, a line per epoch in a log file."""

from __future__ import annotations

import sys
import time

from lightning import LightningModule, Trainer
from lightning.pytorch.callbacks import ProgressBar, RichProgressBar


def progress() -> ProgressBar:
    """What suits the output: `Bar` on a terminal, else `EpochLines`."""
    return Bar() if sys.stdout.isatty() else EpochLines()


class Bar(RichProgressBar):
    """Lightning's rich bar without the logger's version, which says nothing here."""

    def get_metrics(
        self, trainer: Trainer, pl_module: LightningModule
    ) -> dict[str, int | str | float | dict[str, float]]:
        """The logged values chosen for the bar."""
        metrics = super().get_metrics(trainer, pl_module)
        metrics.pop("v_num", None)
        return metrics


class EpochLines(ProgressBar):
    """One line per epoch: number, seconds, and the values chosen for the bar."""

    def __init__(self) -> None:
        super().__init__()
        self._started = 0.0
        self._enabled = True

    def disable(self) -> None:
        """Lightning's way to silence all but the first process."""
        self._enabled = False

    def enable(self) -> None:
        """Undo `disable`."""
        self._enabled = True

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Start a clock for an epoch that is entered in its middle."""
        super().on_train_start(trainer, pl_module)
        self._started = time.perf_counter()

    def on_train_epoch_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Start the epoch's clock."""
        self._started = time.perf_counter()

    def on_train_epoch_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Print the line."""
        if self._enabled:
            seconds = time.perf_counter() - self._started
            values = self.get_metrics(trainer, pl_module)
            shown = "  ".join(
                f"{name} {value:.4g}" for name, value in values.items() if isinstance(value, float)
            )
            epochs = trainer.max_epochs
            last = "" if epochs is None or epochs < 0 else f"/{epochs - 1}"
            print(f"epoch {trainer.current_epoch}{last}  {seconds:.0f} s  {shown}", flush=True)
