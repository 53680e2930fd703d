"""Generator and discriminator (Yoon et al. 2020, sections 3.2-3.4).

See docs/facts/trimodal.md, sections 1.3 to 1.5.

Tensor names, shapes and order are the published ones, so published weights load as they are.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, cast

import torch
from torch import Tensor, nn

from cospeech.methods.trimodal.encoders import AudioEncoder, TextEncoder

Context = Literal["both", "audio", "text"]
"""Which modality reaches the generator."""

Style = Literal["speaker", "random", "none"]
"""Where the style vector comes from: the speaker's distribution, N(0, I), or nowhere."""

POSE_SIZE = 27
CORRECTED_SLOPE = 0.01


class Posterior(NamedTuple):
    """Diagonal normal distribution over styles, each ``(B, style_size)``."""

    mu: Tensor
    logvar: Tensor

    def sample(self, noise: Tensor | None) -> Tensor:
        """``mu + sigma noise``; the mean when ``noise`` is None."""
        return self.mu if noise is None else self.mu + torch.exp(0.5 * self.logvar) * noise


class GeneratorOutput(NamedTuple):
    """What the generator returns.

    Attributes:
        poses: ``(B, T, 27)`` mean-subtracted direction vectors.
        z: ``(B, style_size)`` style used; None without a style input.
        mu: Mean of the speakers' distribution; None unless style comes from the speaker.
        logvar: Its log variance, likewise.
    """

    poses: Tensor
    z: Tensor | None
    mu: Tensor | None
    logvar: Tensor | None


def _head_activation(corrected: bool) -> nn.Module:
    """The published leaky ReLU got slope 1 by mistake, which is the identity.

    See docs/facts/trimodal.md, section 1.0.
    """
    return nn.LeakyReLU(CORRECTED_SLOPE) if corrected else nn.Identity()


class Generator(nn.Module):
    """Speech, seed poses and style to poses: one bidirectional pass over a window.

    Args:
        words: Vocabulary size.
        speakers: Training speakers; ids are 1..speakers and row 0 of the table stays untrained.
        word_size: Numbers per word vector.
        style_size: Numbers per style vector.
        hidden_size: Width of the GRU and of the text convolutions.
        layers: GRU layers and text blocks.
        dropout: Between GRU layers and inside the text blocks.
        embedding_dropout: On the word vectors.
        context: Modalities that reach the GRU. Both encoders exist either way, as published.
        style: Source of the style vector.
        corrected_activations: Leaky ReLU in the output head, where the published code has the
            identity.
    """

    def __init__(
        self,
        words: int,
        speakers: int,
        *,
        word_size: int = 300,
        style_size: int = 16,
        hidden_size: int = 300,
        layers: int = 4,
        dropout: float = 0.3,
        embedding_dropout: float = 0.1,
        context: Context = "both",
        style: Style = "speaker",
        corrected_activations: bool = False,
    ) -> None:
        super().__init__()
        self.context, self.style = context, style
        self.style_size = 0 if style == "none" else style_size
        self.audio_encoder = AudioEncoder()
        self.text_encoder = TextEncoder(
            words, word_size, hidden_size, layers, dropout, embedding_dropout
        )
        if style == "speaker":
            self.speaker_embedding = nn.Sequential(
                nn.Embedding(speakers + 1, style_size), nn.Linear(style_size, style_size)
            )
            self.speaker_mu = nn.Linear(style_size, style_size)
            self.speaker_logvar = nn.Linear(style_size, style_size)
        speech_size = (context != "text") * AudioEncoder.size + (
            context != "audio"
        ) * TextEncoder.size
        self.gru = nn.GRU(
            POSE_SIZE + 1 + speech_size + self.style_size,
            hidden_size,
            layers,
            batch_first=True,
            bidirectional=True,
            dropout=dropout if layers > 1 else 0.0,
        )
        self.out = nn.Sequential(
            nn.Linear(hidden_size, hidden_size // 2),
            _head_activation(corrected_activations),
            nn.Linear(hidden_size // 2, POSE_SIZE),
        )

    def forward(
        self,
        seed_poses: Tensor,
        words: Tensor,
        audio: Tensor,
        speakers: Tensor,
        *,
        style_noise: Tensor | None = None,
    ) -> GeneratorOutput:
        """One window per item.

        Args:
            seed_poses: ``(B, T, 28)``: seed features and 1 in the last channel on seed frames, zero
                elsewhere.
            words: ``(B, T)`` word ids on onset frames.
            audio: ``(B, N)`` waveforms, 16 kHz.
            speakers: ``(B,)`` speaker ids.
            style_noise: ``(B, style_size)`` standard normal draws; None takes the mean style.
        """
        z, posterior = self.draw_style(speakers, style_noise)
        poses = self.decode(seed_poses, self.encode_speech(words, audio), z)
        return GeneratorOutput(
            poses,
            z,
            None if posterior is None else posterior.mu,
            None if posterior is None else posterior.logvar,
        )

    def encode_speech(
        self, words: Tensor, audio: Tensor, extra_vectors: Tensor | None = None
    ) -> Tensor:
        """Features ``(B, T, 64)`` of the modalities in use, audio first (32 for one modality).

        The published code runs the unused encoder too; its result goes nowhere. For
        ``extra_vectors`` see `TextEncoder.forward`.
        """
        features = []
        if self.context != "text":
            features.append(self.audio_encoder(audio))
        if self.context != "audio":
            features.append(self.text_encoder(words, extra_vectors))
        return torch.cat(features, dim=-1)

    def style_posterior(self, speakers: Tensor) -> Posterior:
        """Distribution over styles of each speaker id (docs/facts/trimodal.md, section 1.3)."""
        embedded = self.speaker_embedding(speakers)
        return Posterior(self.speaker_mu(embedded), self.speaker_logvar(embedded))

    def draw_style(
        self, speakers: Tensor, noise: Tensor | None
    ) -> tuple[Tensor | None, Posterior | None]:
        """A style per item, and the speakers' distributions where style comes from them."""
        if self.style == "none":
            return None, None
        if self.style == "random":
            # N(0, I): its mean, should the caller want no noise, is zero.
            shape = (len(speakers), self.style_size)
            return speakers.new_zeros(shape, dtype=torch.float32) if noise is None else noise, None
        posterior = self.style_posterior(speakers)
        return posterior.sample(noise), posterior

    def decode(self, seed_poses: Tensor, speech: Tensor, z: Tensor | None) -> Tensor:
        """Poses ``(B, T, 27)`` from seed input, speech features and style.

        See docs/facts/trimodal.md, section 1.4.
        """
        parts = [seed_poses, speech]
        if z is not None:
            parts.append(z.unsqueeze(1).expand(-1, seed_poses.shape[1], -1))
        hidden, _ = self.gru(torch.cat(parts, dim=-1))
        forward, backward = hidden.chunk(2, dim=-1)
        return cast(Tensor, self.out(forward + backward))


class ConvDiscriminator(nn.Module):
    """Convolutions, a GRU and one probability per window (docs/facts/trimodal.md, section 1.5).

    Args:
        frames: Window length, fixed by the last layer.
        hidden_size: Width of the GRU.
        layers: GRU layers.
        dropout: Between GRU layers.
        corrected_activations: Leaky ReLU after the batch norms, where the published code has the
            identity.
    """

    def __init__(
        self,
        frames: int = 34,
        *,
        hidden_size: int = 64,
        layers: int = 4,
        dropout: float = 0.3,
        corrected_activations: bool = False,
    ) -> None:
        super().__init__()
        self.pre_conv = nn.Sequential(
            nn.Conv1d(POSE_SIZE, 16, 3),
            nn.BatchNorm1d(16),
            _head_activation(corrected_activations),
            nn.Conv1d(16, 8, 3),
            nn.BatchNorm1d(8),
            _head_activation(corrected_activations),
            nn.Conv1d(8, 8, 3),
        )
        self.gru = nn.GRU(
            8,
            hidden_size,
            layers,
            batch_first=True,
            bidirectional=True,
            dropout=dropout if layers > 1 else 0.0,
        )
        self.out = nn.Linear(hidden_size, 1)
        self.out2 = nn.Linear(frames - 6, 1)

    def forward(self, poses: Tensor) -> Tensor:
        """Features ``(B, frames, 27)`` to the probability ``(B, 1)`` that they are human."""
        features = self.pre_conv(poses.transpose(1, 2)).transpose(1, 2)
        forward, backward = self.gru(features)[0].chunk(2, dim=-1)
        per_frame = self.out(forward + backward).squeeze(-1)
        return torch.sigmoid(self.out2(per_frame))
