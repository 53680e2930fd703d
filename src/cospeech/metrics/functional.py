"""The formulas, as pure functions of tensors in float64."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

SEED_FRAMES = 4
"""Frames given to the method in the published evaluation; the joint error leaves them out."""


class FrechetTerms(NamedTuple):
    """The two parts of a Fréchet distance between Gaussians.

    The mean term needs far fewer samples than the covariance term to settle.

    Attributes:
        mean_term: Squared distance of the means.
        covariance_term: ``tr(A + B - 2 (A B)^(1/2))``.
    """

    mean_term: Tensor
    covariance_term: Tensor

    @property
    def total(self) -> Tensor:
        """The Fréchet distance: the sum of both terms."""
        return self.mean_term + self.covariance_term


def frechet_terms(mean_a: Tensor, cov_a: Tensor, mean_b: Tensor, cov_b: Tensor) -> FrechetTerms:
    """Both terms of the Fréchet distance between Gaussians (Yoon et al. 2020, equation 6).

    The trace of ``(A B)^(1/2)`` is the sum of the singular values of ``A^(1/2) B^(1/2)``, with the
    symmetric roots from eigenvalues. Unlike a general matrix root this stays real and accurate for
    singular covariances, so nothing is added to their diagonals.

    Args:
        mean_a: ``(..., d)``.
        cov_a: ``(..., d, d)``, symmetric, positive semi-definite up to rounding.
        mean_b: ``(..., d)``.
        cov_b: ``(..., d, d)``.

    Returns:
        Two tensors of the batch shape, float64.
    """
    mean_a, cov_a, mean_b, cov_b = (value.double() for value in (mean_a, cov_a, mean_b, cov_b))
    mean_term = (mean_a - mean_b).square().sum(-1)
    root_trace = torch.linalg.svdvals(_symmetric_root(cov_a) @ _symmetric_root(cov_b)).sum(-1)
    traces = (cov_a + cov_b).diagonal(dim1=-2, dim2=-1).sum(-1)
    return FrechetTerms(mean_term, traces - 2 * root_trace)


def _symmetric_root(matrix: Tensor) -> Tensor:
    values, vectors = torch.linalg.eigh((matrix + matrix.mT) / 2)
    return (vectors * values.clamp_min(0).sqrt().unsqueeze(-2)) @ vectors.mT


def frechet_distance(mean_a: Tensor, cov_a: Tensor, mean_b: Tensor, cov_b: Tensor) -> Tensor:
    """Fréchet distance between two Gaussians; see `frechet_terms` for arguments and method."""
    return frechet_terms(mean_a, cov_a, mean_b, cov_b).total


def kernel_distance(features_a: Tensor, features_b: Tensor, paired: bool = False) -> Tensor:
    """Unbiased squared kernel distance with the kernel ``(x . y / d + 1)^3`` (that of KID).

    Its expectation does not depend on the number of samples and it may come out slightly negative.
    The cubic kernel is expanded into sums of first, second and third moments, which is exact and
    costs ``n d^3`` instead of ``n^2 d``. Like any polynomial kernel's, the value depends on
    where the features have their origin: compare it for one encoder only.

    Args:
        features_a: ``(n, d)`` with n >= 2.
        features_b: ``(m, d)`` with m >= 2.
        paired: Row i of both sides belongs together (generated and real motion for one speech),
            so m = n and the n pairs are left out of the cross sum (Gretton et al. 2012,
            equation 4). Kept in, they bias it downwards; left out, identical sets give 0.

    Returns:
        Scalar, float64.

    Raises:
        ValueError: Fewer than two samples on a side, or pairs of different number.
    """
    count_a, count_b = len(features_a), len(features_b)
    if min(count_a, count_b) < 2:
        raise ValueError(f"a kernel distance needs two samples a side, got {count_a} and {count_b}")
    if paired:
        _require_same_shape(features_a, features_b)
    a, b = features_a.double(), features_b.double()
    powers_a, powers_b = _power_sums(a), _power_sums(b)
    size = a.shape[1]

    def all_pairs(left: tuple[Tensor, ...], right: tuple[Tensor, ...]) -> Tensor:
        first, second, third = ((x * y).sum() for x, y in zip(left, right, strict=True))
        return 3 * first / size + 3 * second / size**2 + third / size**3

    def same_rows(left: Tensor, right: Tensor) -> Tensor:
        return (((left * right).sum(1) / size + 1) ** 3 - 1).sum()

    # The kernel's constant 1 has been left out everywhere: it cancels.
    within_a = (all_pairs(powers_a, powers_a) - same_rows(a, a)) / (count_a * (count_a - 1))
    within_b = (all_pairs(powers_b, powers_b) - same_rows(b, b)) / (count_b * (count_b - 1))
    across = all_pairs(powers_a, powers_b)
    if paired:
        across = (across - same_rows(a, b)) / (count_a * (count_a - 1))
    else:
        across = across / (count_a * count_b)
    return within_a + within_b - 2 * across


def _power_sums(features: Tensor, chunk: int = 4096) -> tuple[Tensor, Tensor, Tensor]:
    """Sums of x, x ⊗ x and x ⊗ x ⊗ x; by chunks, because the outer products are large."""
    size = features.shape[1]
    third = features.new_zeros(size, size * size)
    for x in features.split(chunk):
        third += x.T @ (x.unsqueeze(2) * x.unsqueeze(1)).flatten(1)
    return features.sum(0), features.T @ features, third


def feature_distance(features_generated: Tensor, features_real: Tensor) -> Tensor:
    """Mean L1 distance between paired features, summed over dimensions.

    See docs/facts/trimodal.md, section 4.2.

    Args:
        features_generated: ``(B, d)``.
        features_real: ``(B, d)``, row i of the same window as row i of the generated ones.

    Returns:
        Scalar, float64, in the encoder's own unit.
    """
    _require_same_shape(features_generated, features_real)
    return (features_generated.double() - features_real.double()).abs().sum(-1).mean()


def joint_mae(generated: Tensor, real: Tensor, seed_frames: int = SEED_FRAMES) -> Tensor:
    """Mean absolute error per joint coordinate, metres (docs/facts/trimodal.md, section 4.3).

    The root counts like every other joint, so ten joints of which one never errs.

    Args:
        generated: ``(B, T, 10, 3)`` root-relative positions, metres.
        real: The same shape.
        seed_frames: Leading frames that were given to the method and are left out.

    Returns:
        Scalar, float64.
    """
    _require_same_shape(generated, real)
    return (generated - real)[:, seed_frames:].double().abs().mean()


def position_error(generated: Tensor, real: Tensor, seed_frames: int = SEED_FRAMES) -> Tensor:
    """Mean distance of a joint from where it was recorded: the average position error, metres.

    Args:
        generated: ``(B, T, J, 3)`` positions, metres.
        real: The same shape.
        seed_frames: Leading frames that were given to the method and are left out.

    Returns:
        ``(B,)`` float64, per window.
    """
    return _distances(generated, real, seed_frames).mean((1, 2))


def root_mean_square_error(
    generated: Tensor, real: Tensor, seed_frames: int = SEED_FRAMES
) -> Tensor:
    """Root of the mean squared distance of a joint from where it was recorded, metres.

    Kucherenko et al. 2020 print such a number (table 3) and neither the paper nor its code says
    over what the mean goes; here it is over frames and joints.

    Args:
        generated: As for `position_error`, like the others.
        real: See `position_error`.
        seed_frames: See `position_error`.

    Returns:
        ``(B,)`` float64, per window; never below `position_error`.
    """
    return _distances(generated, real, seed_frames).square().mean((1, 2)).sqrt()


def _distances(generated: Tensor, real: Tensor, seed_frames: int) -> Tensor:
    """``(B, T - seed_frames, J)`` distances of joints."""
    _require_same_shape(generated, real)
    return (generated.double() - real.double())[:, seed_frames:].norm(dim=-1)


def acceleration_error(generated: Tensor, real: Tensor) -> Tensor:
    """Mean absolute difference of second frame differences over all frames.

    See docs/facts/trimodal.md, section 4.3.

    Args:
        generated: ``(B, T, 10, 3)`` root-relative positions, metres, T >= 3.
        real: The same shape.

    Returns:
        Scalar, float64, metres per squared frame: no factor for the frame rate, as published.
    """
    _require_same_shape(generated, real)
    return torch.diff(generated.double() - real.double(), n=2, dim=1).abs().mean()


def _require_same_shape(generated: Tensor, real: Tensor) -> None:
    if generated.shape != real.shape:
        raise ValueError(
            f"generated {tuple(generated.shape)} and real {tuple(real.shape)} must be pairs"
        )
