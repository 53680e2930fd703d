"""Training through all stages in one run, and what evaluation needs (Ferstl et al. 2020)."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, cast, get_args

import torch
from lightning.pytorch.core.optimizer import LightningOptimizer
from torch import Tensor, nn

from cospeech.adversarial.settings import checked_settings
from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.facts import CorpusFacts
from cospeech.corpus.windows import WindowSpec
from cospeech.errors import ConfigError, require_choice, require_range
from cospeech.judges.phase_classifier.frozen import WINDOW_FRAMES
from cospeech.judges.phase_classifier.network import STEP_FPS, PhaseSizes
from cospeech.methods.multi_adversary.adversaries import ADVERSARIES, Labels, Views, WindowAdversary
from cospeech.methods.multi_adversary.curriculum import Curriculum, CurriculumRules, snapshot_steps
from cospeech.methods.multi_adversary.history import WeightHistory
from cospeech.methods.multi_adversary.players import Players
from cospeech.methods.multi_adversary.staging import STAGES, GoesThroughStages
from cospeech.methods.multi_adversary.steps import Logs, StageSteps, StepSettings
from cospeech.methods.multi_adversary.synthesis import LongForm, head_offsets
from cospeech.motion.gesture_joints import gesture_joints
from cospeech.motion.phases import PHASE_MERGES
from cospeech.motion.skeleton import Skeleton
from cospeech.training.products import Products
from cospeech.training.stages import Progress, Schedule
from cospeech.training.steps import descend, log_losses

PAPER_WEIGHTS = {"phase": 2.0, "motion": 4.0, "minibatch": 4.0, "displacement": 1.0}
"""The adversaries' weights in the paper, equation 3."""

LONGEST_RUN = 4
"""Consecutive windows of a batch: with more, batch norm and the minibatch adversary would see
little else than one moment of one take (docs/facts/multi_adversary.md, section 7, trap 7)."""


MOST_SNAPSHOTS = 1000
"""Each holds all weights of the generator."""


class MultiAdversary(GoesThroughStages):
    """GAN of Ferstl et al. 2020: prosody to 3-D gestures, judged by up to four adversaries.

    One training goes through the stages ``classifier``, ``pretraining``, ``phase_curriculum``,
    ``motion_pretraining`` and ``adversarial``, and then stops by itself. Where it stands is in
    every checkpoint. Reads joints, acoustics, and phases where a classifier is to be trained.

    Args:
        corpus: The skeleton, the mean head and the fingerprint are used.
        adversaries: Name -> ``{"weight": ...}`` and, where wanted, ``loss`` and sizes (see
            `cospeech.methods.multi_adversary.adversaries`), and ``class`` for others than the
            paper's (see the README); None for a name leaves it out, a weight of 0 lets it watch.
            None takes the paper's four. With none of them the last stage makes objective steps
            only.
        classifier: File of a trained phase classifier; None trains one on the corpus's phases.
        products_dir: Folder where stages leave their products, and find them; None: nowhere.
        phase_classes: Name of the classes in `PHASE_MERGES`.
        pitch: Whether the classifier that is trained here reads the pitch.
        labels: ``"soft"``: the phase adversary sees probabilities. ``"hard"``: one-hot labels, of
            real and generated motion alike, with the probabilities' gradient.
        curriculum: Whether the phase adversary is pre-trained on the generator's history.
        hidden_size: Of the generator.
        classifier_sizes: Of `PhaseSizes`; None takes its defaults.
        classifier_steps: Length of the stage.
        pretraining_steps: Length of the stage.
        snapshots: Levels of the curriculum: moments of the pre-training, the first before it.
        curriculum_accuracy: Accuracy that a batch of a level must reach ...
        curriculum_streak: ... so often in a row ...
        curriculum_batches: ... within so many batches, or the level ends without.
        motion_pretraining_steps: Length of the stage.
        adversarial_steps: Length of the stage.
        steps_per_correction: Adversarial steps per objective step.
        pretraining_dropout: Of the generator's dense layer and of its GRU.
        adversarial_dropout: The same, in all stages after the pre-training.
        continuity_weight: Of the jump from a window to the next; 0 only logs it.
        finger_weight: Of the finger tips' offsets; 0 only logs it.
        classifier_learning_rate: Of Adam.
        pretraining_learning_rate: Of Adam.
        learning_rate: Of RMSprop, generator against adversaries.
        discriminator_learning_rate: Of RMSprop.
        correction_learning_rate: Of RMSprop, objective steps.
        run: Consecutive windows that stay together in a batch, 1 to 4.
        stride: Steps from one run's start to the next.
        long_form: How speech longer than a window is made (`LongForm`).

    Raises:
        ConfigError: A value that is out of its range or not among the choices.
        CospeechError: The corpus's skeleton lacks the gesturing joints.
    """

    # Only the classifier learns from phases, on what has them (section 4.1: 226 of 370 minutes).
    window = WindowSpec(
        fps=STEP_FPS,
        frames=WINDOW_FRAMES,
        seed_frames=0,
        stride=200,
        run=4,
        interleaved=True,
        unlabelled=True,
    )
    needs = frozenset({"joints", "acoustics"})

    def __init__(
        self,
        corpus: CorpusFacts,
        adversaries: dict[str, dict[str, Any] | None] | None = None,
        classifier: str | None = None,
        products_dir: str | None = None,
        phase_classes: str = "four",
        pitch: bool = True,
        labels: Labels = "soft",
        curriculum: bool = True,
        hidden_size: int = 256,
        classifier_sizes: dict[str, float] | None = None,
        classifier_steps: int = 2000,
        pretraining_steps: int = 5000,
        snapshots: int = 20,
        curriculum_accuracy: float = 0.7,
        curriculum_streak: int = 3,
        curriculum_batches: int = 2000,
        motion_pretraining_steps: int = 1000,
        adversarial_steps: int = 20_000,
        steps_per_correction: int = 2,
        pretraining_dropout: tuple[float, float] = (0.3, 0.5),
        adversarial_dropout: tuple[float, float] = (0.2, 0.2),
        continuity_weight: float = 1.0,
        finger_weight: float = 1.0,
        classifier_learning_rate: float = 1e-3,
        pretraining_learning_rate: float = 1e-3,
        learning_rate: float = 1e-4,
        discriminator_learning_rate: float = 1e-4,
        correction_learning_rate: float = 2e-5,
        run: int = 4,
        stride: int = 200,
        long_form: LongForm = "crossfade",
    ) -> None:
        super().__init__()
        require_choice("model.phase_classes", phase_classes, tuple(PHASE_MERGES))
        require_choice("model.labels", labels, get_args(Labels))
        require_choice("model.long_form", long_form, get_args(LongForm))
        require_range("model.run", run, 1, LONGEST_RUN)
        require_range("model.snapshots", snapshots, 2, MOST_SNAPSHOTS)
        for name, length in (
            ("classifier_steps", classifier_steps),
            ("pretraining_steps", pretraining_steps),
            ("motion_pretraining_steps", motion_pretraining_steps),
            ("adversarial_steps", adversarial_steps),
            ("curriculum_streak", curriculum_streak),
            ("curriculum_batches", curriculum_batches),
            ("steps_per_correction", steps_per_correction),
            ("stride", stride),
        ):
            require_range(f"model.{name}", length, 1)
        self.save_hyperparameters(logger=False)
        # The run seeds torch before it builds its model; first weights and products depend on it.
        self.seed = torch.initial_seed()
        if adversaries is None:
            adversaries = {name: {"weight": weight} for name, weight in PAPER_WEIGHTS.items()}
        methods = [kind for kind in type(self).__mro__ if issubclass(kind, MultiAdversary)]
        self.settings = checked_settings(adversaries, ADVERSARIES, WindowAdversary, methods)  # type: ignore[type-abstract]
        self.classifier_path = classifier
        self.fingerprint, self.speakers = corpus["fingerprint"], list(corpus["speakers"])
        self.layout = gesture_joints(Skeleton.from_dict(corpus["skeleton"]))
        self.window = replace(self.window, run=run, stride=stride)
        sees_phases = any(found.kind.sees_phases for found in self.settings.values())
        trains_classifier = classifier is None and sees_phases
        if trains_classifier:
            self.needs = self.needs | {"phases"}  # type: ignore[misc]
        self.merge = PHASE_MERGES[phase_classes]
        self.learning_rates = {
            "classifier": classifier_learning_rate,
            "pretraining": pretraining_learning_rate,
            "generator": learning_rate,
            "discriminator": discriminator_learning_rate,
            "correction": correction_learning_rate,
        }
        self.long_form: LongForm = long_form
        self.register_buffer("head", head_offsets(corpus["mean_direction"], corpus["bone_lengths"]))
        self.players = Players(
            self.layout,
            self.settings,
            hidden_size,
            self.window.frames,
            self.merge,
            student=trains_classifier,
            pitch=pitch,
            sizes=_phase_sizes(classifier_sizes),
            seed=self.seed,
        )
        self.views = Views(self.players.scales, self.players.displacements, self.layout, labels)
        self.history = WeightHistory(snapshot_steps(pretraining_steps, snapshots))
        self.steps = StageSteps(
            self.players,
            self.views,
            self.history,
            StepSettings(
                run,
                self.window.frames,
                pretraining_dropout,
                adversarial_dropout,
                steps_per_correction,
                continuity_weight,
                finger_weight,
            ),
            self._descend,
        )
        self.products = Products(products_dir)
        lengths = {
            "classifier": classifier_steps,
            "pretraining": pretraining_steps,
            "phase_curriculum": None,
            "motion_pretraining": motion_pretraining_steps,
            "adversarial": adversarial_steps,
        }
        left_out = {
            "classifier": not trains_classifier,
            "phase_curriculum": "phase" not in self.settings or not curriculum,
            "motion_pretraining": "motion" not in self.settings,
        }
        self.schedule = Schedule(
            STAGES, {stage: lengths[stage] for stage in STAGES if not left_out.get(stage)}
        )
        self.rules = CurriculumRules(
            len(self.history.moments),
            curriculum_accuracy,
            curriculum_streak,
            curriculum_batches,
        )
        self.curriculum = Curriculum()
        self.progress = Progress(self.schedule.first())

    def _optimizers(self) -> dict[str, tuple[type, nn.Module, float]]:
        """Kind, network and rate by name.

        There is one per stage and network, so that a product needs no state of an optimiser.
        """
        adam, rmsprop, rates = torch.optim.Adam, torch.optim.RMSprop, self.learning_rates
        players = self.players
        found: dict[str, tuple[type, nn.Module, float]] = {
            "pretraining": (adam, players.generator, rates["pretraining"]),
            "generator": (rmsprop, players.generator, rates["generator"]),
            "correction": (rmsprop, players.generator, rates["correction"]),
        }
        if players.student is not None:
            found["classifier"] = (adam, players.student, rates["classifier"])
        if players.rehearsal is not None:
            found["rehearsal"] = (rmsprop, players.rehearsal, rates["generator"])
        for name, adversary in players.adversaries.items():
            if name in ("phase", "motion"):
                found[f"pretraining_{name}"] = (rmsprop, adversary, rates["discriminator"])
            found[f"adversary_{name}"] = (rmsprop, adversary, rates["discriminator"])
        return found

    def configure_optimizers(self) -> list[torch.optim.Optimizer]:
        """Adam for what is trained by itself, RMSprop for what plays against something."""
        return [
            kind(network.parameters(), lr=rate)
            for kind, network, rate in self._optimizers().values()
        ]

    def _descend(self, name: str, loss: Tensor, largest_norm: float | None = None) -> None:
        optimizers = cast(list[LightningOptimizer], self.optimizers())
        descend(self, optimizers[list(self._optimizers()).index(name)], loss, largest_norm)

    def training_step(self, batch: GestureBatch, batch_idx: int) -> Logs:
        """One step of the stage that the training is in."""
        losses = self.steps.take(self.progress, batch, self.curriculum.level)
        logs = log_losses(self, losses, len(batch))
        if self.progress.stage == "phase_curriculum":
            # All processes go on to the next level together.
            together = cast(Tensor, self.all_gather(logs["train/curriculum_accuracy"]))
            self.curriculum = self.curriculum.after(float(together.mean()), self.rules)
        self.finish_step()
        return logs


def _phase_sizes(sizes: dict[str, float] | None) -> PhaseSizes | None:
    if sizes is None:
        return None
    known = [field.name for field in fields(PhaseSizes)]
    if unknown := sorted(set(sizes) - set(known)):
        raise ConfigError(
            f"model.classifier_sizes has no {', '.join(unknown)}; there are {', '.join(known)}"
        )
    return PhaseSizes(**sizes)  # type: ignore[arg-type]
