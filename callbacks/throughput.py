"""How fast a run is."""

from __future__ import annotations

import time
from typing import Any

from lightning import Callback, LightningModule, Trainer

from cospeech.corpus.batch import GestureBatch


class Throughput(Callback):
    """Logs windows per second of each epoch's training steps; reading and validation left out."""

    def __init__(self) -> None:
        self._started = 0.0
        self._windows = 0
        self._seconds = 0.0

    def on_train_epoch_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Start the epoch's count."""
        self._windows, self._seconds = 0, 0.0

    def on_train_batch_start(
        self, trainer: Trainer, pl_module: LightningModule, batch: GestureBatch, batch_idx: int
    ) -> None:
        """Start the step's clock."""
        self._started = time.perf_counter()

    def on_train_batch_end(
        self,
        trainer: Trainer,
        pl_module: LightningModule,
        outputs: Any,
        batch: GestureBatch,
        batch_idx: int,
    ) -> None:
        """Stop the step's clock."""
        self._seconds += time.perf_counter() - self._started
        self._windows += len(batch)

    def on_train_epoch_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Log the rate."""
        if self._seconds:
            pl_module.log("train/windows_per_second", self._windows / self._seconds)
