"""GAN losses on discriminator outputs. Pure functions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import torch
from torch import Tensor

from cospeech.errors import require_choice

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


def squared_discriminator_loss(real: Tensor, fake: Tensor) -> Tensor:
    """``mean[(real - 1)^2] + mean[fake^2]`` (Mao et al. 2017, with targets 0 and 1)."""
    return (real - 1).square().mean() + fake.square().mean()


def squared_generator_loss(fake: Tensor) -> Tensor:
    """``mean[(fake - 1)^2]`` (Mao et al. 2017)."""
    return (fake - 1).square().mean()


def wasserstein_critic_loss(real: Tensor, fake: Tensor) -> Tensor:
    """``mean fake - mean real``, which the critic makes small (Arjovsky et al. 2017)."""
    return fake.mean() - real.mean()


def wasserstein_generator_loss(fake: Tensor) -> Tensor:
    """``-mean fake`` (Arjovsky et al. 2017)."""
    return -fake.mean()


NON_SATURATING = GanLosses(log_discriminator_loss, log_generator_loss)
LEAST_SQUARES = GanLosses(squared_discriminator_loss, squared_generator_loss)
WASSERSTEIN = GanLosses(wasserstein_critic_loss, wasserstein_generator_loss)
"""Wants a critic whose slope is held, e.g. by a gradient penalty."""

ON_PROBABILITIES = {"non_saturating": NON_SATURATING, "least_squares": LEAST_SQUARES}
"""Losses of discriminators that put out probabilities of being real, by name."""

ON_SCORES = {"wasserstein": WASSERSTEIN, "least_squares": LEAST_SQUARES}
"""Losses of discriminators whose outputs have no bounds, by name."""


def chosen_losses(name: str, choices: Mapping[str, GanLosses], setting: str) -> GanLosses:
    """The losses that a setting names.

    Args:
        name: The setting's value.
        choices: `ON_PROBABILITIES` or `ON_SCORES`, by what the discriminator puts out.
        setting: What the setting is called, for the message.

    Raises:
        ConfigError: No such losses; the message names those that fit.
    """
    require_choice(setting, name, choices)
    return choices[name]
