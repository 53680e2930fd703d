"""The frozen encoder behind every Fréchet gesture distance."""

from __future__ import annotations

import copy
import hashlib
from collections.abc import Sequence
from typing import Self

import torch
from torch import Tensor, nn

from cospeech.metrics.encoder.network import FEATURE_SIZE, POSE_SIZE, PoseAutoencoder
from cospeech.motion.codecs import direction_vectors


class GestureEncoder(nn.Module):
    """Windows of motion to 32-d features, by a trained auto-encoder that no longer changes.

    It keeps a copy of the network in evaluation mode with gradients switched off, whatever mode
    the module around it is put in. Features of different encoders are not comparable; `sha256`
    says which one a number was taken with.

    Args:
        network: The trained auto-encoder.
        mean_direction: 27 numbers subtracted from the direction vectors, in the encoder's axes.
        axes: Sign per axis from house axes to the encoder's (`TED_AXES` for published weights).
        source: Where the weights come from, for people; not part of the hash.
    """

    size = FEATURE_SIZE
    mean_direction: Tensor
    axes: Tensor

    def __init__(
        self,
        network: PoseAutoencoder,
        mean_direction: Sequence[float] | Tensor,
        axes: Sequence[float] = (1.0, 1.0, 1.0),
        source: str = "",
    ) -> None:
        super().__init__()
        mean = torch.as_tensor(mean_direction, dtype=torch.float32).detach().clone()
        if mean.shape != (POSE_SIZE,) or not mean.isfinite().all():
            raise ValueError(f"expected {POSE_SIZE} finite mean values, got {tuple(mean.shape)}")
        if sorted(abs(sign) for sign in axes) != [1, 1, 1]:
            raise ValueError(f"axes must be three signs, got {tuple(axes)}")
        self.network = copy.deepcopy(network)
        self.register_buffer("mean_direction", mean)
        self.register_buffer("axes", torch.tensor(axes, dtype=torch.float32))
        self.frames = network.frames
        self.source = source
        self.requires_grad_(False)
        self.train(False)

    def train(self, mode: bool = True) -> Self:
        """Stay in evaluation mode: batch statistics would change the features."""
        return super().train(False)

    @property
    def sha256(self) -> str:
        """Hash over all weights, the mean and the axes; equal hashes mean equal features."""
        digest = hashlib.sha256()
        for name, tensor in sorted(self.state_dict().items()):
            if not name.endswith("num_batches_tracked"):
                values = tensor.detach().to("cpu", torch.float32).contiguous().numpy()
                digest.update(f"{name}{tuple(tensor.shape)}".encode())
                digest.update(values.astype("<f4").tobytes())
        return digest.hexdigest()

    def to_features(self, positions: Tensor) -> Tensor:
        """Positions ``(..., 10, 3)`` in house axes to the network's input ``(..., 27)``."""
        directions = direction_vectors(positions.float()) * self.axes
        return directions.flatten(-2) - self.mean_direction

    def forward(self, features: Tensor) -> Tensor:
        """Latent means ``(B, 32)`` of mean-subtracted direction vectors ``(B, T, 27)``.

        Computed in float32 even inside autocast, so that a run's precision doesn't move its FGD.

        Raises:
            ValueError: Windows of another length or width than the encoder was trained on.
        """
        self._require_windows(features)
        with torch.autocast(features.device.type, enabled=False):
            return self.network.encode(features.float())

    def encode_positions(self, positions: Tensor) -> Tensor:
        """Latent means ``(B, 32)`` of root-relative windows ``(B, T, 10, 3)`` in house axes.

        Bone lengths don't matter: only the bones' directions are encoded.

        Raises:
            ValueError: As `forward`, or a coordinate is NaN or infinite.
        """
        finite = positions.isfinite().flatten(1).all(1)
        if not finite.all():
            first = int(finite.logical_not().nonzero()[0])
            raise ValueError(
                f"window {first} of the batch has a coordinate that is NaN or infinite"
            )
        latent: Tensor = self(self.to_features(positions))
        return latent

    @torch.no_grad()
    def encode_all(self, positions: Tensor, batch_size: int = 512) -> Tensor:
        """Latent means ``(n, 32)``, on the CPU, of any number of windows, batch by batch.

        Raises:
            ValueError: As `encode_positions`.
        """
        device = self.mean_direction.device
        batches = positions.split(batch_size)
        return torch.cat([self.encode_positions(batch.to(device)).cpu() for batch in batches])

    def _require_windows(self, features: Tensor) -> None:
        if features.ndim != 3 or features.shape[1:] != (self.frames, POSE_SIZE):
            raise ValueError(
                f"this encoder takes windows of {self.frames} frames x {POSE_SIZE} numbers, got"
                f" {tuple(features.shape)}"
            )
