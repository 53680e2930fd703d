"""A training's way through its stages: where it stands, what it skips, what it leaves behind."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from typing import Any

import torch

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.window_loader import WindowLoader
from cospeech.corpus.windows import ServesWindows
from cospeech.errors import ConfigError
from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
from cospeech.methods.multi_adversary.adversaries import Views
from cospeech.methods.multi_adversary.generation import GeneratesGestures
from cospeech.methods.multi_adversary.history import WeightHistory
from cospeech.methods.multi_adversary.keeping import DEPENDS_ON, StageProducts, packed, unpacked
from cospeech.methods.multi_adversary.products import tensors_hash
from cospeech.methods.multi_adversary.stages import STAGES, Curriculum, Progress, Schedule, Stage
from cospeech.motion.phases import PhaseMerge

logger = logging.getLogger(__name__)

_STATE = "multi_adversary"
_RUNS_AT_ONCE = 64


class GoesThroughStages(GeneratesGestures):
    """Takes a training from stage to stage; what a step does is its subclass's.

    Attributes:
        schedule: The stages and their lengths.
        progress: Where the training stands.
        done: Stages that products of earlier runs have taken the place of.
        kept: Those products.
        views: Hold the frozen classifier.
        history: Of the generator's pre-training.
        merge: Classes of the phases.
        classifier_path: File of the classifier; None where one is trained.
        seed: Of first weights, and of products.
        fingerprint: Of the corpus.
    """

    schedule: Schedule
    progress: Progress
    done: frozenset[Stage]
    kept: StageProducts
    views: Views
    history: WeightHistory
    merge: PhaseMerge
    classifier_path: str | None
    seed: int
    fingerprint: str

    _data: dict[str, Any] | None = None

    def on_fit_start(self) -> None:
        """See to the named classifier; a resumed training has it in its checkpoint.

        Nothing needs the file then: it may be gone.
        """
        self.read_files()

    def read_files(self) -> None:
        """Read the named classifier, unless it is there.

        Raises:
            CospeechError: It can't be read, has other classes, or needs joints that the corpus
                lacks.
        """
        if self.classifier_path is not None and self.views.classifier is None:
            classifier = FrozenPhaseClassifier.load(self.classifier_path)
            if classifier.merge.name != self.merge.name:
                raise ConfigError(
                    f"the classifier {self.classifier_path} tells the classes"
                    f" {classifier.merge.name!r}, not {self.merge.name!r}",
                    f"say model.phase_classes={classifier.merge.name}",
                )
            classifier.choose(torch.zeros(1, 1, len(self.layout.roles), 3), self.layout)
            self.views.classifier = classifier

    def on_train_start(self) -> None:
        """Take the statistics and what earlier runs left; stop where nothing is left to do."""
        if self._data is None:
            self._data = self._measure_corpus()
            self._take_products(self._data)
        if self.progress.stage == "finished":
            self._finish()
            return
        self._announce()
        self._compare_with_epochs()

    def on_train_epoch_start(self) -> None:
        """Forget the values of the epoch before, or a finished stage's would be logged for ever."""
        metrics = self.trainer.callback_metrics
        for name in [name for name in metrics if name.startswith("train/")]:
            del metrics[name]

    def _measure_corpus(self) -> dict[str, Any]:
        """Take the statistics; what the training sees, as plain values."""
        loader = self.trainer.train_dataloader
        assert isinstance(loader, WindowLoader)
        self.players.fit_scales(_EveryWindow(loader.dataset), list(self.layout.arms))
        return {
            "corpus": self.fingerprint,
            "seed": self.seed,
            "windows": [self.window.run, self.window.stride, len(loader.dataset)],
            "runs_per_batch": loader.sampler.batch_size,
            "batches": int(self.trainer.num_training_batches),
            "processes": self.trainer.world_size,
            "precision": str(self.trainer.precision),
            "scales": tensors_hash(self.players.scales.state_dict()),
        }

    def _take_products(self, data: dict[str, Any]) -> None:
        """Skip what earlier runs of the same settings have done.

        Only at the start of a run: a killed one goes on as it would have gone, whatever has become
        of the folder. A classifier that no stage needs is taken too, where there is one: validation
        tells phases with it.
        """
        wanted = {stage for stage in DEPENDS_ON if stage in self.schedule.lengths}
        if self.classifier_path is None:
            wanted.add("classifier")
        for stage in DEPENDS_ON:
            # The first process looks, or processes could be in different stages.
            looks = stage in wanted and self.trainer.is_global_zero
            content = self._from_first(self.kept.find(stage, data) if looks else None)
            if content is not None:
                self.kept.place(stage, content)
                self.done |= {stage}
        self.progress = Progress(self.schedule.first(self.done))
        self._forget_history()

    def _from_first(self, content: dict[str, Any] | None) -> dict[str, Any] | None:
        found: dict[str, Any] | None = self.trainer.strategy.broadcast(content, 0)
        return found

    def _forget_history(self) -> None:
        """The snapshots are large, and of no use after the curriculum."""
        if self.progress.number > STAGES.index("phase_curriculum") + 1:
            self.history.states = []

    def _end_stage(self) -> None:
        """Keep the stage's product and go on to the next."""
        stage = self.progress.stage
        if stage == "classifier":
            assert self.players.student is not None
            # Processes differ in the buffers that their last batch has moved.
            content = self._from_first(packed(self.players.student.frozen()))
            assert content is not None
            self.views.classifier = unpacked(content)
        elif stage == "phase_curriculum":
            self._report_curriculum(self.progress.curriculum)
        if stage in DEPENDS_ON and self.trainer.is_global_zero:
            self.kept.keep(stage, self._data)
        self.progress = Progress(self.schedule.next_after(stage, self.done))
        self._forget_history()
        if self.progress.stage == "finished":
            self._finish()
        else:
            self._announce()

    def _announce(self) -> None:
        place = f"step {self.progress.step}"
        logger.info("stage %d, %s, from %s on", self.progress.number, self.progress.stage, place)

    def _finish(self) -> None:
        logger.info("all stages are done")
        self.trainer.should_stop = True

    def _report_curriculum(self, curriculum: Curriculum) -> None:
        logger.info("batches per level: %s", ", ".join(map(str, curriculum.spent)))
        if curriculum.capped:
            logger.warning(
                "the phase adversary left levels %s by the limit of %d batches, not its accuracy",
                ", ".join(map(str, curriculum.capped)),
                self.schedule.curriculum.most_batches,
            )

    @property
    def steps_left(self) -> int:
        """Training steps to the end of the last stage, or a few more if the curriculum is hard."""
        return self.progress.least_steps_left(self.schedule, self.done)

    @property
    def in_last_stage(self) -> bool:
        """From the middle of the last stage on.

        At its beginning the generator still is the pre-trained one, whose damped motion can have
        the smaller gap.
        """
        if self.progress.stage != "adversarial":
            return self.progress.stage == "finished"
        return 2 * self.progress.step >= (self.schedule.lengths["adversarial"] or 0)

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

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Add the state that is no weight: plain values and tensors."""
        classifier = self.views.classifier
        checkpoint[_STATE] = {
            "seed": self.seed,
            "data": self._data,
            "progress": self.progress.to_dict(),
            "done": sorted(self.done),
            "history": self.history.states,
            "classifier": None if classifier is None else packed(classifier),
        }

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Take the state that is no weight."""
        state = checkpoint[_STATE]
        self.seed, self._data = state["seed"], state["data"]
        self.progress = Progress.from_dict(state["progress"])
        self.done = frozenset(state["done"])
        self.history.states = state["history"]
        found = state["classifier"]
        self.views.classifier = None if found is None else unpacked(found)

    @property
    def classifier(self) -> FrozenPhaseClassifier | None:
        """The finished classifier; None before its stage has ended, or where nothing needs one."""
        return self.views.classifier

    def _judging_classifier(self) -> FrozenPhaseClassifier | None:
        if self.progress.stage == "classifier" and self.players.student is not None:
            return self.players.student.frozen()
        return self.views.classifier


class _EveryWindow:
    """All windows of a dataset in their order, some runs at a time, as often as wanted."""

    def __init__(self, dataset: ServesWindows) -> None:
        self.dataset = dataset

    def __iter__(self) -> Iterator[GestureBatch]:
        count = len(self.dataset)
        for first in range(0, count, _RUNS_AT_ONCE):
            yield self.dataset.batch(range(first, min(first + _RUNS_AT_ONCE, count)))
