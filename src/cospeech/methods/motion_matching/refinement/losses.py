"""What is beside the Wasserstein loss (section 3.2, equations 1 to 3).

See docs/facts/motion_matching.md, section 6.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import torch
from torch import Tensor

from cospeech.errors import ConfigError

PenaltyPoints = Literal["interpolates", "generated"]
"""Where the critic's slope is held at 1: between real and generated windows (Gulrajani et al. 2017,
and the published code), or at the generated ones alone, as equation 2 is printed."""


def penalty_points(
    real: Tensor, fake: Tensor, at: PenaltyPoints, generator: torch.Generator | None = None
) -> Tensor:
    """Windows at which the slope is looked at.

    Args:
        real: ``(B, T, C)``, speech and pose.
        fake: The same speech with generated poses; what is the same in both stays as it is.
        at: See `PenaltyPoints`.
        generator: Draws each window's place between the two; torch's own when None.

    Returns:
        ``(B, T, C)``, without gradient.

    Raises:
        ConfigError: No such points.
    """
    if at == "generated":
        return fake.detach()
    if at != "interpolates":
        raise ConfigError(f"no penalty at {at!r}", "choose interpolates or generated")
    shape = (len(real), *(1,) * (real.ndim - 1))
    place = torch.rand(shape, generator=generator, dtype=real.dtype, device=real.device)
    return torch.lerp(real.detach(), fake.detach(), place)


def gradient_penalty(
    critic: Callable[[Tensor], Tensor],
    real: Tensor,
    fake: Tensor,
    at: PenaltyPoints = "interpolates",
    generator: torch.Generator | None = None,
) -> Tensor:
    """``mean (|slope| - 1)^2``, the slope over all numbers of a window, speech included.

    Args:
        critic: Scores ``(B,)`` of windows, each by itself.
        real: ``(B, T, C)``.
        fake: ``(B, T, C)``; no gradient reaches it.
        at: See `PenaltyPoints`.
        generator: See `penalty_points`.

    Returns:
        Scalar, to be multiplied with its weight: 100 as published.

    Raises:
        ConfigError: No such points.
    """
    points = penalty_points(real, fake, at, generator).requires_grad_()
    (slopes,) = torch.autograd.grad(critic(points).sum(), points, create_graph=True)
    # The norm of a slope of 0, whose own slope is not defined, passes back 0.
    return (torch.linalg.vector_norm(slopes.flatten(1), dim=1) - 1).square().mean()


def reconstruction_loss(matched: Tensor, refined: Tensor) -> Tensor:
    """Mean absolute difference of refined poses from what was matched, both normalised."""
    return (refined - matched).abs().mean()
