"""The evaluation of every epoch, in the evaluation space, by the windows protocol."""

from __future__ import annotations

from typing import Any

from lightning import Callback, LightningModule, Trainer

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.window_loader import WindowLoader
from cospeech.evaluation import EpochEvaluation, EvaluationFields
from cospeech.experiment import RunContext
from cospeech.methods.base import GestureMethod


class EvaluateFGD(Callback):
    """Logs ``<stage>/<metric>`` (``val`` or ``test``) for every metric of ``conf/metrics``.

    Reads the sampled positions that a method's ``validation_step`` gives back. A model that makes
    no motion (the motion auto-encoder) is left alone.

    Args:
        run: The run's context.
    """

    def __init__(self, run: RunContext) -> None:
        self.encoder, self.catalogue = run.encoder, run.catalogue
        self._evaluation: EpochEvaluation | None = None
        self._fields = dict[str, EvaluationFields]()

    def _start(self, pl_module: LightningModule, stage: str, loader: Any) -> None:
        if self.encoder is None or not isinstance(pl_module, GestureMethod):
            return
        assert isinstance(loader, WindowLoader)
        if stage not in self._fields:  # the windows of a stage are fixed
            self._fields[stage] = EvaluationFields(loader.dataset, self.catalogue.needs)
        self._evaluation = EpochEvaluation(
            self.catalogue, self.encoder, self._fields[stage], pl_module.device
        )

    def _update(self, outputs: Any, batch: GestureBatch) -> None:
        if self._evaluation is not None:
            self._evaluation.update(outputs, batch)

    def _log(self, pl_module: LightningModule, stage: str) -> None:
        if self._evaluation is None:
            return
        assert isinstance(pl_module, GestureMethod)
        values = self._evaluation.compute()
        for name, value in (values | pl_module.derived_values(values)).items():
            # Already synchronised: every process logs the same value.
            pl_module.log(f"{stage}/{name}", value.float(), prog_bar=name == "fgd")
        self._evaluation = None

    def on_validation_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Empty metrics on the module's device."""
        self._start(pl_module, "val", trainer.val_dataloaders)

    def on_validation_batch_end(
        self,
        trainer: Trainer,
        pl_module: LightningModule,
        outputs: Any,
        batch: GestureBatch,
        batch_idx: int,
        dataloader_idx: int = 0,
    ) -> None:
        """Add a batch."""
        self._update(outputs, batch)

    def on_validation_epoch_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Log the epoch's values."""
        self._log(pl_module, "val")

    def on_test_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """As for validation."""
        self._start(pl_module, "test", trainer.test_dataloaders)

    def on_test_batch_end(
        self,
        trainer: Trainer,
        pl_module: LightningModule,
        outputs: Any,
        batch: GestureBatch,
        batch_idx: int,
        dataloader_idx: int = 0,
    ) -> None:
        """As for validation."""
        self._update(outputs, batch)

    def on_test_epoch_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """As for validation."""
        self._log(pl_module, "test")
