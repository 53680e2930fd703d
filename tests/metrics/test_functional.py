"""The formulas against SciPy, NumPy, brute force and arithmetic by hand."""

import numpy as np
import pytest
import scipy.linalg
import torch

from cospeech.metrics.functional import (
    acceleration_error,
    feature_distance,
    frechet_distance,
    frechet_terms,
    joint_mae,
    kernel_distance,
    position_error,
    root_mean_square_error,
)
from cospeech.metrics.moments import feature_moments, recording_moments


def scipy_frechet(mean_a, cov_a, mean_b, cov_b):
    root = scipy.linalg.sqrtm(cov_a @ cov_b)
    return np.sum((mean_a - mean_b) ** 2) + np.trace(cov_a + cov_b - 2 * np.real(root))


def gaussian(seed, size=32, rank=None):
    random = np.random.RandomState(seed)
    factor = random.standard_normal((size, size if rank is None else rank))
    return random.standard_normal(size), factor @ factor.T


@pytest.mark.parametrize("seed", range(5))
def test_frechet_distance_equals_scipy(seed):
    a, b = gaussian(seed), gaussian(seed + 50)
    ours = frechet_distance(*map(torch.from_numpy, (*a, *b))).item()
    assert ours == pytest.approx(scipy_frechet(*a, *b), rel=1e-10)


def test_frechet_distance_of_nearly_singular_covariances_equals_scipy():
    """Eigenvalues from 1 down to 1e-9: what a method with little variety gives."""
    random = np.random.RandomState(0)
    covariances = []
    for _ in range(2):
        axes, _ = np.linalg.qr(random.standard_normal((32, 32)))
        covariances.append((axes * np.logspace(0, -9, 32)) @ axes.T)
    mean = np.zeros(32)
    ours = frechet_distance(
        *map(torch.from_numpy, (mean, covariances[0], mean, covariances[1]))
    ).item()
    assert ours == pytest.approx(
        scipy_frechet(mean, covariances[0], mean, covariances[1]), abs=1e-6
    )


def test_frechet_distance_of_singular_covariances_has_a_closed_form():
    """Commuting covariances: the squared distance of the standard deviations, zeros included."""
    deviations_a, deviations_b = np.array([3.0, 2.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.5, 0.0])
    axes, _ = np.linalg.qr(np.random.RandomState(3).standard_normal((4, 4)))
    cov_a, cov_b = ((axes * d**2) @ axes.T for d in (deviations_a, deviations_b))
    mean = np.zeros(4)
    ours = frechet_distance(*map(torch.from_numpy, (mean, cov_a, mean, cov_b))).item()
    # A zero eigenvalue is known to 1e-16 from the matrix, hence its root to 1e-8.
    assert ours == pytest.approx(np.sum((deviations_a - deviations_b) ** 2), abs=1e-6)


def test_identical_gaussians_are_at_distance_zero_even_when_singular():
    for rank in (None, 3):
        mean, cov = map(torch.from_numpy, gaussian(7, rank=rank))
        assert abs(frechet_distance(mean, cov, mean, cov).item()) < 1e-11


def test_terms_separate_a_shift_from_a_scale():
    mean, cov = torch.zeros(3), torch.eye(3)
    shifted = frechet_terms(mean, cov, mean + 2, cov)
    assert (shifted.mean_term.item(), shifted.covariance_term.item()) == pytest.approx((12, 0))
    scaled = frechet_terms(mean, cov, mean, 9 * cov)
    assert (scaled.mean_term.item(), scaled.covariance_term.item()) == pytest.approx((0, 12))


def test_batched_distances_equal_single_ones():
    pairs = [(gaussian(seed), gaussian(seed + 9)) for seed in range(3)]
    single = [frechet_distance(*map(torch.from_numpy, (*a, *b))) for a, b in pairs]
    stacked = [
        torch.from_numpy(np.stack(x)) for x in zip(*[(*a, *b) for a, b in pairs], strict=True)
    ]
    torch.testing.assert_close(frechet_distance(*stacked), torch.stack(single))


def test_moments_equal_numpy_far_from_the_origin():
    """Uncentred float64 sums: a mean a hundred times the deviation still leaves ten digits."""
    features = torch.randn(26_752, 8, generator=torch.Generator().manual_seed(1)) * 0.2 + 20
    mean, cov = feature_moments(features).mean_and_covariance()
    np.testing.assert_allclose(mean, features.double().numpy().mean(0), rtol=1e-12)
    np.testing.assert_allclose(cov, np.cov(features.double().numpy().T), rtol=1e-8, atol=1e-11)


def test_recording_moments_keep_recordings_apart():
    features = torch.tensor([[1.0, 0.0], [2.0, 1.0], [3.0, 5.0]])
    moments = recording_moments(features, ["b", "a", "b"])
    assert moments.samples.tolist() == [2, 1]
    assert moments.total.tolist() == [[4, 5], [2, 1]]
    assert moments.outer[0].tolist() == [[10, 15], [15, 25]]
    with pytest.raises(ValueError, match="2 recording ids for 3 rows"):
        recording_moments(features, ["a", "b"])


def brute_force_mmd(a, b, paired):
    def kernel(x, y):
        return (float(x @ y) / len(x) + 1) ** 3

    n, m = len(a), len(b)
    within_a = sum(kernel(a[i], a[j]) for i in range(n) for j in range(n) if i != j) / (n * (n - 1))
    within_b = sum(kernel(b[i], b[j]) for i in range(m) for j in range(m) if i != j) / (m * (m - 1))
    pairs = [(i, j) for i in range(n) for j in range(m) if not (paired and i == j)]
    return within_a + within_b - 2 * sum(kernel(a[i], b[j]) for i, j in pairs) / len(pairs)


@pytest.mark.parametrize(("count", "paired"), [(9, False), (12, True)])
def test_kernel_distance_equals_the_double_sum(count, paired):
    random = np.random.RandomState(4)
    a, b = random.standard_normal((12, 5)) * 3, random.standard_normal((count, 5)) + 1
    ours = kernel_distance(torch.from_numpy(a), torch.from_numpy(b), paired).item()
    assert ours == pytest.approx(brute_force_mmd(a, b, paired), rel=1e-10)


def test_kernel_distance_is_unbiased_where_the_frechet_distance_is_not():
    """Two samples of one Gaussian, 60 windows each: the mean over repeats is within noise of 0."""
    generator = torch.Generator().manual_seed(0)
    kernel, frechet = [], []
    for _ in range(200):
        a, b = torch.randn(2, 60, 8, generator=generator)
        kernel.append(kernel_distance(a, b).item())
        moments = (
            feature_moments(a).mean_and_covariance() + feature_moments(b).mean_and_covariance()
        )
        frechet.append(frechet_distance(*moments).item())
    assert abs(np.mean(kernel)) < 3 * np.std(kernel) / 200**0.5
    assert np.mean(frechet) > 20 * np.std(frechet) / 200**0.5


def test_paired_kernel_distance_of_identical_sets_is_zero():
    features = torch.randn(50, 6, generator=torch.Generator().manual_seed(2)) * 10
    assert abs(kernel_distance(features, features, paired=True).item()) < 1e-9
    # Unpaired, each window's kernel with itself is in the cross sum only: biased far below 0.
    assert kernel_distance(features, features).item() < -1000


def test_joint_mae_leaves_seed_frames_out_and_counts_the_root():
    real = torch.zeros(2, 34, 10, 3)
    generated = real.clone()
    generated[:, :4] = 100.0
    generated[0, 4:, 1:] = 0.1
    # One window of two errs by 0.1 on nine joints of ten.
    assert joint_mae(generated, real).item() == pytest.approx(0.1 * 0.9 / 2)
    with pytest.raises(ValueError, match="must be pairs"):
        joint_mae(generated, real[:1])


def test_distances_of_joints_from_where_they_were_recorded():
    """One joint of ten is 5 m off in one frame of thirty, and 13 m in another."""
    real = torch.zeros(2, 34, 10, 3)
    generated = real.clone()
    generated[:, :4] = 100.0
    generated[1, 4, 7] = torch.tensor([3.0, 0.0, -4.0])
    generated[1, 20, 7] = torch.tensor([-3.0, 12.0, 4.0])
    assert position_error(generated, real).tolist() == pytest.approx([0, 18 / 300])
    squares = (25 + 169) / 300
    assert root_mean_square_error(generated, real).tolist() == pytest.approx([0, squares**0.5])
    assert position_error(generated, real, 0)[0].item() == pytest.approx(100 * 3**0.5 * 4 / 34)
    with pytest.raises(ValueError, match="must be pairs"):
        position_error(generated, real[:1])


def test_acceleration_error_of_a_parabola():
    """x = t² / 2 has second difference 1 everywhere, on one coordinate of thirty."""
    real = torch.zeros(1, 34, 10, 3)
    generated = real.clone()
    generated[0, :, 5, 1] = torch.arange(34.0) ** 2 / 2
    assert acceleration_error(generated, real).item() == pytest.approx(1 / 30)


def test_feature_distance_sums_dimensions_and_averages_samples():
    assert feature_distance(torch.tensor([[1.0, -2.0], [0.0, 0.0]]), torch.zeros(2, 2)) == 1.5
