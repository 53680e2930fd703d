"""Audio and text encoders (Yoon et al. 2020, section 3.2). Tensor names are the published ones."""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

PUBLISHED_MOMENTUM = 0.1
"""How far one pass moves the batch norms' running statistics in the published code."""


class AudioEncoder(nn.Module):
    """Raw waveform to one feature vector per frame (docs/facts/trimodal.md, section 1.1).

    Feature i sees samples ``1080 i - 1600 ... 1080 i + 1424``; 35 465 to 36 544 samples give 34.
    """

    size = 32

    def __init__(self) -> None:
        super().__init__()
        self.feat_extractor = nn.Sequential(
            nn.Conv1d(1, 16, kernel_size=15, stride=5, padding=1600),
            nn.BatchNorm1d(16),
            nn.LeakyReLU(0.3, inplace=True),
            nn.Conv1d(16, 32, kernel_size=15, stride=6),
            nn.BatchNorm1d(32),
            nn.LeakyReLU(0.3, inplace=True),
            nn.Conv1d(32, 64, kernel_size=15, stride=6),
            nn.BatchNorm1d(64),
            nn.LeakyReLU(0.3, inplace=True),
            nn.Conv1d(64, self.size, kernel_size=15, stride=6),
        )

    def forward(self, audio: Tensor) -> Tensor:
        """Waveforms ``(B, N)`` at 16 kHz to features ``(B, frames, 32)``."""
        return cast(Tensor, self.feat_extractor(audio.unsqueeze(1))).transpose(1, 2)

    def count_passes(self, passes: int) -> None:
        """Let one training pass move the running statistics as far as ``passes`` equal ones would.

        ``passes`` updates with the same batch statistics leave ``0.9 ** passes`` of the old value.
        """
        for layer in self.feat_extractor:
            if isinstance(layer, nn.BatchNorm1d):
                layer.momentum = 1 - (1 - PUBLISHED_MOMENTUM) ** passes


class WeightNormConv1d(nn.Module):
    """A causal, weight-normed convolution, ``weight = g v / |v|`` per output channel.

    Parameters are called ``bias``, ``weight_g`` and ``weight_v`` as in published checkpoints.

    Args:
        inputs: Input channels.
        outputs: Output channels.
        kernel: Taps.
        dilation: Frames between taps; output t sees ``t - (kernel - 1) dilation ... t``.
    """

    def __init__(self, inputs: int, outputs: int, kernel: int, dilation: int) -> None:
        super().__init__()
        reference = nn.Conv1d(inputs, outputs, kernel)
        assert reference.bias is not None
        self.bias = nn.Parameter(reference.bias.detach())
        # The published N(0, 0.01) init is overwritten by weight norm's first forward
        # (docs/facts/trimodal.md, section 1.2), so the direction keeps torch's default and the
        # magnitude is its norm.
        direction = reference.weight.detach()
        self.weight_g = nn.Parameter(direction.flatten(1).norm(dim=1).view(-1, 1, 1))
        self.weight_v = nn.Parameter(direction)
        self.dilation = dilation
        self.padding = (kernel - 1) * dilation

    def forward(self, features: Tensor) -> Tensor:
        """``(B, inputs, T)`` to ``(B, outputs, T)``."""
        norm = torch.linalg.vector_norm(self.weight_v, dim=(1, 2), keepdim=True)
        weight = self.weight_v * (self.weight_g / norm)
        padded = functional.pad(features, (self.padding, 0))
        return functional.conv1d(padded, weight, self.bias, dilation=self.dilation)


class TemporalBlock(nn.Module):
    """Two causal convolutions, each with ReLU and dropout, around a residual.

    See docs/facts/trimodal.md, section 1.2.
    """

    def __init__(
        self, inputs: int, outputs: int, kernel: int, dilation: int, dropout: float
    ) -> None:
        super().__init__()
        self.conv1 = WeightNormConv1d(inputs, outputs, kernel, dilation)
        self.conv2 = WeightNormConv1d(outputs, outputs, kernel, dilation)
        # Published checkpoints name each convolution twice, by itself and by its place in `net`,
        # where places 1 and 5 crop the padding.
        self.net = nn.Sequential(
            self.conv1,
            nn.Identity(),
            nn.ReLU(inplace=True),
            nn.Dropout(dropout),
            self.conv2,
            nn.Identity(),
            nn.ReLU(inplace=True),
            nn.Dropout(dropout),
        )
        self.downsample = nn.Conv1d(inputs, outputs, 1) if inputs != outputs else None
        if self.downsample is not None:
            nn.init.normal_(self.downsample.weight, 0, 0.01)

    def forward(self, features: Tensor) -> Tensor:
        """``(B, inputs, T)`` to ``(B, outputs, T)``."""
        residual = features if self.downsample is None else self.downsample(features)
        return functional.relu(self.net(features) + residual)


class TemporalConvNet(nn.Module):
    """Blocks with dilation 1, 2, 4 ...; causal, ``1 + 2 (2^blocks - 1)`` frames for kernel 2."""

    def __init__(self, inputs: int, widths: list[int], kernel: int, dropout: float) -> None:
        super().__init__()
        self.network = nn.Sequential(
            *(
                TemporalBlock(before, after, kernel, 2**level, dropout)
                for level, (before, after) in enumerate(
                    zip([inputs, *widths[:-1]], widths, strict=True)
                )
            )
        )

    def forward(self, features: Tensor) -> Tensor:
        """``(B, inputs, T)`` to ``(B, widths[-1], T)``."""
        return cast(Tensor, self.network(features))


class TextEncoder(nn.Module):
    """Frame-aligned words to one feature vector per frame (docs/facts/trimodal.md, section 1.2).

    PAD (id 0) is an ordinary learned vector, as published.

    Args:
        words: Vocabulary size.
        word_size: Numbers per word vector.
        width: Channels of the convolutions.
        blocks: Residual blocks; four see 31 frames, all at or before the current one.
        dropout: Dropout inside the blocks.
        embedding_dropout: Dropout on the word vectors.
    """

    size = 32

    def __init__(
        self,
        words: int,
        word_size: int,
        width: int,
        blocks: int,
        dropout: float,
        embedding_dropout: float,
    ) -> None:
        super().__init__()
        self.embedding = nn.Embedding(words, word_size)
        self.tcn = TemporalConvNet(word_size, [width] * blocks, kernel=2, dropout=dropout)
        self.decoder = nn.Linear(width, self.size)
        self.dropout = nn.Dropout(embedding_dropout)
        nn.init.normal_(self.decoder.weight, 0, 0.01)
        nn.init.zeros_(self.decoder.bias)

    def forward(self, words: Tensor, extra_vectors: Tensor | None = None) -> Tensor:
        """Word ids ``(B, T)`` to features ``(B, T, 32)``.

        ``extra_vectors`` ``(E, word_size)`` are the vectors of ids from the size of the table on:
        words that the table has no row for.
        """
        vectors = self.dropout(self._look_up(words, extra_vectors))
        features = self.tcn(vectors.transpose(1, 2)).transpose(1, 2)
        return cast(Tensor, self.decoder(features))

    def _look_up(self, words: Tensor, extra_vectors: Tensor | None) -> Tensor:
        if extra_vectors is None:
            return cast(Tensor, self.embedding(words))
        size = self.embedding.num_embeddings
        extra = functional.embedding((words - size).clamp(min=0), extra_vectors)
        known = self.embedding(words.clamp(max=size - 1))
        return torch.where((words >= size).unsqueeze(-1), extra, known)
