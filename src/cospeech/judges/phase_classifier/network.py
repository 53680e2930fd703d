"""The network that tells gesture phases apart (Ferstl et al. 2020, section 4).

See docs/facts/multi_adversary.md, section 4.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from cospeech.motion.velocities import velocities

STEP_FPS = 20.0
"""Steps per second."""

_SMALLEST_DEVIATION = 1e-6


@dataclass(frozen=True)
class PhaseSizes:
    """Sizes of a `PhaseNetwork`; the paper draws them without numbers, these are ours.

    Attributes:
        dense: Units of the dense layer.
        recurrent: Units of the forward LSTM.
        bidirectional: Units per direction of the LSTM that reads both ways.
        dense_dropout: Dropout after the dense layer.
        recurrent_dropout: Dropout after each LSTM.
    """

    dense: int = 128
    recurrent: int = 128
    bidirectional: int = 64
    dense_dropout: float = 0.3
    recurrent_dropout: float = 0.4


STROKE_SIZES = PhaseSizes(dense=64, recurrent=64, bidirectional=32)
"""For the net that tells strokes from all else."""


class PhaseNetwork(nn.Module):
    """Dense, LSTM, bidirectional LSTM, batch norm, output; dropout after each.

    Two classes have a single output, whose sigmoid is the second one's probability.

    Args:
        inputs: Channels per step.
        classes: Classes.
        sizes: Layers; None takes ours for so many classes.
    """

    def __init__(self, inputs: int, classes: int, sizes: PhaseSizes | None = None) -> None:
        super().__init__()
        self.inputs, self.classes = inputs, classes
        self.sizes = sizes or (STROKE_SIZES if classes == 2 else PhaseSizes())
        sizes = self.sizes
        self.dense = nn.Linear(inputs, sizes.dense)
        self.forward_lstm = nn.LSTM(sizes.dense, sizes.recurrent, batch_first=True)
        self.both_ways_lstm = nn.LSTM(
            sizes.recurrent, sizes.bidirectional, batch_first=True, bidirectional=True
        )
        self.dense_dropout = nn.Dropout(sizes.dense_dropout)
        self.recurrent_dropout = nn.Dropout(sizes.recurrent_dropout)
        self.norm = nn.BatchNorm1d(2 * sizes.bidirectional)
        self.output = nn.Linear(2 * sizes.bidirectional, 1 if classes == 2 else classes)

    def forward(self, features: Tensor) -> Tensor:
        """Scores ``(B, T, classes)``, or ``(B, T, 1)`` for two, of z-scores ``(B, T, inputs)``."""
        hidden = self.dense_dropout(functional.relu(self.dense(features)))
        hidden = self.recurrent_dropout(self.forward_lstm(hidden)[0])
        hidden = self.recurrent_dropout(self.both_ways_lstm(hidden)[0])
        hidden = self.norm(hidden.transpose(1, 2)).transpose(1, 2)
        scores: Tensor = self.output(hidden)
        return scores

    def probabilities(self, scores: Tensor) -> Tensor:
        """Class probabilities ``(B, T, classes)`` of `forward`'s scores."""
        if self.classes == 2:
            stroke = torch.sigmoid(scores)
            return torch.cat([1 - stroke, stroke], dim=-1)
        return torch.softmax(scores, dim=-1)

    def loss(self, scores: Tensor, labels: Tensor) -> Tensor:
        """Mean cross entropy per step.

        Args:
            scores: From `forward`.
            labels: ``(B, T)`` class indices.

        Returns:
            Scalar.
        """
        if self.classes == 2:
            return functional.binary_cross_entropy_with_logits(scores[..., 0], labels.to(scores))
        return functional.cross_entropy(scores.flatten(0, 1), labels.flatten())


class PhaseFeatures(nn.Module):
    """Z-scores of velocities, and of pitch: what the network reads.

    Velocities are differences of positions in metres times 20 fps, whatever scales the positions
    had elsewhere (docs/facts/multi_adversary.md, section 7, trap 3). The statistics are buffers;
    until `fit` they are 0 and 1.

    Args:
        joints: Number of joints.
        pitch: Whether the pitch is a channel.
        speeds: Whether each joint's speed is a channel, besides its velocity
            (docs/facts/uci_gesture_phases.md, section 5).
        smooth: Whether positions pass a low-pass first, 1-2-1 over neighbouring steps (a standard
            deviation of 35 ms): for noisy positions such as a Kinect's
            (docs/facts/uci_gesture_phases.md, section 5).
    """

    mean: Tensor
    deviation: Tensor
    steps: Tensor

    def __init__(
        self, joints: int, pitch: bool, speeds: bool = False, smooth: bool = False
    ) -> None:
        super().__init__()
        self.joints, self.pitch, self.speeds, self.smooth = joints, pitch, speeds, smooth
        self.register_buffer("mean", torch.zeros(self.channels))
        self.register_buffer("deviation", torch.ones(self.channels))
        self.register_buffer("steps", torch.zeros((), dtype=torch.int64))

    @property
    def channels(self) -> int:
        """Channels per step."""
        return (3 + self.speeds) * self.joints + self.pitch

    @property
    def fitted(self) -> bool:
        """Whether `fit` has run, here or before the state was saved."""
        return bool(self.steps > 0)

    def forward(self, joints: Tensor, pitch: Tensor | None = None) -> Tensor:
        """Z-scores of every step but the first; differentiable.

        Args:
            joints: ``(B, T, J, 3)`` positions in the body frame at 20 fps, metres.
            pitch: ``(B, T)`` F0, Hz, 0 where unvoiced; not read by features without pitch.

        Returns:
            ``(B, T - 1, channels)``.

        Raises:
            ValueError: Another number of joints, or the pitch is missing.
        """
        return (self._raw(joints, pitch) - self.mean) / self.deviation

    def fit(self, windows: Iterable[tuple[Tensor, Tensor | None]]) -> None:
        """Take the statistics of the training part.

        Args:
            windows: Batches of (joints, pitch) as `forward` takes them.

        Raises:
            ValueError: There are no steps.
        """
        steps = 0
        total = squares = torch.zeros(self.channels, dtype=torch.float64)
        for joints, pitch in windows:
            values = self._raw(joints, pitch).flatten(0, 1).double().cpu()
            steps += len(values)
            total, squares = total + values.sum(0), squares + values.square().sum(0)
        if not steps:
            raise ValueError("no steps to take statistics of")
        mean = total / steps
        deviation = (squares / steps - mean.square()).clamp(min=0).sqrt()
        self.mean.copy_(mean)
        self.deviation.copy_(deviation.clamp(min=_SMALLEST_DEVIATION))
        self.steps.fill_(steps)

    def _raw(self, joints: Tensor, pitch: Tensor | None) -> Tensor:
        if joints.shape[-2] != self.joints:
            raise ValueError(f"{joints.shape[-2]} joints, not {self.joints}")
        if self.smooth:
            around = torch.cat([joints[:, :1], joints, joints[:, -1:]], dim=1)
            joints = (around[:, :-2] + 2 * joints + around[:, 2:]) / 4
        values = velocities(joints, STEP_FPS, self.speeds)
        if not self.pitch:
            return values
        if pitch is None:
            raise ValueError("this classifier reads the pitch, and there is none")
        return torch.cat([values, pitch[..., 1:, None].to(values)], dim=-1)
