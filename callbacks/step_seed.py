"""Random numbers as a pure function of (seed, epoch, step)."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from lightning import Callback, LightningModule, Trainer


class SeedEachStep(Callback):
    """Seeds torch before every training step from the step's own number.

    A resumed run then draws what the uninterrupted one would have drawn, wherever it was stopped,
    and nothing that happens between steps (validation, rendering) can change the training.

    Args:
        seed: The run's seed.
    """

    def __init__(self, seed: int) -> None:
        self.seed = seed

    def on_train_batch_start(
        self, trainer: Trainer, pl_module: LightningModule, batch: Any, batch_idx: int
    ) -> None:
        """Seed the step; ranks of a distributed run draw apart."""
        key = [self.seed, trainer.current_epoch, batch_idx, trainer.global_rank]
        torch.manual_seed(int(np.random.SeedSequence(key).generate_state(1, np.uint64)[0] >> 1))
