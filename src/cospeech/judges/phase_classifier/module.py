"""Training of the gesture phase classifier."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Literal

import torch
from lightning import LightningModule
from torch import Tensor
from torchmetrics import ConfusionMatrix

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.facts import CorpusFacts
from cospeech.corpus.validation_pieces import PIECE_S, PIECES, Pieces
from cospeech.corpus.window_loader import WindowLoader
from cospeech.corpus.windows import ServesWindows, WindowSpec
from cospeech.errors import ConfigError
from cospeech.judges.phase_classifier.augmentation import cut_at_random, mirrored, random_sizes
from cospeech.judges.phase_classifier.confusion_picture import show_confusion, write_confusion
from cospeech.judges.phase_classifier.frozen import (
    WINDOW_FRAMES,
    WRIST_ROLES,
    FrozenPhaseClassifier,
    JointSet,
)
from cospeech.judges.phase_classifier.network import (
    STEP_FPS,
    STROKE_SIZES,
    PhaseFeatures,
    PhaseNetwork,
    PhaseSizes,
)
from cospeech.judges.phase_classifier.scores import PhaseScores
from cospeech.motion.gesture_joints import gesture_joints
from cospeech.motion.phases import PHASE_MERGES
from cospeech.motion.skeleton import Skeleton
from cospeech.speech.feature_sets.opensmile import COEFFICIENTS

Protocol = Literal["split", "pieces"]

FILE = "phase_classifier.pt"
"""The frozen classifier of the best epoch so far, in the run's folder."""

_STATISTICS_RUNS = 256

logger = logging.getLogger(__name__)


class PhaseClassifier(LightningModule):
    """Tells gesture phases from the joints' velocities (Ferstl et al. 2020, section 4).

    See docs/facts/multi_adversary.md, section 4.

    It generates nothing, so it is not a `GestureMethod`. Whenever validation improves, `frozen` is
    written into the run's folder as ``phase_classifier.pt``.

    Args:
        corpus: Facts of the corpus; the skeleton is used.
        classes: Name of the classes in `PHASE_MERGES`.
        pitch: Whether the pitch is an input, which needs audio.
        joints: ``"arms"`` or ``"wrists"``, see `cospeech.judges.phase_classifier.frozen.JointSet`.
        speeds: Whether the joints' speeds are inputs too.
        smooth: Whether positions pass a low-pass first; for noisy ones.
        mirror: Whether half of the training windows are seen in a mirror; for small corpora.
        size_jitter: Training windows are made larger or smaller by a random factor, uniform in its
            logarithm up to this; for small corpora.
        run: Neighbouring windows that training windows are cut from, at random places. 1: windows
            begin every 2.5 s.
        protocol: ``"split"``: the store's validation split. ``"pieces"``: random pieces of the
            training and validation recordings validate (the paper's).
        pieces: How many.
        piece_s: Length of each, s.
        pieces_seed: Seed of their places, apart from the run's.
        dense: Units of the dense layer; None for ours, which depend on the number of classes.
        recurrent: Units of the forward LSTM; None for ours.
        bidirectional: Units per direction of the second LSTM; None for ours.
        dense_dropout: Dropout after the dense layer.
        recurrent_dropout: Dropout after each LSTM.
        learning_rate: Of Adam.
        clip_norm: Largest norm of the gradient.

    Raises:
        ConfigError: A choice that there isn't.
        CospeechError: The skeleton lacks the joints.
    """

    window: WindowSpec = WindowSpec(
        STEP_FPS, WINDOW_FRAMES, seed_frames=0, stride=WINDOW_FRAMES, interleaved=True
    )
    needs: frozenset[str] = frozenset({"phases"})

    best_weighted_f: Tensor
    class_of: Tensor

    def __init__(
        self,
        corpus: CorpusFacts,
        classes: str = "four",
        pitch: bool = True,
        joints: JointSet = "arms",
        speeds: bool = False,
        smooth: bool = False,
        mirror: bool = False,
        size_jitter: float = 0.0,
        run: int = 2,
        protocol: Protocol = "split",
        pieces: int = PIECES,
        piece_s: float = PIECE_S,
        pieces_seed: int = 0,
        dense: int | None = None,
        recurrent: int | None = None,
        bidirectional: int | None = None,
        dense_dropout: float = 0.3,
        recurrent_dropout: float = 0.4,
        learning_rate: float = 1e-3,
        clip_norm: float = 1.0,
    ) -> None:
        super().__init__()
        self.save_hyperparameters()
        _check("classes", classes, tuple(PHASE_MERGES))
        _check("joints", joints, ("arms", "wrists"))
        _check("protocol", protocol, ("split", "pieces"))
        self.merge = PHASE_MERGES[classes]
        self.joint_set: JointSet = joints
        self.mirror, self.size_jitter = mirror, size_jitter
        self.learning_rate, self.clip_norm = learning_rate, clip_norm
        stride = WINDOW_FRAMES if run > 1 else WINDOW_FRAMES // 2
        of_pieces = Pieces(pieces, piece_s, pieces_seed) if protocol == "pieces" else None
        self.window = replace(self.window, stride=stride, run=run, pieces=of_pieces)
        self.seen = "wrists" if joints == "wrists" else "joints"
        self.needs = self.needs | {self.seen} | ({"acoustics"} if pitch else set())
        self.roles, self.joint_indices = _roles(corpus, joints)
        self.register_buffer("class_of", torch.tensor(self.merge.class_of))
        self.register_buffer("best_weighted_f", torch.tensor(-1.0))
        ours = STROKE_SIZES if len(self.merge.classes) == 2 else PhaseSizes()
        sizes = PhaseSizes(
            dense or ours.dense,
            recurrent or ours.recurrent,
            bidirectional or ours.bidirectional,
            dense_dropout,
            recurrent_dropout,
        )
        self.features = PhaseFeatures(len(self.roles), pitch, speeds, smooth)
        self.network = PhaseNetwork(self.features.channels, len(self.merge.classes), sizes)
        self.confusion = ConfusionMatrix("multiclass", num_classes=len(self.merge.classes))

    def forward(self, joints: Tensor, pitch: Tensor | None = None) -> Tensor:
        """Scores ``(B, T - 1, classes)`` of ``(B, T, J, 3)`` metres and ``(B, T)`` Hz."""
        scores: Tensor = self.network(self.features(joints, pitch))
        return scores

    def on_train_start(self) -> None:
        """Take the statistics of the training part, once."""
        if self.features.fitted:
            return
        loader = self.trainer.train_dataloader
        assert isinstance(loader, WindowLoader)
        self.features.fit(self._statistics_windows(loader.dataset))
        logger.info("statistics of %d steps", int(self.features.steps))

    def training_step(self, batch: GestureBatch, batch_idx: int) -> Tensor:
        """Cross entropy of one batch."""
        joints, pitch = self._inputs(batch)
        phases = batch.require("phases")
        joints, pitch, phases = cut_at_random(joints, pitch, phases, self.window)
        if self.mirror:
            chosen = torch.rand(len(joints), 1, 1, 1, device=self.device) < 0.5
            joints = torch.where(chosen, mirrored(joints, self.roles), joints)
        if self.size_jitter:
            joints = joints * random_sizes(joints, self.size_jitter)
        loss = self.network.loss(self(joints, pitch), self.class_of[phases[:, 1:]])
        self.log("train/loss", loss, on_step=False, on_epoch=True, batch_size=len(joints))
        return loss

    def on_validation_epoch_start(self) -> None:
        """Count anew."""
        self.confusion.reset()

    def validation_step(self, batch: GestureBatch, batch_idx: int) -> None:
        """Count what was told right."""
        joints, pitch = self._inputs(batch)
        labels = self.class_of[batch.require("phases")[:, 1:]]
        scores = self(joints, pitch)
        self.confusion.update(self.network.probabilities(scores).argmax(-1), labels)

    def on_validation_epoch_end(self) -> None:
        """Log the scores; keep the classifier if they are the best so far."""
        scores = self._log_scores("val")
        if self.trainer.sanity_checking or scores.weighted_f <= float(self.best_weighted_f):
            return
        self.best_weighted_f.fill_(scores.weighted_f)
        if self.trainer.is_global_zero:
            self.frozen().save(Path(self.trainer.default_root_dir) / FILE)

    def on_test_epoch_start(self) -> None:
        """As for validation."""
        self.confusion.reset()

    def test_step(self, batch: GestureBatch, batch_idx: int) -> None:
        """As for validation."""
        self.validation_step(batch, batch_idx)

    def on_test_epoch_end(self) -> None:
        """Log the scores."""
        scores = self._log_scores("test")
        logger.info("test windows:\n%s", scores.table(self.merge.classes))

    def configure_optimizers(self) -> torch.optim.Optimizer:
        """Adam."""
        return torch.optim.Adam(self.network.parameters(), lr=self.learning_rate)

    def configure_gradient_clipping(
        self,
        optimizer: torch.optim.Optimizer,
        gradient_clip_val: float | None = None,
        gradient_clip_algorithm: str | None = None,
    ) -> None:
        """By the norm of all gradients together."""
        self.clip_gradients(optimizer, self.clip_norm, "norm")

    def frozen(self) -> FrozenPhaseClassifier:
        """The classifier as it is now, on the CPU; further training doesn't change it."""
        return FrozenPhaseClassifier(
            self.network, self.features, self.merge.name, self.joint_set, self.roles
        ).cpu()

    def _inputs(self, batch: GestureBatch) -> tuple[Tensor, Tensor | None]:
        joints = batch.require(self.seen)[..., self.joint_indices, :]
        pitch = batch.require("acoustics")[..., COEFFICIENTS] if self.features.pitch else None
        return joints, pitch

    def _statistics_windows(self, dataset: ServesWindows) -> Iterator[tuple[Tensor, Tensor | None]]:
        for first in range(0, len(dataset), _STATISTICS_RUNS):
            rows = range(first, min(first + _STATISTICS_RUNS, len(dataset)))
            joints, pitch = self._inputs(dataset.batch(rows).to(self.device))
            yield joints, pitch
            if self.mirror:
                yield mirrored(joints, self.roles), pitch

    def _log_scores(self, stage: str) -> PhaseScores:
        confusion = self.confusion.compute().cpu().numpy()
        scores = PhaseScores.of(confusion)
        values = {
            "weighted_f": scores.weighted_f,
            "one_minus_weighted_f": 1 - scores.weighted_f,
            "macro_f": scores.macro_f,
            "accuracy": scores.accuracy,
            "majority_accuracy": scores.majority,
            "majority_weighted_f": scores.majority_weighted_f,
        }
        values |= {
            f"f_{name}": float(f)
            for name, f, there in zip(self.merge.classes, scores.f, confusion.sum(1), strict=True)
            if there
        }
        # The matrix was summed over all processes: each logs the same.
        self.log_dict({f"{stage}/{name}": value for name, value in values.items()})
        if self.trainer.is_global_zero and not self.trainer.sanity_checking:
            epoch = self.current_epoch
            title = f"{stage}, epoch {epoch}: weighted F {scores.weighted_f:.3f}"
            path = Path(self.trainer.default_root_dir) / f"confusion_{stage}.svg"
            write_confusion(path, confusion, self.merge.classes, title)
            show_confusion(self.loggers, f"{stage}/confusion", confusion, epoch)
        return scores


def _roles(corpus: CorpusFacts, joints: JointSet) -> tuple[tuple[str, ...], list[int]]:
    """Names of the joints, and where they are among those served."""
    if joints == "wrists":
        return WRIST_ROLES, [0, 1]
    layout = gesture_joints(Skeleton.from_dict(corpus["skeleton"]))
    return tuple(layout.roles[i] for i in layout.arms), list(layout.arms)


def _check(name: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise ConfigError(f"model.{name}={value}: choose one of {', '.join(known)}")
