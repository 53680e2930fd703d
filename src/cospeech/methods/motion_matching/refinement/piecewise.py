"""Networks over time that are shown their frames piece by piece, each layer each frame once.

What a part gives of all pieces, one after the other, is what the network gives of all frames at
once, up to rounding. On a CPU it is the same to the bit however many pieces it is shown at a time:
every product of matrices is of one piece, and so of the same size.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence

import torch
from torch import Tensor, nn


class Piecewise(ABC):
    """A part of a network, and what it holds of the frames so far."""

    @abstractmethod
    def __call__(self, frames: Tensor, pieces: int, is_end: bool) -> Tensor | None:
        """What further frames complete.

        Args:
            frames: ``(n, C)``, what follows on the frames so far; none only at the end.
            pieces: How many pieces they are. More than one only where every piece completes as
                many frames as another.
            is_end: Nothing follows.

        Returns:
            ``(m, C')``; None where nothing is complete yet.
        """


class Convolution(Piecewise):
    """A convolution that puts out as many frames as come in: stride 1, zeros around all of them."""

    def __init__(self, layer: nn.Conv1d) -> None:
        (self._size,) = layer.kernel_size
        # Of a few frames this product takes half the time of torch's convolution.
        self._weight = layer.weight.mT.flatten(1).T
        assert layer.bias is not None
        self._bias = layer.bias
        self._held = self._padding = layer.weight.new_zeros(self._size // 2, layer.in_channels)

    def __call__(self, frames: Tensor, pieces: int, is_end: bool) -> Tensor | None:
        """See `Piecewise`."""
        seen = torch.cat([self._held, frames, *([self._padding] if is_end else [])])
        complete, channels = len(seen) - self._size + 1, seen.shape[1]
        if complete < 1:
            self._held = seen
            return None
        self._held = seen[complete:]
        of_each = complete // pieces
        windows = seen.as_strided(
            (pieces, of_each, len(self._weight)), (of_each * channels, channels, 1)
        )
        weights = self._weight.expand(pieces, -1, -1)
        return torch.baddbmm(self._bias, windows, weights).flatten(0, 1)


class Halved(Piecewise):
    """One frame of every two.

    Args:
        of_two: Makes it of the first and the second frame.
    """

    def __init__(self, of_two: Callable[[Tensor, Tensor], Tensor]) -> None:
        self._of_two = of_two
        self._held: Tensor | None = None

    def __call__(self, frames: Tensor, pieces: int, is_end: bool) -> Tensor | None:
        """See `Piecewise`."""
        seen = frames if self._held is None else torch.cat([self._held, frames])
        complete = len(seen) // 2 * 2
        self._held = seen[complete:]
        return self._of_two(seen[:complete:2], seen[1:complete:2]) if complete else None


class Each(Piecewise):
    """A function of each frame by itself, that puts out one or more of them."""

    def __init__(self, of_frames: Callable[[Tensor], Tensor]) -> None:
        self._of_frames = of_frames

    def __call__(self, frames: Tensor, pieces: int, is_end: bool) -> Tensor:
        """See `Piecewise`."""
        return self._of_frames(frames)


class Chain(Piecewise):
    """Parts one after the other."""

    def __init__(self, parts: Sequence[Piecewise]) -> None:
        self._parts = parts

    def __call__(self, frames: Tensor, pieces: int, is_end: bool) -> Tensor | None:
        """See `Piecewise`."""
        passed: Tensor | None = frames
        for part in self._parts:
            if passed is None:
                return None
            passed = part(passed, pieces, is_end)
        return passed


class Around(Piecewise):
    """A part, and a way around it: frames wait for what is made of them.

    Args:
        part: Puts out as many frames as come in.
        join: Joins what it puts out with the same frames as they came in.
    """

    def __init__(self, part: Piecewise, join: Callable[[Tensor, Tensor], Tensor]) -> None:
        self._part, self._join = part, join
        self._waiting: Tensor | None = None

    def __call__(self, frames: Tensor, pieces: int, is_end: bool) -> Tensor | None:
        """See `Piecewise`."""
        waiting = frames if self._waiting is None else torch.cat([self._waiting, frames])
        made = self._part(frames, pieces, is_end)
        if made is None:
            self._waiting = waiting
            return None
        self._waiting = waiting[len(made) :]
        return self._join(made, waiting[: len(made)])
