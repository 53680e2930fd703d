"""Stops a run whose loss is no longer a number."""

from __future__ import annotations

import math
from typing import Any

from lightning import Callback, LightningModule, Trainer

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.window_loader import WindowLoader
from cospeech.errors import CospeechError
from cospeech.experiment import RunContext
from cospeech.reporting.record import write_json


class StopOnNaN(Callback):
    """Stops at the first step with a NaN or infinite loss and writes down which windows it held.

    The file ``nan_batch.json`` in the run's folder names the step, the losses and each window's
    recording and start, so that the data can be looked at. The last checkpoint stays as it was.

    Args:
        run: The run's context.
    """

    def __init__(self, run: RunContext) -> None:
        self.run = run

    def on_train_batch_end(
        self,
        trainer: Trainer,
        pl_module: LightningModule,
        outputs: Any,
        batch: GestureBatch,
        batch_idx: int,
    ) -> None:
        """Check every loss that the step gives back.

        Raises:
            CospeechError: A loss is not finite.
        """
        losses = {name: float(value) for name, value in (outputs or {}).items()}
        bad = sorted(name for name, value in losses.items() if not math.isfinite(value))
        if not bad:
            return
        loader = trainer.train_dataloader
        assert isinstance(loader, WindowLoader)
        path = self.run.folder / "nan_batch.json"
        write_json(
            path,
            {
                "epoch": trainer.current_epoch,
                "batch": batch_idx,
                "losses": {name: repr(value) for name, value in losses.items()},
                "windows": [loader.dataset.describe(int(i)) for i in batch.window_ids],
            },
        )
        raise CospeechError(
            f"{', '.join(bad)} became NaN or infinite at epoch {trainer.current_epoch},"
            f" batch {batch_idx}",
            f"the batch's windows are listed in {path}: look at those recordings, or start a new"
            " run with a lower model.learning_rate",
        )
