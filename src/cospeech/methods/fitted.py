"""Methods that are fitted to their corpus at once."""

from abc import abstractmethod

import torch

from cospeech.corpus.batch import GestureBatch
from cospeech.methods.base import GestureMethod


class FittedWithoutSteps(GestureMethod):
    """A method that is fitted to its corpus at once and has no weights to step.

    Epochs do nothing but be judged. Lightning saves a checkpoint when a step has been counted, and
    it counts those of optimizers alone, so a batch is counted as one here.
    """

    @abstractmethod
    def fit_to_corpus(self) -> None:
        """Take from the corpus all that is needed; checkpoints hold it as buffers."""

    def on_fit_start(self) -> None:
        """Fit before the first epoch."""
        self.fit_to_corpus()

    def configure_optimizers(self) -> list[torch.optim.Optimizer]:
        """There are none."""
        return []

    def training_step(self, batch: GestureBatch, batch_idx: int) -> None:
        """Count the batch."""
        loop = self.trainer.fit_loop.epoch_loop.manual_optimization
        loop.optim_step_progress.increment_completed()
