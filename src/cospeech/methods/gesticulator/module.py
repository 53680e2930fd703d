"""Gestures from what is said and how it is said (Kucherenko et al. 2020)."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any, ClassVar, cast, get_args

import torch
from lightning.pytorch.core.optimizer import LightningOptimizer
from torch import Tensor

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.facts import CorpusFacts
from cospeech.corpus.features.positions import at_evaluation_rate
from cospeech.corpus.features.streaming import open_rows
from cospeech.corpus.window_loader import WindowLoader
from cospeech.corpus.windows import WindowDataset, WindowSpec
from cospeech.errors import ConfigError, InputFileError, require_choice, require_range
from cospeech.methods.base import GestureMethod
from cospeech.methods.gesticulator.inputs import OF_A_RUN, Audio, Text, speech_inputs
from cospeech.methods.gesticulator.joints import JOINTS, joints_of
from cospeech.methods.gesticulator.losses import VelocityAxis, pose_loss, velocity_loss
from cospeech.methods.gesticulator.networks import (
    AHEAD,
    HISTORY,
    PAST,
    Conditioning,
    GesticulatorNetwork,
    Initialisation,
)
from cospeech.methods.gesticulator.schedule import EPOCHS_WITHOUT, Schedule, history_of_epoch
from cospeech.methods.gesticulator.synthesis import PoseByPose
from cospeech.methods.streams import Stream
from cospeech.motion.codecs import ExponentialMapCodec, PrincipalComponentCodec
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import to_upper_body
from cospeech.nn.modes import evaluating
from cospeech.training.losses import WeighedLosses
from cospeech.training.steps import descend, log_losses

logger = logging.getLogger(__name__)

FPS = 20.0
_TRAINED_FRAMES, _JUDGED_FRAMES = 40, 100
_TEXT_VERSION = "text_version"


class Gesticulator(GestureMethod):
    """Rotations of 15 joints from acoustics and text around a frame and the three poses before it.

    Defaults are the published code's, quirks included, but for what the paper says of the schedule
    and the velocity (the README lists all).

    Reads positions, rotations, and of speech what ``audio`` and ``text`` choose. Logs, unweighted,
    ``train/pose``, ``train/velocity`` and the weighted sum ``train/loss``.

    Args:
        corpus: Skeleton and speakers of the training corpus.
        audio: ``"spectrogram"`` (64 log-mel bands), ``"mfcc"`` (26 cepstra), ``"prosody"`` (energy,
            pitch and how they change), ``"mfcc_prosody"``, ``"spectrogram_prosody"`` or ``"none"``.
        text: ``"contextual"`` vectors of a language model, ``"static"`` ones of a fastText file, or
            ``"none"``.
        language_model: Folder or hub name of a `transformers` encoder for contextual vectors, such
            as ``bert-base-cased``, which was published; None: the packaged MiniLM.
        special_tokens: Give sentences to the language model with its start and end tokens; the
            published code takes them away.
        word_vectors: fastText file for static vectors.
        pca: Poses are so many principal components of the training poses; None: the rotations
            themselves. The paper's 12 keep 95 % of its variance.
        conditioning: ``"film"``, ``"concatenation"`` or ``"none"`` (`GesticulatorNetwork`).
        schedule: ``"paper"``, ``"released"``, ``"forced"`` or ``"own"`` (`history_of_epoch`).
        epochs_without_history: First epochs that don't look at earlier poses.
        velocity_weight: Weight of the velocity loss.
        velocity_axis: ``"time"``, or ``"batch"`` as the code did when the paper was written.
        dropout: Of every layer but the conditioning.
        conditioning_dropout: Of the conditioning.
        mask_per_window: In training, dropout hides other units of a frame in every window it is in,
            as published, at 17 times the cost.
        conditioning_tanh: A tanh after the conditioning, as published.
        head_layer: A further layer before the last, as published.
        initialisation: ``"fan_product"`` as published, or ``"he"``.
        standardise_speech: Standardise what is heard and read by the training speech.
        published_hop: Spectrogram frames of 1102 samples, which drift against motion, as published.
        published_timing: Text at 10 frames per second in tenths of a second, as published.
        learning_rate: Adam's.

    Raises:
        ConfigError: A value that is not among the choices or out of range, neither audio nor text,
            or static text without a file.
    """

    window = WindowSpec(
        fps=FPS,
        frames=HISTORY - 1 + _TRAINED_FRAMES,
        seed_frames=0,
        stride=10,
        past=PAST,
        ahead=AHEAD,
        judged_frames=_JUDGED_FRAMES,
    )
    needs: ClassVar[frozenset[str]] = frozenset({"positions", "rotations"})

    def __init__(
        self,
        corpus: CorpusFacts,
        audio: Audio = "spectrogram",
        text: Text = "contextual",
        language_model: str | None = None,
        special_tokens: bool = False,
        word_vectors: str | None = None,
        pca: int | None = None,
        conditioning: Conditioning = "film",
        schedule: Schedule = "paper",
        epochs_without_history: int = EPOCHS_WITHOUT,
        velocity_weight: float = 0.6,
        velocity_axis: VelocityAxis = "time",
        dropout: float = 0.2,
        conditioning_dropout: float = 0.8,
        mask_per_window: bool = False,
        conditioning_tanh: bool = True,
        head_layer: bool = True,
        initialisation: Initialisation = "fan_product",
        standardise_speech: bool = False,
        published_hop: bool = True,
        published_timing: bool = True,
        learning_rate: float = 1e-4,
    ) -> None:
        super().__init__()
        require_choice("model.schedule", schedule, get_args(Schedule))
        require_choice("model.velocity_axis", velocity_axis, get_args(VelocityAxis))
        require_range("model.epochs_without_history", epochs_without_history, 0)
        require_range("model.velocity_weight", velocity_weight, 0)
        require_range("model.learning_rate", learning_rate, 0)
        require_range("model.dropout", dropout, 0, 1)
        require_range("model.conditioning_dropout", conditioning_dropout, 0, 1)
        self.save_hyperparameters(logger=False)
        self.speakers = list(corpus["speakers"])
        self.schedule, self.epochs_without_history = schedule, epochs_without_history
        self.velocity_weight, self.velocity_axis = velocity_weight, velocity_axis
        self.mask_per_window, self.learning_rate = mask_per_window, learning_rate
        inputs = speech_inputs(
            audio,
            text,
            language_model,
            special_tokens,
            word_vectors,
            published_hop,
            published_timing,
            corpus["words"],
        )
        self.fields, self.text_version = inputs.fields, inputs.text_version
        self.window = replace(self.window, own_fields=self.fields)
        self.needs = self.needs | {field.name for field in self.fields}  # type: ignore[misc]
        self.register_buffer("silence", torch.from_numpy(inputs.silence), persistent=False)
        self.codec = _codec(Skeleton.from_dict(corpus["skeleton"]), pca)
        self.register_buffer("mean_pose", torch.zeros(self.codec.size))
        self.network = GesticulatorNetwork(
            len(cast(Tensor, self.silence)),
            self.codec.size,
            conditioning,
            dropout,
            conditioning_dropout,
            conditioning_tanh,
            head_layer,
            initialisation,
            standardise_speech,
        )

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Add which vectors of words it learns from."""
        checkpoint[_TEXT_VERSION] = self.text_version

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Refuse weights that were trained with other vectors of words than are there now.

        Raises:
            InputFileError: They were.
        """
        known = checkpoint.get(_TEXT_VERSION)
        if known not in (None, self.text_version):
            chosen = "word_vectors" if self.hparams["text"] == "static" else "language_model"
            raise InputFileError(
                self.hparams[chosen] or "the packaged language model",
                "isn't the same any more: text has other vectors now than in training"
                f" ({self.text_version}, not {known!s:.60})",
                hint=OF_A_RUN.format(chosen),
            )

    def on_train_start(self) -> None:
        """Take the mean pose of the training motion, which motion begins from, and the scales."""
        lacking = [name for name, own in zip(JOINTS, self.codec.joints, strict=True) if own is None]
        if lacking:
            told = self.codec.skeleton.name, len(JOINTS) - len(lacking), ", ".join(lacking)
            logger.info("skeleton %s: %d joints are made; it has nothing like %s", *told)
        loader = self.trainer.train_dataloader
        assert isinstance(loader, WindowLoader)
        assert isinstance(loader.dataset, WindowDataset)
        if self.network.standardised is not None:
            first, tracks = 0, loader.dataset.tracks
            for field in self.fields:
                sequences = (tracks.values(field.name, i) for i in range(len(tracks)))
                self.network.standardised.fit(first, sequences)
                first += field.width or 0
        rotations = torch.from_numpy(loader.dataset.every_frame("rotations")).to(self.device)
        self.codec.fit(rotations)
        cast(Tensor, self.mean_pose).copy_(self.codec.encode(rotations).mean(dim=0))
        if isinstance(self.codec, PrincipalComponentCodec):
            logger.info(
                "%d principal components keep %.1f %% of the training poses' variance",
                self.codec.size,
                100 * self.codec.variance_kept,
            )

    def configure_optimizers(self) -> torch.optim.Optimizer:
        """Adam."""
        return torch.optim.Adam(self.network.parameters(), self.learning_rate)

    def training_step(self, batch: GestureBatch, batch_idx: int) -> dict[str, Tensor]:
        """One step with the epoch's history."""
        truth = self.codec.encode(batch.require("rotations"))
        known = HISTORY - 1
        speech = self._speech(batch)[:, known:]
        frames = truth.shape[1] - known
        history = history_of_epoch(
            self.current_epoch, self.schedule, PAST, frames, self.epochs_without_history
        )
        said = self.network.encode(speech, self.mask_per_window)
        poses = self.network.roll(
            said, self._start(len(truth)), truth, history.is_reset, history.is_conditioned
        )
        losses = WeighedLosses()
        losses.add("pose", 1.0, pose_loss, poses, truth[:, known:])
        losses.add(
            "velocity",
            self.velocity_weight,
            velocity_loss,
            poses,
            truth[:, known:],
            self.velocity_axis,
        )
        assert losses.total is not None
        descend(self, cast(LightningOptimizer, self.optimizers()), losses.total)
        return log_losses(self, {"loss": losses.total, **losses.values}, len(batch))

    def _speech(self, batch: GestureBatch) -> Tensor:
        return torch.cat([batch.require(field.name) for field in self.fields], dim=-1)

    def _start(self, count: int) -> Tensor:
        return cast(Tensor, self.mean_pose).expand(count, HISTORY, -1)

    @torch.no_grad()
    def sample(self, batch: GestureBatch, generator: torch.Generator) -> Tensor:
        """One window per item, from the mean pose on and on its own poses alone.

        There is nothing random about it.
        """
        with evaluating(self.network):
            poses = self.network.roll(
                self.network.encode(self._speech(batch)), self._start(len(batch))
            )
        motion = self.codec.motion(poses.flatten(0, 1), self.window.fps)
        positions = torch.from_numpy(to_upper_body(motion).positions).to(self.device)
        return at_evaluation_rate(positions.unflatten(0, poses.shape[:2]), self.window.fps)

    def begin(
        self,
        speaker: str | None,
        controls: Any,
        seed_motion: Motion | None,
        generator: torch.Generator,
    ) -> Stream:
        """Begin rotations of the training skeleton at 20 fps.

        Joints that aren't made keep their mean rotation, and the root stays where it is.
        """
        fps = self.window.fps
        inputs = [open_rows(field, fps) for field in self.fields]
        quiet = cast(Tensor, self.silence)
        return PoseByPose(self.network, inputs, quiet, self._start(1), self._motion, fps)

    def _motion(self, poses: Tensor) -> Motion:
        return self.codec.motion(poses, self.window.fps)


def _codec(skeleton: Skeleton, pca: int | None) -> ExponentialMapCodec | PrincipalComponentCodec:
    rotations = ExponentialMapCodec(skeleton, joints_of(skeleton))
    if pca is None:
        return rotations
    if pca != int(pca):
        raise ConfigError(
            f"model.pca={pca} is no number of components",
            f"give a whole number from 1 to {rotations.size}; a run says what of the variance it"
            " keeps",
        )
    require_range("model.pca", pca, 1, rotations.size)
    return PrincipalComponentCodec(rotations, int(pca))
