"""The evaluation of every epoch, in the evaluation space, by the windows protocol."""

from __future__ import annotations

from typing import Any

from lightning import Callback, LightningModule, Trainer

from cospeech.corpus.batch import GestureBatch
from cospeech.errors import CospeechError
from cospeech.experiment import RunContext
from cospeech.methods.base import GestureMethod
from cospeech.metrics.acceleration_error import AccelerationError
from cospeech.metrics.feature_distance import FeatureDistance
from cospeech.metrics.fgd import FrechetGestureDistance
from cospeech.metrics.joint_mae import JointMAE
from cospeech.metrics.protocol import cut_windows


class EvaluateFGD(Callback):
    """Logs ``<stage>/fgd`` with both its terms and the paper's accuracy measures.

    Reads the sampled positions that a method's ``validation_step`` gives back. A model that gives
    back none (the motion auto-encoder) is left alone.

    Logged, per stage (``val`` or ``test``): ``fgd``, ``fgd_mean_term``, ``fgd_covariance_term``,
    ``joint_mae`` (metres), ``acceleration_error`` (metres per frame squared) and
    ``feature_distance``. Lower is better for all of them.

    Args:
        run: The run's context.
    """

    def __init__(self, run: RunContext) -> None:
        self.encoder = run.encoder
        # One per stage, because the real windows are the same every epoch and their features kept.
        self._distances: dict[str, FrechetGestureDistance] = {}
        self._metrics: dict[str, Any] = {}
        self._real_is_known = False

    def _start(self, pl_module: LightningModule, stage: str) -> None:
        if self.encoder is None:
            return
        distance = self._distances.setdefault(
            stage, FrechetGestureDistance(self.encoder, reset_real_features=False)
        )
        distance.reset()
        self._real_is_known = distance.has_real_features
        self._metrics = {
            "fgd": distance,
            "joint_mae": JointMAE(),
            "acceleration_error": AccelerationError(),
            "feature_distance": FeatureDistance(self.encoder),
        }
        for metric in self._metrics.values():
            metric.to(pl_module.device)

    def _update(self, outputs: Any, batch: GestureBatch) -> None:
        if not self._metrics:
            return
        positions = batch.require("positions")
        if outputs.shape != positions.shape:
            raise CospeechError(
                f"the method samples {tuple(outputs.shape)} where its windows hold positions"
                f" {tuple(positions.shape)}, at 15 fps",
                "sample gives evaluation frames: cospeech.corpus.features.positions has"
                " at_evaluation_rate",
            )
        generated = cut_windows(outputs)
        if not generated.isfinite().all():
            raise CospeechError(
                "the method generates NaN or infinite positions: its weights are damaged",
                "look at the losses of the last epochs; the last checkpoint may still be good",
            )
        real = cut_windows(positions)
        if not self._real_is_known:
            self._metrics["fgd"].update(real, real=True)
        self._metrics["fgd"].update(generated, real=False)
        for name in ("joint_mae", "acceleration_error", "feature_distance"):
            self._metrics[name].update(generated, real)

    def _log(self, pl_module: LightningModule, stage: str) -> None:
        if not self._metrics:
            return
        terms = self._metrics["fgd"].terms()
        values = {
            "fgd": terms.total,
            "fgd_mean_term": terms.mean_term,
            "fgd_covariance_term": terms.covariance_term,
            **{name: metric.compute() for name, metric in self._metrics.items() if name != "fgd"},
        }
        if isinstance(pl_module, GestureMethod):
            values |= pl_module.derived_values(values)
        for name, value in values.items():
            # Already synchronised: every process logs the same value.
            pl_module.log(f"{stage}/{name}", value.float(), prog_bar=name == "fgd")
        self._metrics = {}

    def on_validation_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Empty metrics on the module's device."""
        self._start(pl_module, "val")

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
        self._start(pl_module, "test")

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
