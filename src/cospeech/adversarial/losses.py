"""GAN losses on discriminator outputs. Pure functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor

EPSILON = 1e-8
"""Keeps the logarithm of a probability of 0 finite."""


class GanLosses(NamedTuple):
    """The two sides of one GAN objective.

    Attributes:
        discriminator: (output on real, output on fake) -> scalar to minimise.
        generator: output on fake -> scalar to minimise.
    """

    discriminator: Callable[[Tensor, Tensor], Tensor]
    generator: Callable[[Tensor], Tensor]


def log_discriminator_loss(real: Tensor, fake: Tensor) -> Tensor:
    """``-mean[log(real + 1e-8) + log(1 - fake + 1e-8)]`` on probabilities (Goodfellow 2014)."""
    return -(torch.log(real + EPSILON) + torch.log(1 - fake + EPSILON)).mean()


def log_generator_loss(fake: Tensor) -> Tensor:
    """``-mean log(fake + 1e-8)`` on probabilities: the non-saturating form (Goodfellow 2014)."""
    return -torch.log(fake + EPSILON).mean()


NON_SATURATING = GanLosses(log_discriminator_loss, log_generator_loss)
"""NS-GAN on probabilities."""
