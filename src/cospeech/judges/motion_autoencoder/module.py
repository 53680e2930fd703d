"""Training of the motion auto-encoder."""

from __future__ import annotations

from typing import ClassVar, cast

import torch
from lightning import LightningModule
from torch import Tensor

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.facts import CorpusFacts
from cospeech.corpus.windows import WindowSpec
from cospeech.metrics.encoder import GestureEncoder, PoseAutoencoder
from cospeech.motion.codecs import DirectionVectorCodec
from cospeech.motion.upper_body import EVALUATION_FPS, EVALUATION_FRAMES, EVALUATION_STRIDE

LEARNING_RATE = 5e-4
"""As published (docs/facts/trimodal.md, section 2.4)."""


class MotionAutoencoder(LightningModule):
    """Auto-encoder of real motion, trained to be a feature extractor (Yoon et al. 2020, 5.1).

    It generates nothing, so it is not a `GestureMethod`; `encoder` hands over the result. The best
    epoch is the one with the lowest mean L1 reconstruction error on the validation split
    (docs/facts/trimodal.md, section 2.5).

    Args:
        corpus: Facts of the corpus; the mean direction and the bone lengths are used.
        learning_rate: Of Adam, whose betas are 0.5 and 0.999.
    """

    window: ClassVar[WindowSpec] = WindowSpec(
        fps=EVALUATION_FPS, frames=EVALUATION_FRAMES, seed_frames=0, stride=EVALUATION_STRIDE
    )
    needs: ClassVar[frozenset[str]] = frozenset({"positions"})
    monitor: ClassVar[str] = "val/reconstruction"

    def __init__(self, corpus: CorpusFacts, learning_rate: float = LEARNING_RATE) -> None:
        super().__init__()
        self.save_hyperparameters()
        self.learning_rate = learning_rate
        self.codec = DirectionVectorCodec(corpus["mean_direction"], corpus["bone_lengths"])
        self.network = PoseAutoencoder(self.window.frames)

    def forward(self, positions: Tensor) -> Tensor:
        """Positions ``(B, 34, 10, 3)`` encoded and decoded: features ``(B, 34, 27)``."""
        reconstruction: Tensor = self.network(self.codec.encode(positions))
        return reconstruction

    def training_step(self, batch: GestureBatch, batch_idx: int) -> Tensor:
        """Loss of one batch of positions."""
        features = self.codec.encode(batch.require("positions"))
        loss = reconstruction_loss(self.network(features), features)
        self.log("train/loss", loss, on_step=False, on_epoch=True, batch_size=len(batch))
        return loss

    def validation_step(self, batch: GestureBatch, batch_idx: int) -> None:
        """Mean L1 reconstruction error, without the difference term."""
        features = self.codec.encode(batch.require("positions"))
        error = (self.network(features) - features).abs().mean()
        self.log(self.monitor, error, batch_size=len(batch), sync_dist=True)

    def configure_optimizers(self) -> torch.optim.Optimizer:
        """Adam with the published betas (docs/facts/trimodal.md, section 2.4)."""
        return torch.optim.Adam(
            self.network.parameters(), lr=self.learning_rate, betas=(0.5, 0.999)
        )

    @property
    def is_usual(self) -> bool:
        """Whether it is trained as published, like the encoders that runs train by themselves."""
        return self.learning_rate == LEARNING_RATE

    def encoder(self, source: str = "motion_autoencoder") -> GestureEncoder:
        """The trained encoder, frozen, on the CPU; further training doesn't change it.

        Args:
            source: Where it was trained, for people.
        """
        mean_direction = cast(Tensor, self.codec.mean_direction)
        axes = cast(Tensor, self.codec.axes).tolist()
        return GestureEncoder(self.network, mean_direction, axes, source).cpu()


def reconstruction_loss(reconstruction: Tensor, features: Tensor) -> Tensor:
    """Mean L1 plus mean L1 of frame differences, summed over the batch.

    See docs/facts/trimodal.md, section 2.4.

    The sum is as published: the size of a gradient step depends on the batch size.

    Args:
        reconstruction: ``(B, T, 27)``.
        features: The same shape.

    Returns:
        Scalar.
    """
    error = reconstruction - features
    per_window = error.abs().mean((1, 2)) + torch.diff(error, dim=1).abs().mean((1, 2))
    return per_window.sum()
