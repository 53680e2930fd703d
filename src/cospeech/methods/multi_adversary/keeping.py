"""Which product belongs to a stage: what it depends on, what is in it, and where it goes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from torch import nn

from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
from cospeech.methods.multi_adversary.adversaries import Views
from cospeech.methods.multi_adversary.history import WeightHistory, on_cpu
from cospeech.methods.multi_adversary.players import Players
from cospeech.methods.multi_adversary.products import Products, product_key, tensors_hash
from cospeech.methods.multi_adversary.stages import Stage

DEPENDS_ON: dict[Stage, tuple[str, ...]] = {
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
"""Stages that leave a product, and the constructor's arguments that it depends on."""

_ADVERSARY_OF: dict[Stage, str] = {"phase_curriculum": "phase", "motion_pretraining": "motion"}


class StageProducts:
    """Keeps what the stages made, and puts what earlier runs kept in its place.

    Args:
        products: The folder.
        players: The networks.
        views: Hold the classifier.
        history: Of the generator's pre-training.
        arguments: The constructor's, as plain values.
        settings: Of the adversaries.
    """

    def __init__(
        self,
        products: Products,
        players: Players,
        views: Views,
        history: WeightHistory,
        arguments: Mapping[str, Any],
        settings: Mapping[str, Mapping[str, float]],
    ) -> None:
        self.products, self.players = products, players
        self.views, self.history = views, history
        self.arguments, self.settings = arguments, settings

    def key(self, stage: Stage, data: Any) -> str:
        """Hash of everything that the product of a stage depends on.

        Args:
            stage: One of `DEPENDS_ON`.
            data: What the training saw, as JSON values.
        """
        facts: dict[str, Any] = {name: self.arguments[name] for name in DEPENDS_ON[stage]}
        if stage in _ADVERSARY_OF:
            settings = self.settings[_ADVERSARY_OF[stage]]
            # Its weight is of no account before the generator feels it.
            facts["sizes"] = {key: value for key, value in settings.items() if key != "weight"}
        if stage == "phase_curriculum":
            facts["pretraining"] = self.key("pretraining", data)
            if self.players.student is not None:
                facts["classifier"] = self.key("classifier", data)
            elif self.views.classifier is not None:
                classifier = self.views.classifier
                state = tensors_hash(classifier.state_dict())
                facts["classifier"] = [dict(classifier.describe()), state]
        return product_key([stage, data, facts])

    def find(self, stage: Stage, data: Any) -> dict[str, Any] | None:
        """The product of a stage; None where there is none."""
        return self.products.find(stage, self.key(stage, data))

    def place(self, stage: Stage, content: dict[str, Any]) -> None:
        """Put the product of a stage in its place."""
        if stage == "classifier":
            self.views.classifier = unpacked(content)
        elif stage == "pretraining":
            self.history.states = content["history"]
            self.players.generator.load_state_dict(content["history"][-1])
        else:
            self._discriminator(stage).load_state_dict(content["state"])

    def keep(self, stage: Stage, data: Any) -> None:
        """Keep what a stage has made."""
        if stage == "classifier":
            assert self.views.classifier is not None
            content: dict[str, Any] = packed(self.views.classifier)
        elif stage == "pretraining":
            content = {"history": self.history.states}
        else:
            content = {"state": on_cpu(self._discriminator(stage))}
        self.products.keep(stage, self.key(stage, data), content)

    def _discriminator(self, stage: Stage) -> nn.Module:
        return self.players.adversaries[_ADVERSARY_OF[stage]].discriminator


def packed(classifier: FrozenPhaseClassifier) -> dict[str, Any]:
    """A classifier as plain values and tensors; `unpacked` makes it one again."""
    return {"description": dict(classifier.describe()), "state": on_cpu(classifier)}


def unpacked(content: dict[str, Any]) -> FrozenPhaseClassifier:
    """The classifier that `packed` was given, on the CPU."""
    return FrozenPhaseClassifier.restored(content["description"], content["state"])
