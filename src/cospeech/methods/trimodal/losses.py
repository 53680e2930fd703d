"""The generator's own losses (Yoon et al. 2020, section 4.2). Pure functions.

See docs/facts/trimodal.md, section 2.2.
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

RECONSTRUCTION_BETA = 0.1
DIVERSITY_BETA = 0.05
DIVERSITY_CLAMP = 1000.0


def reconstruction_loss(poses: Tensor, target: Tensor) -> Tensor:
    """Mean over every element, seed frames included, of ``h(poses - target; 0.1)``.

    ``h(d; b) = d^2 / 2b`` where ``|d| < b``, else ``|d| - b/2``: smooth L1 with beta 0.1, ten times
    torch's Huber loss with delta 0.1.
    """
    return functional.smooth_l1_loss(poses, target, beta=RECONSTRUCTION_BETA)


def diversity_loss(poses: Tensor, other_poses: Tensor, z: Tensor, other_z: Tensor) -> Tensor:
    """Rewards poses that differ when the style does (equation 4, as the published code has it).

    Per item ``-sum h(poses - other; 0.05) / (mean |z - other_z| + 1e-5)``, no less than -1000; then
    the mean over items. The paper divides a mean by a sum. Gradient reaches ``poses`` alone.

    Args:
        poses: ``(B, T, 27)`` for style ``z``.
        other_poses: ``(B, T, 27)`` for style ``other_z``, same speech and seeds.
        z: ``(B, style_size)``.
        other_z: ``(B, style_size)``.
    """
    change = functional.smooth_l1_loss(
        poses, other_poses.detach(), beta=DIVERSITY_BETA, reduction="none"
    )
    distance = (z - other_z).detach().abs().mean(dim=1) + 1e-5
    return torch.clamp(-change.sum(dim=(1, 2)) / distance, min=-DIVERSITY_CLAMP).mean()


def style_divergence(mu: Tensor, logvar: Tensor) -> Tensor:
    """KL divergence from N(0, I), averaged over items and dimensions (the usual form sums both)."""
    return -0.5 * torch.mean(1 + logvar - mu.square() - logvar.exp())
