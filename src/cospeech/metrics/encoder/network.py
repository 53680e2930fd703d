"""The motion auto-encoder whose latent space Fréchet gesture distances are measured in."""

from __future__ import annotations

from collections.abc import Mapping

from torch import Tensor, nn

POSE_SIZE = 27
"""Nine direction vectors of three numbers."""
FEATURE_SIZE = 32
"""Numbers in a feature: the latent mean."""


def flattened_size(frames: int) -> int:
    """Numbers that the convolutions leave of a window: 384 for 34 frames, 800 for 60."""
    return 32 * ((frames - 4 - 4) // 2 + 1 - 2)


class PoseAutoencoder(nn.Module):
    """Convolutional auto-encoder of Yoon et al. 2020, appendix A, without sampling.

    See docs/facts/trimodal.md, section 1.9.

    Tensor names are the published ones. Where the published code meant a leaky ReLU in the dense
    layers it has the identity, and so have we: published weights mean something only that way.

    Args:
        frames: Frames per window, at least 12.
        decoder_width: Width of the decoder's first layer: 64 in the published 34-frame net, 128 in
            the 60-frame one.
    """

    def __init__(self, frames: int = 34, decoder_width: int = 64) -> None:
        super().__init__()
        if frames < 12:
            raise ValueError(f"the convolutions need windows of 12 frames or more, got {frames}")
        self.frames = frames
        self.decoder_width = decoder_width
        self.pose_encoder = _Encoder(frames)
        self.decoder = _Decoder(frames, decoder_width)

    def encode(self, features: Tensor) -> Tensor:
        """Mean-subtracted direction vectors ``(B, T, 27)`` to latent means ``(B, 32)``."""
        latent: Tensor = self.pose_encoder(features)
        return latent

    def forward(self, features: Tensor) -> Tensor:
        """Mean-subtracted direction vectors ``(B, T, 27)``, encoded and decoded again."""
        reconstruction: Tensor = self.decoder(self.pose_encoder(features))
        return reconstruction

    @staticmethod
    def frames_of(state: Mapping[str, Tensor]) -> int:
        """Frames per window of the network that a state dict was saved from.

        Raises:
            KeyError: The sizing tensor is missing.
        """
        return state["decoder.pre_net.3.weight"].shape[0] // 4

    @classmethod
    def sized_like(cls, state: Mapping[str, Tensor]) -> PoseAutoencoder:
        """An untrained network of the size that a state dict was saved from.

        Raises:
            KeyError: The sizing tensors are missing.
        """
        decoder_width = state["decoder.pre_net.0.weight"].shape[0]
        return cls(cls.frames_of(state), decoder_width)


def _convolution(size_in: int, size_out: int, kernel: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv1d(size_in, size_out, kernel, stride), nn.BatchNorm1d(size_out), nn.LeakyReLU(0.2)
    )


class _Encoder(nn.Module):
    def __init__(self, frames: int) -> None:
        super().__init__()
        self.net = nn.Sequential(
            _convolution(POSE_SIZE, 32, 3),
            _convolution(32, 64, 3),
            _convolution(64, 64, 4, stride=2),
            nn.Conv1d(64, 32, 3),
        )
        self.out_net = nn.Sequential(
            nn.Linear(flattened_size(frames), 256),
            nn.BatchNorm1d(256),
            nn.Identity(),
            nn.Linear(256, 128),
            nn.BatchNorm1d(128),
            nn.Identity(),
            nn.Linear(128, FEATURE_SIZE),
        )
        self.fc_mu = nn.Linear(FEATURE_SIZE, FEATURE_SIZE)
        # Never trained and never read, but part of every published file.
        self.fc_logvar = nn.Linear(FEATURE_SIZE, FEATURE_SIZE)

    def forward(self, features: Tensor) -> Tensor:
        hidden = self.net(features.transpose(1, 2)).flatten(1)
        latent: Tensor = self.fc_mu(self.out_net(hidden))
        return latent


class _Decoder(nn.Module):
    def __init__(self, frames: int, width: int) -> None:
        super().__init__()
        self.pre_net = nn.Sequential(
            nn.Linear(FEATURE_SIZE, width),
            nn.BatchNorm1d(width),
            nn.Identity(),
            nn.Linear(width, 4 * frames),
        )
        self.net = nn.Sequential(
            nn.ConvTranspose1d(4, 32, 3),
            nn.BatchNorm1d(32),
            nn.LeakyReLU(0.2),
            nn.ConvTranspose1d(32, 32, 3),
            nn.BatchNorm1d(32),
            nn.LeakyReLU(0.2),
            nn.Conv1d(32, 32, 3),
            nn.Conv1d(32, POSE_SIZE, 3),
        )

    def forward(self, latent: Tensor) -> Tensor:
        hidden = self.pre_net(latent)
        reconstruction: Tensor = self.net(hidden.unflatten(1, (4, -1))).transpose(1, 2)
        return reconstruction
