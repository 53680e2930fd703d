"""Energy score: how far motion is from being one of those that a speech leaves open.

A speech leaves motion open: the same words are said with other gestures the next time. One
recording can't tell a system that makes what could have been from one that makes the average of it.
Several motions of each speech can: the score is least, and 0 in expectation, for the true
conditional distribution alone (Gneiting and Raftery 2007, section 4.2: it is strictly proper).
"""

from __future__ import annotations

from itertools import combinations

import torch
from torch import Tensor


def motion_distance(first: Tensor, second: Tensor) -> Tensor:
    """Root mean square distance of joints, over frames and joints.

    Args:
        first: ``(..., T, J, 3)`` positions in metres.
        second: The same.

    Returns:
        ``(...)`` metres.
    """
    return (first - second).square().sum(dim=-1).mean(dim=(-2, -1)).sqrt()


def energy_score(made: Tensor, real: Tensor) -> Tensor:
    """``mean |X - Y| - mean |X - X'| / 2 - mean |Y - Y'| / 2`` of each window.

    X are a system's motions and Y true ones of the same speech, X' and Y' others of them (never a
    motion and itself, so that each mean is unbiased), ``|.|`` is `motion_distance`. With one true
    motion the last mean is left out: scores of systems still compare, and 0 is nothing special.

    Args:
        made: ``(m, n, T, J, 3)`` positions in metres: m motions of n windows. One motion says that
            the system would make it again; two independent ones of a system that is random are the
            least.
        real: ``(r, n, T, J, 3)``, of the same speech.

    Returns:
        ``(n,)`` metres. A window's can be below 0 by chance.
    """
    across = torch.stack([motion_distance(one, true) for one in made for true in real]).mean(dim=0)
    return across - _spread(made) / 2 - _spread(real) / 2


def _spread(motions: Tensor) -> Tensor:
    """Mean distance of two of them; 0 of one."""
    pairs = list(combinations(range(len(motions)), 2))
    if not pairs:
        return motions.new_zeros(motions.shape[1])
    distances = [motion_distance(motions[i], motions[j]) for i, j in pairs]
    return torch.stack(distances).mean(dim=0)
