"""How the metrics answer to known disturbances (Yoon et al. 2020, section 5.2 and figure 4)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import torch
from torch import Tensor

from cospeech.metrics import disturbances
from cospeech.metrics.encoder import GestureEncoder
from cospeech.metrics.functional import frechet_terms, joint_mae
from cospeech.metrics.moments import feature_moments

LEVELS: dict[str, tuple[float, ...]] = {
    "gaussian": (0.0003, 0.001, 0.003),
    "salt_and_pepper": (0.03, 0.1, 0.2),
    "temporal": (1, 5, 10),
    "multiplicative": (0.0, 0.5, 1.5, 2.0),
    "mismatched": (0.2, 0.5, 1.0),
}
"""Disturbance -> levels of zeta.

The paper's text names gaussian 0.001, salt-and-pepper 0.1, temporal 5, multiplicative 0 and 2, and
mismatched 0.2 and 0.5; the levels around them, which only its figure shows, are ours. There are 16
of them, as many as the paper's user study counts (14, and two mismatched ones left out).
"""


class NoiseRow(NamedTuple):
    """One disturbance at one level.

    Attributes:
        disturbance: A key of `LEVELS`.
        zeta: Its level.
        fgd: Fréchet gesture distance to the undisturbed windows.
        mean_term: Its mean term.
        covariance_term: Its covariance term.
        joint_mae: Mean absolute difference of joint coordinates over all frames, metres.
    """

    disturbance: str
    zeta: float
    fgd: float
    mean_term: float
    covariance_term: float
    joint_mae: float


def run_noise_study(
    encoder: GestureEncoder,
    positions: Tensor,
    seed: int = 0,
    levels: Mapping[str, tuple[float, ...]] = LEVELS,
) -> list[NoiseRow]:
    """Disturb real windows and measure how far each disturbance takes them.

    Noise keeps the paper's ratio to bone length (see `cospeech.metrics.disturbances`). Each
    disturbance sees the same draws at all its levels, so a curve shows the level alone.

    Args:
        encoder: The frozen encoder.
        positions: ``(N, 34, 10, 3)`` real windows, metres; N should be well over 32.
        seed: Of all draws.
        levels: Disturbance -> levels of zeta.

    Returns:
        One row per disturbance and level, in the order of ``levels``.

    Raises:
        ValueError: An unknown disturbance.
    """
    scale = disturbances.published_scale(positions)
    mean_pose = positions.double().mean((0, 1)).float()
    disturb: dict[str, Callable[[float, torch.Generator], Tensor]] = {
        "gaussian": lambda zeta, draw: disturbances.gaussian(positions, zeta, scale, draw),
        "salt_and_pepper": lambda zeta, draw: disturbances.salt_and_pepper(
            positions, zeta, scale, draw
        ),
        "temporal": lambda zeta, draw: disturbances.temporal(positions, int(zeta), scale, draw),
        "multiplicative": lambda zeta, _: disturbances.multiplicative(positions, zeta, mean_pose),
        "mismatched": lambda zeta, draw: disturbances.mismatched(positions, zeta, draw),
    }
    unknown = sorted(set(levels) - set(disturb))
    if unknown:
        raise ValueError(f"unknown disturbances {unknown}; known are {sorted(disturb)}")
    real = feature_moments(encoder.encode_all(positions)).mean_and_covariance()
    rows = []
    for name, zetas in levels.items():
        for zeta in zetas:
            disturbed = disturb[name](zeta, torch.Generator().manual_seed(seed))
            features = encoder.encode_all(disturbed)
            terms = frechet_terms(*real, *feature_moments(features).mean_and_covariance())
            error = joint_mae(disturbed, positions, seed_frames=0)
            numbers = (terms.total, terms.mean_term, terms.covariance_term, error)
            rows.append(NoiseRow(name, zeta, *(number.item() for number in numbers)))
    return rows
