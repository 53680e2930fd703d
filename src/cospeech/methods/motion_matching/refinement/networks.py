"""Generator and critic of the refinement (Habibie et al. 2022, section 3.2).

See docs/facts/motion_matching.md, section 6.

Both are convolutions over time. Numbers of channels are those of the published code, or multiples
of a smaller width.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import Literal

import torch
from torch import Tensor, nn
from torch.nn import functional
from torch.nn.utils.fusion import fuse_conv_bn_eval

from cospeech.errors import ConfigError
from cospeech.methods.motion_matching.refinement.piecewise import (
    Around,
    Chain,
    Convolution,
    Each,
    Halved,
    Piecewise,
)
from cospeech.nn.modes import evaluating

Form = Literal["code", "paper"]
"""The generator as in the published code or as in the paper's text."""

POOLED = 8
"""Frames that the deepest convolutions see as one: inputs are made a multiple of it."""

_AT_ONCE = 64
"""Pieces that are shown at a time at most, so that a long speech takes no more memory."""

_BEHIND: dict[Form, int] = {"code": 46, "paper": 62}

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
        behind: When a multiple of `POOLED` frames was seen, all but so many at the end are refined
            the same whatever follows.

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
        self.behind = _BEHIND[form]
        network = _UNet if form == "code" else _Hourglass
        self.network = network(audio + poses, poses, width)
        start_as_published(self)
        self.residual, self._poses = residual, poses
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

    @torch.no_grad()
    def piecewise(self) -> PiecewiseRefiner:
        """The network as it is now, in eval mode, for one speech that comes piece by piece."""
        with evaluating(self):
            network: Piecewise = self.network.piecewise()
        if self.residual:
            poses = self._poses
            network = Around(network, lambda refined, shown: shown[:, -poses:] + refined)
        return PiecewiseRefiner(network)


class PiecewiseRefiner:
    """Refined motion of what comes piece by piece; of a `Refiner`, which says what it is behind.

    Args:
        network: Is shown `POOLED` frames per piece.
    """

    def __init__(self, network: Piecewise) -> None:
        self._network = network
        self._is_under_way = False
        self._left = 0

    def __call__(self, audio: Tensor, poses: Tensor, is_end: bool) -> Tensor:
        """What the next frames complete.

        Args:
            audio: ``(T, audio)``, normalised; T is a multiple of `POOLED`, or anything at the end.
            poses: ``(T, poses)``, normalised.
            is_end: Nothing follows.

        Returns:
            ``(F, poses)``, normalised; at the end all that is left.
        """
        self._left += len(poses)
        frames = torch.cat([audio, poses], dim=1)
        made = [poses[:0]]
        while len(frames) >= POOLED:
            # Each piece completes as many frames as the one before, once any were completed.
            together = _AT_ONCE if self._is_under_way and frames.device.type == "cpu" else 1
            pieces = min(len(frames) // POOLED, together)
            made += self._completed(frames[: pieces * POOLED], pieces, is_end=False)
            frames = frames[pieces * POOLED :]
        if is_end:
            last = frames[-1:].expand(-len(frames) % POOLED, -1)
            made += self._completed(torch.cat([frames, last]), 1, is_end=True)
        return torch.cat(made)

    def _completed(self, frames: Tensor, pieces: int, is_end: bool) -> list[Tensor]:
        refined = self._network(frames, pieces, is_end)
        if refined is None:
            return []
        self._is_under_way = True
        refined = refined[: self._left]
        self._left -= len(refined)
        return [refined]


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

    def piecewise(self) -> Piecewise:
        """See `Refiner.piecewise`."""
        inside = _piecewise(self.middle)
        for down, up in zip(reversed(self.down), self.up, strict=True):
            halved = Chain([*_piecewise([self.pool]), *inside, Each(_twice)])
            skip = Around(halved, lambda deep, skipped: torch.cat([deep, skipped], dim=1))
            inside = [*_piecewise(down.children()), skip, *_piecewise(up.children())]
        return Chain([*inside, *_piecewise([self.last])])


class _Hourglass(nn.Sequential):
    def __init__(self, inputs: int, outputs: int, width: int) -> None:
        channels = [width * times for times in (1, 1, 2, 2, 2, 2, 4, 4)]
        down = _text_blocks([inputs, *channels], lambda: nn.MaxPool1d(2))
        up = _text_blocks(channels[::-1], lambda: nn.Upsample(scale_factor=2))
        super().__init__(*down, *up, _convolution(width, outputs))

    def piecewise(self) -> Piecewise:
        """See `Refiner.piecewise`."""
        return Chain(_piecewise(self))


def _text_blocks(sizes: Sequence[int], between: Callable[[], nn.Module]) -> list[nn.Module]:
    """Convolution, norm and ReLU from size to size, and a layer after every second one."""
    layers: list[nn.Module] = []
    for block, (before, after) in enumerate(pairwise(sizes), start=1):
        layers += [_convolution(before, after), nn.BatchNorm1d(after), nn.ReLU()]
        if block in (2, 4, 6):
            layers.append(between())
    return layers


def _piecewise(layers: Iterable[nn.Module]) -> list[Piecewise]:
    parts = list[Piecewise]()
    for layer in layers:
        if isinstance(layer, nn.Conv1d):
            convolution = layer
            parts.append(Convolution(layer))
        elif isinstance(layer, nn.BatchNorm1d):
            parts[-1] = Convolution(fuse_conv_bn_eval(convolution, layer))
        elif isinstance(layer, _Halving):
            parts.append(Halved(lambda first, second: (first + second) * 0.5))
        elif isinstance(layer, nn.MaxPool1d):
            parts.append(Halved(torch.maximum))
        elif isinstance(layer, nn.Upsample):
            parts.append(Each(_twice))
        else:
            parts.append(Each(layer))
    return parts


def _twice(frames: Tensor) -> Tensor:
    return frames.repeat_interleave(2, dim=0)


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
