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
from torchmetrics import MetricCollection

from cospeech.metrics.acceleration_error import AccelerationError
from cospeech.metrics.encoder import GestureEncoder, PoseAutoencoder
from cospeech.metrics.feature_distance import FeatureDistance
from cospeech.metrics.fgd import FrechetGestureDistance
from cospeech.metrics.functional import acceleration_error, feature_distance, joint_mae
from cospeech.metrics.joint_mae import JointMAE


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


def filled(encoder, real, generated, batch_size=40, **options):
    metric = FrechetGestureDistance(encoder, **options)
    for batch in real.split(batch_size):
        metric.update(batch, real=True)
    for batch in generated.split(batch_size):
        metric.update(batch, real=False)
    return metric


def test_equals_numpy_and_scipy_on_the_features(encoder):
    real, generated = windows(150, 1), shifted(120, 2)
    a, b = (encoder.encode_positions(x).double().numpy() for x in (real, generated))
    cov_a, cov_b = np.cov(a.T), np.cov(b.T)
    root = scipy.linalg.sqrtm(cov_a @ cov_b).real
    mean_term = ((a.mean(0) - b.mean(0)) ** 2).sum()
    expected = mean_term + np.trace(cov_a + cov_b - 2 * root)
    metric = filled(encoder, real, generated)
    # The encoder's float32 output varies with batch size, in its seventh digit.
    assert metric.compute().item() == pytest.approx(expected, rel=1e-5)
    assert metric.compute().dtype == torch.float64
    terms = metric.terms()
    assert terms.mean_term.item() == pytest.approx(mean_term, rel=1e-5)
    assert terms.total.item() == metric.compute().item()


def test_identical_sets_are_at_distance_zero_whatever_the_order(encoder):
    real = windows(100, 1)
    scale = filled(encoder, real, shifted(100, 2)).compute().item()
    assert abs(filled(encoder, real, real.flip(0)).compute().item()) < 1e-6 * scale


def test_merged_halves_equal_the_whole(encoder):
    real, generated = windows(160, 1), shifted(160, 2)
    whole = filled(encoder, real, generated)
    half = filled(encoder, real[:80], generated[:40])
    half.merge_state(filled(encoder, real[80:], generated[40:]))
    assert half.real_samples.item() == 160
    assert half.compute().item() == pytest.approx(whole.compute().item(), rel=1e-9)


def test_kept_real_features_survive_reset(encoder):
    real, generated = windows(100, 1), shifted(100, 2)
    metric = filled(encoder, real, generated, reset_real_features=False)
    first = metric.compute().item()
    metric.reset()
    assert metric.has_real_features
    metric.update(generated, real=False)
    assert metric.compute().item() == pytest.approx(first, rel=1e-6)

    metric = filled(encoder, real, generated)
    metric.reset()
    assert not metric.has_real_features


def test_forward_adds_each_window_once(encoder):
    metric = FrechetGestureDistance(encoder, reset_real_features=False)
    for batch in windows(80, 1).split(40):
        metric(batch, real=True)
    assert metric.real_samples.item() == 80


def test_reset_inside_inference_mode_leaves_a_usable_metric(encoder):
    metric = filled(encoder, windows(40, 1), shifted(40, 2))
    with torch.inference_mode():
        metric.reset()
    metric.update(windows(40, 1), real=True)
    assert metric.real_samples.item() == 40


def test_refuses_fewer_than_two_windows_a_side(encoder):
    metric = filled(encoder, windows(40, 1), windows(1, 2))
    with pytest.raises(RuntimeError, match="two windows or more on each side, got 40 real and 1"):
        metric.compute()


def test_warns_when_covariances_are_singular(encoder):
    with pytest.warns(UserWarning, match="40 real and 32 generated windows in 32 dimensions"):
        filled(encoder, windows(40, 1), windows(32, 2)).compute()


def test_names_the_window_that_is_not_finite(encoder):
    positions = windows(5, 1)
    positions[3, 2, 1, 0] = float("nan")
    with pytest.raises(ValueError, match="window 3 of the batch has"):
        FrechetGestureDistance(encoder).update(positions, real=False)


class Owner(LightningModule):
    def __init__(self, encoder):
        super().__init__()
        self.weight = torch.nn.Parameter(torch.zeros(1))
        self.fgd = FrechetGestureDistance(encoder)
        self.collection = MetricCollection([self.fgd])
        self.features = FeatureDistance(encoder)


def test_encoder_belongs_to_no_module(encoder):
    owner = Owner(encoder).train()
    assert list(owner.state_dict()) == ["weight"]
    assert len(list(owner.parameters())) == 1
    assert owner.fgd.encoder is encoder
    owner.half()
    assert encoder.mean_direction.dtype == torch.float32
    assert owner.fgd.real_total.dtype == torch.float64


def test_pickled_and_checkpointed_state_gives_the_same_value(encoder):
    metric = filled(encoder, windows(80, 1), shifted(80, 2))
    expected = metric.compute().item()
    copy = pickle.loads(pickle.dumps(metric))
    assert copy.compute().item() == expected
    assert copy.encoder.sha256 == encoder.sha256

    metric.persistent(True)
    buffer = io.BytesIO()
    torch.save(metric.state_dict(), buffer)
    buffer.seek(0)
    restored = FrechetGestureDistance(encoder)
    restored.load_state_dict(torch.load(buffer, weights_only=True))
    with pytest.warns(UserWarning, match="before the ``update``"):
        assert restored.compute().item() == expected


def _share_of_a_process(rank, address, results):
    torch.set_num_threads(1)
    distributed.init_process_group("gloo", init_method=address, rank=rank, world_size=2)
    encoder = make_encoder()
    metric = filled(encoder, windows(80, 1)[rank::2], shifted(80, 2)[rank::2])
    error = JointMAE()
    # Unequal shares: the value must be weighted by windows, not by processes.
    share = slice(0, 60) if rank == 0 else slice(60, 80)
    error.update(shifted(80, 2)[share], windows(80, 1)[share])
    values = (metric.compute().item(), metric.terms().total.item(), error.compute().item())
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
    value, total, error, local_count = results.get()
    real, generated = windows(80, 1), shifted(80, 2)
    assert value == pytest.approx(filled(encoder, real, generated).compute().item(), rel=1e-9)
    assert total == value
    assert error == pytest.approx(joint_mae(generated, real).item(), rel=1e-9)
    # Only the value is shared: a process keeps its own sums for the next epoch.
    assert local_count == 40


@pytest.mark.parametrize(
    ("make", "function"),
    [
        (lambda _: JointMAE(), lambda _, a, b: joint_mae(a, b)),
        (lambda _: JointMAE(seed_frames=0), lambda _, a, b: joint_mae(a, b, 0)),
        (lambda _: AccelerationError(), lambda _, a, b: acceleration_error(a, b)),
        (
            FeatureDistance,
            lambda e, a, b: feature_distance(e.encode_positions(a), e.encode_positions(b)),
        ),
    ],
    ids=["joint_mae", "joint_mae_all_frames", "acceleration_error", "feature_distance"],
)
def test_errors_over_uneven_batches_equal_the_function_on_all(encoder, make, function):
    real, generated = windows(23, 1), shifted(23, 2)
    metric = make(encoder)
    for a, b in zip(generated.split(10), real.split(10), strict=True):
        metric.update(a, b)
    assert metric.compute().item() == pytest.approx(
        function(encoder, generated, real).item(), rel=1e-6
    )
