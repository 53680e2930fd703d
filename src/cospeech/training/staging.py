"""A training's way through its stages: where it stands, what it skips, what it leaves behind."""

from __future__ import annotations

import logging
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

from lightning import LightningModule

from cospeech.training.products import Products, product_key
from cospeech.training.stages import FINISHED, Progress, Schedule

logger = logging.getLogger(__name__)

_STATE = "stages"


class TrainsInStages(LightningModule):
    """A training that goes from stage to stage and then stops by itself.

    A stage may leave a product, in a file that later runs of the same settings start from. A
    subclass sets what is below, ends each training step with `finish_step`, and says what products
    hold. What is random before the first step depends on ``seed`` alone.

    Attributes:
        product_settings: Stages that leave a product -> hyperparameters that it depends on.
        products: Their folder.
        schedule: The stages and their lengths.
        progress: Where the training stands.
        done: Stages that products of earlier runs have taken the place of.
        seed: Of first weights, and so of products.
        training_facts: What the training sees, as JSON values; None before it has begun.
    """

    product_settings: ClassVar[Mapping[str, tuple[str, ...]]] = {}

    products: Products = Products(None)
    schedule: Schedule
    progress: Progress
    done: frozenset[str] = frozenset()
    seed: int = 0
    training_facts: dict[str, Any] | None = None

    @abstractmethod
    def measure_corpus(self) -> dict[str, Any]:
        """Take the statistics before the first step.

        Returns:
            What products depend on besides settings and the trainer, as JSON values.
        """

    def further_facts(self, stage: str) -> dict[str, Any]:
        """What a stage's product depends on besides its settings, as JSON values: others' products.

        Args:
            stage: One of ``product_settings``.
        """
        return {}

    def product(self, stage: str) -> dict[str, Any]:
        """What a stage has made, as plain values and tensors.

        Args:
            stage: One of ``product_settings``.
        """
        raise NotImplementedError(stage)

    def take_product(self, stage: str, product: dict[str, Any]) -> None:
        """Put what a stage has made in its place.

        Args:
            stage: One of ``product_settings``.
            product: What `product` gave.
        """
        raise NotImplementedError(stage)

    def usable_products(self) -> set[str]:
        """Stages whose products a new run looks for."""
        return set(self.product_settings) & set(self.schedule.lengths)

    def open_ended_steps(self) -> dict[str, int]:
        """Steps that the stages without a length need at least, from where they stand."""
        return {}

    def end_stage(self) -> None:
        """Do what is due when the stage is complete, before its product is written."""

    def begin_stage(self) -> None:
        """Do what is due when a stage has become the training's, finished ones included."""

    # Lightning's hooks, and what a training step ends with ------------------------------------

    def on_train_start(self) -> None:
        """Take the statistics and what earlier runs left; stop where nothing is left to do."""
        if self.training_facts is None:
            self.training_facts = {
                "seed": self.seed,
                "batches": int(self.trainer.num_training_batches),
                "processes": self.trainer.world_size,
                "precision": str(self.trainer.precision),
                **self.measure_corpus(),
            }
            self._take_products()
        self._announce()
        self._compare_with_epochs()

    def on_train_epoch_start(self) -> None:
        """Forget the values of the epoch before, or a finished stage's would be logged for ever."""
        metrics = self.trainer.callback_metrics
        for name in [name for name in metrics if name.startswith("train/")]:
            del metrics[name]

    def finish_step(self) -> None:
        """Count a step; when the stage is complete, write its product and go on to the next."""
        stage = self.progress.stage
        if len(self.schedule.names) > 1:
            number = float(self.schedule.number(stage))
            self.log(
                "train/stage", number, on_step=False, on_epoch=True, prog_bar=True, reduce_fx="max"
            )
        self.progress = self.progress.after_step()
        length = self.schedule.lengths[stage]
        left = self.open_ended_steps()[stage] if length is None else length - self.progress.step
        if left > 0:
            return
        self.end_stage()
        if stage in self.product_settings and self.trainer.is_global_zero:
            self.products.write(stage, self.product_key(stage), self.product(stage))
        self.progress = Progress(self.schedule.next_after(stage, self.done))
        self.begin_stage()
        self._announce()

    def product_key(self, stage: str) -> str:
        """Hash of everything that the product of a stage depends on.

        Args:
            stage: One of ``product_settings``.
        """
        facts = {name: self.hparams[name] for name in self.product_settings[stage]}
        return product_key([stage, self.training_facts, facts, self.further_facts(stage)])

    def from_first_process(self, content: dict[str, Any] | None) -> dict[str, Any] | None:
        """What the first process has, in all of them."""
        found: dict[str, Any] | None = self.trainer.strategy.broadcast(content, 0)
        return found

    @property
    def steps_left(self) -> int:
        """Training steps to the end of the last stage, or more where one has no length."""
        return self.schedule.steps_left(self.progress, self.done, self.open_ended_steps())

    @property
    def in_last_stage(self) -> bool:
        """Whether no stage comes after this one, or all are done."""
        return self.schedule.next_after(self.progress.stage) == FINISHED

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Add where the training stands, as plain values."""
        checkpoint[_STATE] = {
            "seed": self.seed,
            "training_facts": self.training_facts,
            "stage": self.progress.stage,
            "step": self.progress.step,
            "done": sorted(self.done),
        }

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Stand where the checkpoint's training stood."""
        state = checkpoint[_STATE]
        self.seed, self.training_facts = state["seed"], state["training_facts"]
        self.progress = Progress(state["stage"], state["step"])
        self.done = frozenset(state["done"])

    def _take_products(self) -> None:
        """Skip what earlier runs of the same settings have done.

        Only at the start of a run: a killed one goes on as it would have gone, whatever has become
        of the folder.
        """
        usable = self.usable_products()
        for stage in self.product_settings:
            found = None
            # The first process looks, or processes could be in different stages.
            if stage in usable and self.trainer.is_global_zero:
                found = self.products.find(stage, self.product_key(stage))
            product = self.from_first_process(found)
            if product is not None:
                self.take_product(stage, product)
                self.done |= {stage}
        self.progress = Progress(self.schedule.first(self.done))
        self.begin_stage()

    def _announce(self) -> None:
        stage, step = self.progress.stage, self.progress.step
        if stage == FINISHED:
            logger.info("all stages are done")
            self.trainer.should_stop = True
        else:
            logger.info("stage %d, %s, from step %d on", self.schedule.number(stage), stage, step)

    def _compare_with_epochs(self) -> None:
        epochs = self.trainer.max_epochs
        if epochs is None or epochs < 0:
            return
        left = (epochs - self.current_epoch) * int(self.trainer.num_training_batches)
        if left < self.steps_left:
            logger.warning(
                "%d epochs hold %d more steps, and the stages need %d or more: the last won't be"
                " finished; raise training.epochs",
                epochs,
                left,
                self.steps_left,
            )
