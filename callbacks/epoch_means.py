"""The mean of an epoch stays that of all of its steps, wherever the run is stopped within it."""

from __future__ import annotations

from typing import Any

import torch
from lightning import Callback, LightningModule, Trainer
from torch import Tensor, distributed


class KeepEpochMeans(Callback):
    """Keeps in checkpoints what ``train/...`` has summed up in the epoch so far.

    Lightning's checkpoints hold where an epoch was left, not what was logged in it: a resumed run
    would log the mean of the steps that were left. To the bit, as long as as many processes go on.
    Comes before the callbacks that save within an epoch.
    """

    def __init__(self) -> None:
        self._left = dict[str, dict[str, Tensor]]()

    def on_save_checkpoint(
        self, trainer: Trainer, pl_module: LightningModule, checkpoint: dict[str, Any]
    ) -> None:
        """Add the sums of every process."""
        sums: list[Any] = [self._left | _sums(trainer)]
        if distributed.is_available() and distributed.is_initialized():
            sums = [None] * distributed.get_world_size()
            distributed.all_gather_object(sums, self._left | _sums(trainer))
        checkpoint[type(self).__name__] = sums

    def on_load_checkpoint(
        self, trainer: Trainer, pl_module: LightningModule, checkpoint: dict[str, Any]
    ) -> None:
        """Hold the sums of this process until their names are logged again."""
        sums = checkpoint.get(type(self).__name__)
        self._left = {}
        if isinstance(sums, list) and len(sums) == trainer.world_size:
            self._left = sums[trainer.global_rank]

    def on_train_batch_start(
        self, trainer: Trainer, pl_module: LightningModule, batch: Any, batch_idx: int
    ) -> None:
        """Forget the sums of an epoch that had ended."""
        if batch_idx == 0:
            self._left = {}

    def on_train_batch_end(
        self,
        trainer: Trainer,
        pl_module: LightningModule,
        outputs: Any,
        batch: Any,
        batch_idx: int,
    ) -> None:
        """Add the sums to those of the first step that logs the same."""
        for name, result in _results(trainer).items() if self._left else ():
            before = self._left.pop(name, {})
            for part, earlier in before.items():
                now = getattr(result, part)
                extreme = {torch.max: torch.maximum, torch.min: torch.minimum}
                joined = extreme.get(result.meta.reduce_fx, torch.add)
                setattr(result, part, joined(earlier.to(now.device), now))


def _results(trainer: Trainer) -> dict[str, Any]:
    """What was logged in this epoch for its end; Lightning gives no other way to it."""
    return {
        name: result
        for name, result in trainer.fit_loop.epoch_loop._results.items()
        if result.is_tensor and result.meta.on_epoch and not result.has_reset
    }


def _sums(trainer: Trainer) -> dict[str, dict[str, Tensor]]:
    return {
        name: {
            part: getattr(result, part).detach().cpu()
            for part in ("value", "cumulated_batch_size")
            if hasattr(result, part)
        }
        for name, result in _results(trainer).items()
    }
