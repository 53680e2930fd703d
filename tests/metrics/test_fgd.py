"""The Fréchet gesture distance over batches, processes and epochs, and its sibling metrics."""

import io
import pickle

import numpy as np
import pytest
import scipy.linalg
import torch
import torch.distributed as distributed
import torch.multiprocessing as multiprocessing
from lightning import LightningModule

from cospeech.metrics.acceleration_error import AccelerationError
from cospeech.metrics.encoder import FEATURE_SIZE, GestureEncoder, PoseAutoencoder
from cospeech.metrics.evaluation_windows import EvaluationWindows
from cospeech.metrics.feature_distance import FeatureDistance
from cospeech.metrics.fgd import FrechetGestureDistance
from cospeech.metrics.functional import (
    acceleration_error,
    feature_distance,
    joint_mae,
    kernel_distance,
)
from cospeech.metrics.joint_mae import JointMAE
from cospeech.metrics.kernel_distance import KernelDistance


def make_encoder():
    torch.manual_seed(0)
    return GestureEncoder(PoseAutoencoder(), [0.0] * 27)


def windows(count, seed, scale=1.0):
    return torch.randn(count, 34, 10, 3, generator=torch.Generator().manual_seed(seed)) * scale


def shifted(count, seed):
    return windows(count, seed) + torch.linspace(0, 3, 30).view(10, 3)


@pytest.fixture(scope="module")
def encoder():
    return make_encoder()


def encoded(encoder, positions):
    return EvaluationWindows(positions, encoder.encode_positions(positions))


NOTHING = EvaluationWindows(torch.zeros(0, 34, 10, 3), torch.zeros(0, FEATURE_SIZE))


def filled(encoder, real, generated, batch_size=40):
    metric = FrechetGestureDistance()
    for batch in real.split(batch_size):
        metric.update(NOTHING, encoded(encoder, batch))
    for batch in generated.split(batch_size):
        metric.update(encoded(encoder, batch), NOTHING)
    return metric


def distance(metric):
    return metric.compute()["value"].item()


def test_equals_numpy_and_scipy_on_the_features(encoder):
    real, generated = windows(150, 1), shifted(120, 2)
    a, b = (encoder.encode_positions(x).double().numpy() for x in (real, generated))
    cov_a, cov_b = np.cov(a.T), np.cov(b.T)
    root = scipy.linalg.sqrtm(cov_a @ cov_b).real
    mean_term = ((a.mean(0) - b.mean(0)) ** 2).sum()
    expected = mean_term + np.trace(cov_a + cov_b - 2 * root)
    metric = filled(encoder, real, generated)
    # The encoder's float32 output varies with batch size, in its seventh digit.
    values = metric.compute()
    assert values["value"].item() == pytest.approx(expected, rel=1e-5)
    assert values["value"].dtype == torch.float64
    assert values["mean_term"].item() == pytest.approx(mean_term, rel=1e-5)
    assert values["mean_term"] + values["covariance_term"] == values["value"]


def test_identical_sets_are_at_distance_zero_whatever_the_order(encoder):
    real = windows(100, 1)
    scale = distance(filled(encoder, real, shifted(100, 2)))
    assert abs(distance(filled(encoder, real, real.flip(0)))) < 1e-6 * scale


def test_merged_halves_equal_the_whole(encoder):
    real, generated = windows(160, 1), shifted(160, 2)
    whole = filled(encoder, real, generated)
    half = filled(encoder, real[:80], generated[:40])
    half.merge_state(filled(encoder, real[80:], generated[40:]))
    assert half.real_samples.item() == 160
    assert distance(half) == pytest.approx(distance(whole), rel=1e-9)


def test_forward_adds_each_window_once(encoder):
    metric = FrechetGestureDistance()
    for batch in windows(80, 1).split(40):
        metric(NOTHING, encoded(encoder, batch))
    assert metric.real_samples.item() == 80


def test_reset_inside_inference_mode_leaves_a_usable_metric(encoder):
    metric = filled(encoder, windows(40, 1), shifted(40, 2))
    with torch.inference_mode():
        metric.reset()
    metric.update(NOTHING, encoded(encoder, windows(40, 1)))
    assert metric.real_samples.item() == 40


def test_refuses_fewer_than_two_windows_a_side(encoder):
    metric = filled(encoder, windows(40, 1), windows(1, 2))
    with pytest.raises(RuntimeError, match="two windows or more on each side, got 40 real and 1"):
        metric.compute()


def test_warns_when_covariances_are_singular(encoder):
    with pytest.warns(UserWarning, match="40 real and 32 generated windows in 32 dimensions"):
        filled(encoder, windows(40, 1), windows(32, 2)).compute()


class Owner(LightningModule):
    def __init__(self):
        super().__init__()
        self.weight = torch.nn.Parameter(torch.zeros(1))
        self.fgd = FrechetGestureDistance()


def test_sums_stay_exact_in_a_module_of_half_precision():
    owner = Owner().half()
    assert list(owner.state_dict()) == ["weight"]
    assert owner.fgd.real_total.dtype == torch.float64


def test_pickled_and_checkpointed_state_gives_the_same_value(encoder):
    metric = filled(encoder, windows(80, 1), shifted(80, 2))
    expected = distance(metric)
    copy = pickle.loads(pickle.dumps(metric))
    assert distance(copy) == expected

    metric.persistent(True)
    buffer = io.BytesIO()
    torch.save(metric.state_dict(), buffer)
    buffer.seek(0)
    restored = FrechetGestureDistance()
    restored.load_state_dict(torch.load(buffer, weights_only=True))
    with pytest.warns(UserWarning, match="before the ``update``"):
        assert distance(restored) == expected


def _share_of_a_process(rank, address, results):
    torch.set_num_threads(1)
    distributed.init_process_group("gloo", init_method=address, rank=rank, world_size=2)
    encoder = make_encoder()
    metric = filled(encoder, windows(80, 1)[rank::2], shifted(80, 2)[rank::2])
    error = JointMAE()
    # Unequal shares: the value must be weighted by windows, not by processes.
    share = slice(0, 60) if rank == 0 else slice(60, 80)
    generated, real = shifted(80, 2), windows(80, 1)
    error.update(encoded(encoder, generated[share]), encoded(encoder, real[share]))
    values = (distance(metric), error.compute().item())
    if rank == 0:
        results.put((*values, metric.real_samples.item()))
    distributed.destroy_process_group()


@pytest.mark.slow
def test_two_processes_equal_one(encoder, tmp_path):
    context = multiprocessing.get_context("spawn")
    results = context.SimpleQueue()
    address = f"file://{tmp_path / 'rendezvous'}"
    processes = [
        context.Process(target=_share_of_a_process, args=(rank, address, results))
        for rank in range(2)
    ]
    for process in processes:
        process.start()
    for process in processes:
        process.join(120)
        assert process.exitcode == 0
    value, error, local_count = results.get()
    real, generated = windows(80, 1), shifted(80, 2)
    assert value == pytest.approx(distance(filled(encoder, real, generated)), rel=1e-9)
    assert error == pytest.approx(joint_mae(generated, real).item(), rel=1e-9)
    # Only the value is shared: a process keeps its own sums for the next epoch.
    assert local_count == 40


@pytest.mark.parametrize(
    ("make", "function"),
    [
        (JointMAE, lambda a, b: joint_mae(a.positions, b.positions)),
        (lambda: JointMAE(seed_frames=0), lambda a, b: joint_mae(a.positions, b.positions, 0)),
        (AccelerationError, lambda a, b: acceleration_error(a.positions, b.positions)),
        (FeatureDistance, lambda a, b: feature_distance(a.features, b.features)),
        (KernelDistance, lambda a, b: kernel_distance(a.features, b.features, paired=True)),
    ],
    ids=["joint_mae", "joint_mae_all_frames", "acceleration_error", "feature_distance", "kernel"],
)
def test_errors_over_uneven_batches_equal_the_function_on_all(encoder, make, function):
    real, generated = encoded(encoder, windows(23, 1)), encoded(encoder, shifted(23, 2))
    metric = make()
    for indices in torch.arange(23).split(10):
        metric.update(generated[indices], real[indices])
    assert metric.compute().item() == pytest.approx(function(generated, real).item(), rel=1e-6)
