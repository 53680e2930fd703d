"""The network of Gesticulator: speech around a frame, conditioned on the poses before it.

See docs/facts/trinity_and_gesticulator.md, section 4; Kucherenko et al. 2020, section 4.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal, cast, get_args

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from cospeech.errors import require_choice

Conditioning = Literal["film", "concatenation", "none"]
Initialisation = Literal["fan_product", "he"]

PAST, AHEAD = 10, 19
"""Frames of speech before and after a frame that its pose is made from."""

HISTORY = 3
"""Earlier poses that a pose is conditioned on."""

FRAME_SIZES = (248, 124)
REDUCED_SIZE, HIDDEN_SIZE = 612, 256


class Block(nn.Sequential):
    """A dense layer, its activation and dropout."""

    def __init__(self, inputs: int, outputs: int, dropout: float, activation: bool = True) -> None:
        act = nn.Tanh() if activation else nn.Identity()
        super().__init__(nn.Linear(inputs, outputs), act, nn.Dropout(dropout))

    @property
    def linear(self) -> nn.Linear:
        """The layer with the weights."""
        return cast(nn.Linear, self[0])


class Standardised(nn.Module):
    """Numbers less their mean in training, divided by their standard deviation there.

    Args:
        size: How many.
    """

    mean: Tensor
    deviation: Tensor

    def __init__(self, size: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(size))
        self.register_buffer("deviation", torch.ones(size))

    def fit(self, first: int, sequences: Iterable[NDArray[np.floating]]) -> None:
        """Take mean and deviation of the numbers from ``first`` on.

        What never changes is divided by one.

        Args:
            first: The first of the numbers.
            sequences: ``(T, C)`` values each, gone through once: a corpus needn't fit in memory.
        """
        count, origin = 0, None
        total = squares = np.zeros(())
        for values in sequences:
            exact = np.asarray(values, dtype=np.float64)
            if not len(exact):
                continue
            origin = exact[0] if origin is None else origin  # what never changes has no rounding
            count += len(exact)
            total = total + (exact - origin).sum(axis=0)
            squares = squares + np.square(exact - origin).sum(axis=0)
        if origin is None:
            return
        mean = origin + total / count
        deviation = np.sqrt(np.maximum(squares / count - np.square(total / count), 0))
        here = slice(first, first + len(mean))
        self.mean[here] = torch.from_numpy(mean)
        self.deviation[here] = torch.from_numpy(np.where(deviation > 1e-6, deviation, 1.0))

    def forward(self, values: Tensor) -> Tensor:
        """``(..., size)`` to the same shape."""
        return (values - self.mean) / self.deviation


class GesticulatorNetwork(nn.Module):
    """Speech features and the last three poses to the next pose.

    Args:
        speech_size: Numbers of a frame of speech: acoustic features, then text features.
        pose_size: Numbers of a pose.
        conditioning: How the last poses come in: ``"film"`` scales and shifts the hidden layer by
            them (Perez et al. 2018), ``"concatenation"`` puts them beside it, ``"none"`` leaves
            them out.
        dropout: Of every layer but the conditioning.
        conditioning_dropout: Of the conditioning.
        conditioning_tanh: A tanh after the conditioning, as published; the paper's is linear.
        head_layer: A layer with tanh and dropout before the last one, as published; the paper has
            none.
        initialisation: ``"fan_product"`` divides by the product of inputs and outputs, as
            published, which makes an almost constant network; ``"he"`` by the inputs.
        standardise: Standardise frames of speech before they are encoded; as published they come as
            they are, -12 in a silent band and -15 in every number of a word that isn't there.

    Raises:
        ConfigError: An unknown choice.
    """

    def __init__(
        self,
        speech_size: int,
        pose_size: int,
        conditioning: Conditioning = "film",
        dropout: float = 0.2,
        conditioning_dropout: float = 0.8,
        conditioning_tanh: bool = True,
        head_layer: bool = True,
        initialisation: Initialisation = "fan_product",
        standardise: bool = False,
    ) -> None:
        super().__init__()
        require_choice("model.conditioning", conditioning, get_args(Conditioning))
        require_choice("model.initialisation", initialisation, get_args(Initialisation))
        self.speech_size, self.pose_size, self.conditioning = speech_size, pose_size, conditioning
        self.encode_frame = nn.Sequential(
            *([Standardised(speech_size)] if standardise else []),
            Block(speech_size, FRAME_SIZES[0], dropout),
            Block(*FRAME_SIZES, dropout),
        )
        self.reduce = Block((PAST + 1 + AHEAD) * FRAME_SIZES[1], REDUCED_SIZE, dropout)
        self.first_layer = Block(REDUCED_SIZE, HIDDEN_SIZE, dropout)
        self.condition: Block | None = None
        if conditioning != "none":
            self.condition = Block(
                HISTORY * pose_size, 2 * HIDDEN_SIZE, conditioning_dropout, conditioning_tanh
            )
        self.hidden_size = HIDDEN_SIZE * (3 if conditioning == "concatenation" else 1)
        self.head: Block | None = None
        if head_layer:
            self.head = Block(self.hidden_size, pose_size, dropout)
        self.last = nn.Linear(pose_size if head_layer else self.hidden_size, pose_size)
        self._initialise(initialisation)

    @property
    def standardised(self) -> Standardised | None:
        """What is done to frames of speech first, if anything."""
        first = self.encode_frame[0]
        return first if isinstance(first, Standardised) else None

    def _initialise(self, rule: Initialisation) -> None:
        dense = [self.reduce.linear, self.first_layer.linear, self.last]
        dense += [] if self.head is None else [self.head.linear]
        for layer in dense:
            fan = layer.in_features * (layer.out_features if rule == "fan_product" else 1)
            nn.init.normal_(layer.weight, 0, (2 / fan) ** 0.5)
            nn.init.zeros_(layer.bias)
        if self.condition is not None:
            nn.init.zeros_(self.condition.linear.weight)
            nn.init.zeros_(self.condition.linear.bias)

    def encode(self, speech: Tensor, mask_per_window: bool = False) -> Tensor:
        """What is said around each frame.

        Args:
            speech: ``(B, PAST + T + AHEAD, speech_size)``.
            mask_per_window: Encode the 30 frames around each frame anew, as published, so that
                dropout hides other units of a frame in every window it is in. Without dropout it
                is the same, at 17 times the cost.

        Returns:
            ``(B, T, 256)``.
        """
        span = PAST + 1 + AHEAD
        if mask_per_window:
            windows = self.encode_frame(speech.unfold(1, span, 1).transpose(2, 3))
        else:
            windows = self.encode_frame(speech).unfold(1, span, 1).transpose(2, 3)
        return self.encode_windows(windows)

    def encode_windows(self, windows: Tensor) -> Tensor:
        """What is said around frames: ``(B, T, 256)`` of encoded ones ``(B, T, 30, 124)``."""
        return cast(Tensor, self.first_layer(self.reduce(windows.flatten(2))))

    def pose(self, said: Tensor, history: Tensor | None) -> Tensor:
        """The next pose.

        Args:
            said: ``(B, 256)``, of `encode`.
            history: ``(B, 3, pose_size)``, the last pose first; None leaves the conditioning out.

        Returns:
            ``(B, pose_size)``.
        """
        hidden = said
        if self.condition is not None:
            if history is None:
                told = said.new_zeros(len(said), 2 * HIDDEN_SIZE)
            else:
                told = self.condition(history.flatten(1))
            if self.conditioning == "film":
                scale, shift = told.chunk(2, dim=-1)
                hidden = said * (scale + 1) + shift
            else:
                hidden = torch.cat([said, told], dim=-1)
        if self.head is not None:
            hidden = self.head(hidden)
        return cast(Tensor, self.last(hidden))

    def roll(
        self,
        said: Tensor,
        history: Tensor,
        truth: Tensor | None = None,
        is_reset: Tensor | None = None,
        conditioned: bool = True,
    ) -> Tensor:
        """Pose after pose, each conditioned on those before.

        Args:
            said: ``(B, T, 256)``, of `encode`.
            history: ``(B, 3, pose_size)``, poses before the first, the last one first.
            truth: ``(B, 2 + T, pose_size)`` recorded poses from two frames before the first; None
                where there are none.
            is_reset: ``(T,)``, after which frames the three poses before the next one are recorded
                ones. None: after none.
            conditioned: False leaves the conditioning out.

        Returns:
            ``(B, T, pose_size)``; gradients go through the network's own poses.
        """
        if not conditioned or self.condition is None:
            frames = self.pose(said.flatten(0, 1), None)
            return frames.unflatten(0, said.shape[:2])
        resets = [False] * said.shape[1] if is_reset is None else is_reset.tolist()
        poses = []
        for frame, reset in enumerate(resets):
            made = self.pose(said[:, frame], history)
            poses.append(made)
            if reset:
                assert truth is not None
                history = truth[:, frame : frame + HISTORY].flip(1)
            else:
                history = torch.cat([made[:, None], history[:, :-1]], dim=1)
        return torch.stack(poses, dim=1)
