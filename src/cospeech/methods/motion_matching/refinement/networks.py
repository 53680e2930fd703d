"""Generator and critic of the refinement (Habibie et al. 2022, section 3.2).

See docs/facts/motion_matching.md, section 6.

Both are convolutions over time. Numbers of channels are those of the published code, or multiples
of a smaller width.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Literal

import torch
from torch import Tensor, nn
from torch.nn import functional

from cospeech.errors import ConfigError

Form = Literal["code", "paper"]
"""The generator as in the published code or as in the paper's text."""

POOLED = 8
"""Frames that the deepest convolutions see as one: inputs are made a multiple of it."""

_CONTEXT: dict[Form, int] = {"code": 48, "paper": 64}

_SLOPE = 0.2


class Refiner(nn.Module):
    """The generator: speech and matched motion in, refined motion out, all of it at once.

    Form ``"code"`` is a U-Net: pairs of convolutions with batch norm and LeakyReLU, average
    pooling, skips, and a last convolution of one frame. Form ``"paper"`` is the text's: eight
    blocks with ReLU down and eight up, max pooling, no skips. It has the code's numbers of
    channels, as the text gives none.

    Args:
        audio: Speech channels.
        poses: Numbers per pose.
        width: Channels of the first convolutions; 128 as published.
        form: See above.
        residual: Put out what is added to the matched poses, at first nothing, not the poses.

    Attributes:
        context: So many frames before and after `POOLED` ones these depend on, and no others.

    Raises:
        ConfigError: No such form.
    """

    def __init__(
        self,
        audio: int,
        poses: int,
        width: int = 128,
        form: Form = "code",
        residual: bool = False,
    ) -> None:
        super().__init__()
        if form not in ("code", "paper"):
            raise ConfigError(f"no generator form {form!r}", "choose code or paper")
        self.context = _CONTEXT[form]
        network = _UNet if form == "code" else _Hourglass
        self.network = network(audio + poses, poses, width)
        start_as_published(self)
        self.residual = residual
        if residual:
            *_, output = (layer for layer in self.modules() if isinstance(layer, nn.Conv1d))
            nn.init.zeros_(output.weight)

    def forward(self, audio: Tensor, poses: Tensor) -> Tensor:
        """Refined poses.

        Of a length that isn't a multiple of 8, the last frame is repeated and cut off again.

        Args:
            audio: ``(B, T, audio)``, normalised.
            poses: ``(B, T, poses)``, normalised.

        Returns:
            ``(B, T, poses)``, normalised.
        """
        frames = poses.shape[1]
        hidden = torch.cat([audio, poses], dim=2).transpose(1, 2)
        if missing := -frames % POOLED:
            hidden = functional.pad(hidden, (0, missing), mode="replicate")
        refined: Tensor = self.network(hidden)[..., :frames].transpose(1, 2)
        return poses + refined if self.residual else refined


class _UNet(nn.Module):
    def __init__(self, inputs: int, outputs: int, width: int) -> None:
        super().__init__()
        w, blocks = width, _normed_blocks
        self.down = nn.ModuleList(
            [blocks(inputs, w, w), blocks(w, 2 * w, 2 * w), blocks(2 * w, 2 * w, 2 * w)]
        )
        self.middle = blocks(2 * w, 4 * w, 4 * w)
        self.up = nn.ModuleList(
            [
                blocks(6 * w, 2 * w, 2 * w),
                blocks(4 * w, 2 * w, 2 * w),
                blocks(3 * w, 2 * w, 2 * w),
            ]
        )
        self.last = nn.Conv1d(2 * w, outputs, 1)
        self.pool = _Halving()

    def forward(self, hidden: Tensor) -> Tensor:
        skips = []
        for down in self.down:
            skips.append(down(hidden))
            hidden = self.pool(skips[-1])
        hidden = self.middle(hidden)
        for up, skip in zip(self.up, reversed(skips), strict=True):
            hidden = up(torch.cat([hidden.repeat_interleave(2, dim=-1), skip], dim=1))
        output: Tensor = self.last(hidden)
        return output


class _Hourglass(nn.Sequential):
    def __init__(self, inputs: int, outputs: int, width: int) -> None:
        channels = [width * times for times in (1, 1, 2, 2, 2, 2, 4, 4)]
        down = _text_blocks([inputs, *channels], lambda: nn.MaxPool1d(2))
        up = _text_blocks(channels[::-1], lambda: nn.Upsample(scale_factor=2))
        super().__init__(*down, *up, _convolution(width, outputs))


def _text_blocks(sizes: Sequence[int], between: Callable[[], nn.Module]) -> list[nn.Module]:
    """Convolution, norm and ReLU from size to size, and a layer after every second one."""
    layers: list[nn.Module] = []
    for block, (before, after) in enumerate(pairwise(sizes), start=1):
        layers += [_convolution(before, after), nn.BatchNorm1d(after), nn.ReLU()]
        if block in (2, 4, 6):
            layers.append(between())
    return layers


class Critic(nn.Module):
    """Pairs of convolutions with instance norm and LeakyReLU, average pooling, one number.

    Args:
        inputs: Channels: speech and pose.
        frames: Frames per window, a multiple of 8.
        width: Channels of the first convolutions; 512 as published.

    Raises:
        ConfigError: Windows or width that can't be halved.
    """

    def __init__(self, inputs: int, frames: int = 64, width: int = 512) -> None:
        super().__init__()
        if frames % POOLED or width % 4:
            raise ConfigError(
                f"a critic of {frames} frames and width {width}",
                f"frames must be a multiple of {POOLED}, the width of 4",
            )
        sizes = [inputs, width, width // 2, width // 4]
        pairs = [
            layer
            for before, after in pairwise(sizes)
            for layer in (
                *(_convolution(before, after), nn.InstanceNorm1d(after, affine=True)),
                nn.LeakyReLU(_SLOPE),
                *(_convolution(after, after), nn.InstanceNorm1d(after, affine=True)),
                nn.LeakyReLU(_SLOPE),
                _Halving(),
            )
        ]
        self.convolutions = nn.Sequential(*pairs)
        self.output = nn.Linear(sizes[-1] * frames // POOLED, 1, bias=False)
        start_as_published(self)

    def forward(self, windows: Tensor) -> Tensor:
        """Scores ``(B,)`` of windows ``(B, frames, inputs)``, normalised; higher is more real."""
        hidden = self.convolutions(windows.transpose(1, 2))
        scores: Tensor = self.output(hidden.flatten(1)).squeeze(1)
        return scores


class _Halving(nn.Module):
    """Average pooling of every two frames; torch's own takes several times as long on CPUs."""

    def forward(self, hidden: Tensor) -> Tensor:
        return (hidden[..., ::2] + hidden[..., 1::2]) * 0.5


def start_as_published(network: nn.Module) -> None:
    """Xavier-normal weights with the gain of ReLU, biases 0; norms begin as the identity."""
    gain = nn.init.calculate_gain("relu")
    for layer in network.modules():
        if isinstance(layer, nn.Conv1d | nn.Linear):
            nn.init.xavier_normal_(layer.weight, gain)
            if layer.bias is not None:
                nn.init.zeros_(layer.bias)


def _convolution(inputs: int, outputs: int) -> nn.Conv1d:
    return nn.Conv1d(inputs, outputs, kernel_size=3, padding=1)


def _normed_blocks(*sizes: int) -> nn.Sequential:
    layers: list[nn.Module] = []
    for before, after in pairwise(sizes):
        activation = nn.LeakyReLU(_SLOPE, inplace=True)
        layers += [_convolution(before, after), nn.BatchNorm1d(after), activation]
    return nn.Sequential(*layers)
