"""The generator and the discriminators (Ferstl et al. 2020, sections 5 and 6).

See docs/facts/multi_adversary.md, sections 5 and 6.

The paper gives the generator's sizes. The discriminators' are drawn without numbers: those here are
ours.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.nn import functional


class WindowDropout(nn.Module):
    """Dropout whose mask is the same at every step of a window (Gal and Ghahramani 2016).

    With a mask per step behind the GRU, motion would jitter by as much as the masks differ: faster
    than people move, and all that adversaries of velocities and phases could see.

    Args:
        p: Rate.
    """

    def __init__(self, p: float) -> None:
        super().__init__()
        self.p = p

    def forward(self, hidden: Tensor) -> Tensor:
        """Values ``(B, T, C)``; unchanged in evaluation."""
        if not self.training:
            return hidden
        return hidden * functional.dropout(torch.ones_like(hidden[:, :1]), self.p)


class Generator(nn.Module):
    """Dense, dropout, batch norm, GRU, dropout, dense: speech in, poses out, step by step.

    No noise goes in: but for dropout, the same speech gives the same motion. It looks at no later
    step, so a longer input changes nothing before it.

    Args:
        inputs: Speech features per step.
        outputs: Numbers per pose.
        hidden_size: Width of the dense layer and of the GRU.
    """

    def __init__(self, inputs: int, outputs: int, hidden_size: int = 256) -> None:
        super().__init__()
        self.dense = nn.Linear(inputs, hidden_size)
        self.dense_dropout = nn.Dropout(0.0)
        self.norm = nn.BatchNorm1d(hidden_size)
        self.gru = nn.GRU(hidden_size, hidden_size, batch_first=True)
        self.recurrent_dropout = WindowDropout(0.0)
        self.output = nn.Linear(hidden_size, outputs)

    def set_dropout(self, dense: float, recurrent: float) -> None:
        """Choose the rates, which differ between pre-training and adversarial training."""
        self.dense_dropout.p, self.recurrent_dropout.p = dense, recurrent

    def forward(self, speech: Tensor) -> Tensor:
        """Poses ``(B, T, outputs)`` of speech ``(B, T, inputs)``, both z-scored."""
        hidden = self.dense_dropout(functional.relu(self.dense(speech)))
        hidden = self.norm(hidden.transpose(1, 2)).transpose(1, 2)
        hidden = self.recurrent_dropout(self.gru(hidden)[0])
        poses: Tensor = self.output(hidden)
        return poses


class SequenceDiscriminator(nn.Module):
    """Dense, dropout, LSTM, sigmoid of its last state: one probability of being real per window.

    An LSTM, where the paper says "recurrent unit": on CPUs torch has a fused one, and none for
    GRUs, whose hundred small steps take longer.

    Args:
        inputs: Numbers per step.
        dense: Units of the dense layer.
        hidden: Units of the LSTM.
        dropout: Rate after the dense layer.
    """

    def __init__(self, inputs: int, dense: int, hidden: int, dropout: float) -> None:
        super().__init__()
        self.dense = nn.Linear(inputs, dense)
        self.dropout = nn.Dropout(dropout)
        self.lstm = nn.LSTM(dense, hidden, batch_first=True)
        self.output = nn.Linear(hidden, 1)

    def forward(self, windows: Tensor) -> Tensor:
        """Probabilities ``(B,)`` of windows ``(B, T, inputs)``."""
        hidden = self.dropout(functional.relu(self.dense(windows)))
        _, (last, _) = self.lstm(hidden)
        return torch.sigmoid(self.output(last[-1])).squeeze(-1)


class MinibatchSimilarity(nn.Module):
    """How much each window resembles the others of its batch (Salimans et al. 2016).

    ``o_b(x_i) = sum over j != i of exp(-||M_ib - M_jb||_1) / (batch - 1)`` with ``M_i = x_i W``
    cut into kernels. The paper prints ``L1(W X)`` with W "300-dimensional": here 100 kernels of
    three dimensions.

    Args:
        inputs: Numbers per window.
        kernels: Similarities per window.
        kernel_size: Dimensions of each kernel.
    """

    def __init__(self, inputs: int, kernels: int, kernel_size: int) -> None:
        super().__init__()
        self.kernels, self.kernel_size = kernels, kernel_size
        # Of independent z-scores, a kernel's distances then have a mean of 1. With much larger
        # ones every exponential, and its gradient, would be 0.
        self.scale = math.sqrt(math.pi) / (2 * kernel_size * math.sqrt(inputs))
        # The scale is no part of the weights, or RMSprop's steps, the same for weights of all
        # sizes, would turn these thousands of small ones many times as fast as other networks.
        self.weight = nn.Parameter(torch.randn(inputs, kernels * kernel_size))

    def forward(self, windows: Tensor) -> Tensor:
        """Similarities ``(B, kernels)`` in [0, 1] of windows ``(B, inputs)``; 0 for one alone."""
        projected = self.scale * (windows @ self.weight)
        kernels = projected.unflatten(1, (self.kernels, self.kernel_size))
        distances = (kernels[:, None] - kernels[None]).abs().sum(dim=-1)
        count = len(windows)
        # A window's resemblance to itself says nothing: exp(0) = 1 is taken off.
        return (torch.exp(-distances).sum(dim=1) - 1) / max(1, count - 1)


class MinibatchDiscriminator(nn.Module):
    """Minibatch similarities beside a dense view of the window, dropout, dense, sigmoid.

    Args:
        frames: Steps per window.
        inputs: Numbers per step.
        kernels: Similarities per window.
        kernel_size: Dimensions of each kernel.
        dense: Units of the window's own embedding.
        hidden: Units of the last dense layer.
        dropout: Rate between the two.
    """

    def __init__(
        self,
        frames: int,
        inputs: int,
        kernels: int,
        kernel_size: int,
        dense: int,
        hidden: int,
        dropout: float,
    ) -> None:
        super().__init__()
        self.similarity = MinibatchSimilarity(frames * inputs, kernels, kernel_size)
        self.dense = nn.Linear(frames * inputs, dense)
        self.dropout = nn.Dropout(dropout)
        self.hidden = nn.Linear(dense + kernels, hidden)
        self.output = nn.Linear(hidden, 1)

    def forward(self, windows: Tensor) -> Tensor:
        """Probabilities ``(B,)`` of the windows ``(B, T, inputs)`` of one batch, seen together."""
        flat = windows.flatten(1)
        seen = torch.cat([functional.relu(self.dense(flat)), self.similarity(flat)], dim=1)
        hidden = functional.relu(self.hidden(self.dropout(seen)))
        return torch.sigmoid(self.output(hidden)).squeeze(-1)
