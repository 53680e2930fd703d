"""What the stages of this training see, make and leave behind (Ferstl et al. 2020)."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import torch
from torch import nn

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.window_loader import WindowLoader
from cospeech.corpus.windows import ServesWindows
from cospeech.errors import ConfigError
from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
from cospeech.methods.multi_adversary.adversaries import Settings, Views
from cospeech.methods.multi_adversary.curriculum import Curriculum, CurriculumRules
from cospeech.methods.multi_adversary.generation import GeneratesGestures
from cospeech.methods.multi_adversary.history import WeightHistory, on_cpu
from cospeech.motion.phases import PhaseMerge
from cospeech.training.products import tensors_hash
from cospeech.training.staging import TrainsInStages

logger = logging.getLogger(__name__)

STAGES = ("classifier", "pretraining", "phase_curriculum", "motion_pretraining", "adversarial")

_ADVERSARY_OF = {"phase_curriculum": "phase", "motion_pretraining": "motion"}
_RUNS_AT_ONCE = 64
_STATE = "multi_adversary"


class GoesThroughStages(TrainsInStages, GeneratesGestures):
    """The stages of the paper; what a step does is its subclass's.

    Attributes:
        settings: Of the adversaries.
        views: Hold the frozen classifier.
        history: Of the generator's pre-training.
        curriculum: How far the phase adversary has come through the history.
        rules: Of the curriculum.
        merge: Classes of the phases.
        classifier_path: File of the classifier; None where one is trained.
        fingerprint: Of the corpus.
    """

    product_settings: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "classifier": (
            "phase_classes",
            "pitch",
            "classifier_sizes",
            "classifier_steps",
            "classifier_learning_rate",
        ),
        "pretraining": (
            "hidden_size",
            "pretraining_steps",
            "snapshots",
            "pretraining_dropout",
            "pretraining_learning_rate",
        ),
        "phase_curriculum": (
            "phase_classes",
            "labels",
            "curriculum_accuracy",
            "curriculum_streak",
            "curriculum_batches",
            "adversarial_dropout",
            "discriminator_learning_rate",
        ),
        "motion_pretraining": (
            "hidden_size",
            "motion_pretraining_steps",
            "adversarial_dropout",
            "learning_rate",
            "discriminator_learning_rate",
        ),
    }

    settings: Settings
    views: Views
    history: WeightHistory
    curriculum: Curriculum
    rules: CurriculumRules
    merge: PhaseMerge
    classifier_path: str | None
    fingerprint: str

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

    def measure_corpus(self) -> dict[str, Any]:
        """Take the statistics; corpus, windows and scales as plain values."""
        loader = self.trainer.train_dataloader
        assert isinstance(loader, WindowLoader)
        self.players.fit_scales(_EveryWindow(loader.dataset), list(self.layout.arms))
        return {
            "corpus": self.fingerprint,
            "windows": [self.window.run, self.window.stride, len(loader.dataset)],
            "runs_per_batch": loader.sampler.batch_size,
            "scales": tensors_hash(self.players.scales.state_dict()),
        }

    def usable_products(self) -> set[str]:
        """Those of the stages it goes through, and a classifier.

        One that no stage needs is taken too, where there is one: validation tells phases with it.
        """
        return super().usable_products() | (set() if self.classifier_path else {"classifier"})

    def further_facts(self, stage: str) -> dict[str, Any]:
        """The adversary, and the products that the curriculum begins with."""
        facts: dict[str, Any] = {}
        if stage in _ADVERSARY_OF:
            facts["adversary"] = self.settings[_ADVERSARY_OF[stage]].identity()
        if stage == "phase_curriculum":
            facts["pretraining"] = self.product_key("pretraining")
            if self.players.student is not None:
                facts["classifier"] = self.product_key("classifier")
            elif self.views.classifier is not None:
                facts["classifier"] = [
                    dict(self.views.classifier.describe()),
                    tensors_hash(self.views.classifier.state_dict()),
                ]
        return facts

    def product(self, stage: str) -> dict[str, Any]:
        """The classifier, the history, or the weights of a discriminator."""
        if stage == "classifier":
            assert self.views.classifier is not None
            return packed(self.views.classifier)
        if stage == "pretraining":
            return {"history": self.history.states}
        return {"state": on_cpu(self._discriminator(stage))}

    def take_product(self, stage: str, product: dict[str, Any]) -> None:
        """Put it in its place."""
        if stage == "classifier":
            self.views.classifier = unpacked(product)
        elif stage == "pretraining":
            self.history.states = product["history"]
            self.players.generator.load_state_dict(product["history"][-1])
        else:
            self._discriminator(stage).load_state_dict(product["state"])

    def _discriminator(self, stage: str) -> nn.Module:
        return self.players.adversaries[_ADVERSARY_OF[stage]].discriminator

    def open_ended_steps(self) -> dict[str, int]:
        """Of the curriculum, as if every batch were good."""
        return {"phase_curriculum": self.curriculum.least_steps_left(self.rules)}

    def end_stage(self) -> None:
        """Freeze the classifier; tell how the curriculum went."""
        if self.progress.stage == "classifier":
            assert self.players.student is not None
            # Processes differ in the buffers that their last batch has moved.
            content = self.from_first_process(packed(self.players.student.frozen()))
            assert content is not None
            self.views.classifier = unpacked(content)
        elif self.progress.stage == "phase_curriculum":
            logger.info("batches per level: %s", ", ".join(map(str, self.curriculum.spent)))
            if self.curriculum.capped:
                logger.warning(
                    "the phase adversary left levels %s by the limit of %d batches, not its"
                    " accuracy",
                    ", ".join(map(str, self.curriculum.capped)),
                    self.rules.most_batches,
                )

    def begin_stage(self) -> None:
        """Forget the snapshots, which are large, where the curriculum is over."""
        number = self.schedule.number
        if number(self.progress.stage) > number("phase_curriculum"):
            self.history.states = []

    @property
    def in_last_stage(self) -> bool:
        """From the middle of the last stage on.

        At its beginning the generator still is the pre-trained one, whose damped motion can have
        the smaller gap.
        """
        length = self.schedule.lengths["adversarial"] or 0
        return super().in_last_stage and 2 * self.steps_left <= length

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Add the state that is no weight: plain values and tensors."""
        super().on_save_checkpoint(checkpoint)
        classifier = self.views.classifier
        checkpoint[_STATE] = {
            "curriculum": self.curriculum.to_dict(),
            "history": self.history.states,
            "classifier": None if classifier is None else packed(classifier),
        }

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Take the state that is no weight."""
        super().on_load_checkpoint(checkpoint)
        state = checkpoint[_STATE]
        self.curriculum = Curriculum.from_dict(state["curriculum"])
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


def packed(classifier: FrozenPhaseClassifier) -> dict[str, Any]:
    """A classifier as plain values and tensors; `unpacked` makes it one again."""
    return {"description": dict(classifier.describe()), "state": on_cpu(classifier)}


def unpacked(content: dict[str, Any]) -> FrozenPhaseClassifier:
    """The classifier that `packed` was given, on the CPU."""
    return FrozenPhaseClassifier.restored(content["description"], content["state"])
