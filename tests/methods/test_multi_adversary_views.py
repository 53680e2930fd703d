"""What adversaries are shown: units, window borders, and the way back to the generator."""

import numpy as np
import pytest
import torch

from cospeech.adversarial.settings import checked_settings
from cospeech.errors import ConfigError
from cospeech.methods.multi_adversary import MultiAdversary
from cospeech.methods.multi_adversary.adversaries import ADVERSARIES, WindowAdversary
from tests import multi_adversary_runs as runs


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """The embedded corpus: fingers, five spine joints, phases, 60 fps."""
    return runs.embedded_store(tmp_path_factory.mktemp("s") / "s")


@pytest.fixture(scope="module")
def batch(store):
    method = runs.build(store)
    return next(iter(runs.loader(method, store, "train", runs=2)))


@pytest.fixture
def method(store, batch):
    """With the batch's statistics, and a classifier of first weights."""
    method = runs.build(store)
    method.players.fit_scales([batch], list(method.layout.arms))
    method.views.classifier = method.players.student.frozen()
    return method


def view(method, name, poses, acoustics):
    return method.players.adversaries[name].view(method.views, poses, acoustics)


def checked(settings):
    return checked_settings(settings, ADVERSARIES, WindowAdversary, [MultiAdversary])


def test_the_paper_s_joints_are_there(method, batch):
    assert batch.joints.shape == (4, 100, 21, 3)
    assert len(method.layout.arms) == 16
    assert len(method.layout.finger_tips) == 10


def test_poses_have_mean_0_and_deviation_1_and_come_back_in_metres(method, batch):
    scales = method.players.scales
    poses = scales.poses(batch.joints)
    assert poses.shape == (4, 100, 63)
    torch.testing.assert_close(scales.joints(poses), batch.joints, atol=1e-5, rtol=0)
    moving = batch.joints.flatten(0, 1).std(dim=0).flatten() > 2e-3
    flat = poses.flatten(0, 1)[:, moving]
    torch.testing.assert_close(flat.mean(dim=0), torch.zeros(int(moving.sum())), atol=1e-3, rtol=0)
    torch.testing.assert_close(
        flat.std(dim=0, correction=0), torch.ones(int(moving.sum())), atol=1e-3, rtol=0
    )
    speech = scales.speech(batch.acoustics).flatten(0, 1)
    torch.testing.assert_close(speech.mean(dim=0), torch.zeros(27), atol=1e-3, rtol=0)


def test_displacements_are_metres_per_second_z_scored_the_same_for_real_and_generated(
    method, batch
):
    scales = method.players.scales
    arms = batch.joints[:, :, list(method.layout.arms)].double()
    velocity = (arms[:, 1:] - arms[:, :-1]).flatten(-2) * 20
    expected = (velocity - velocity.mean(dim=(0, 1))) / velocity.flatten(0, 1).std(
        dim=0, correction=0
    )
    shown = view(method, "displacement", scales.poses(batch.joints), batch.acoustics)
    torch.testing.assert_close(shown.double(), expected, atol=5e-3, rtol=1e-3)
    # A generator that puts out the real poses is shown as the same.
    generated = scales.poses(batch.joints).clone().requires_grad_()
    again = view(method, "displacement", generated, batch.acoustics)
    torch.testing.assert_close(again.detach(), shown)


def test_no_view_crosses_from_one_window_to_another(method, batch):
    scales = method.players.scales
    poses = scales.poses(batch.joints)
    changed = poses.clone()
    changed[1] += 3.0
    for name, steps in (("phase", 99), ("motion", 100), ("displacement", 99), ("minibatch", 100)):
        before = view(method, name, poses, batch.acoustics)
        after = view(method, name, changed, batch.acoustics)
        assert before.shape[:2] == (4, steps)
        assert torch.equal(before[[0, 2, 3]], after[[0, 2, 3]]), name


def test_the_views_have_the_papers_channels(method, batch):
    poses = method.players.scales.poses(batch.joints)
    channels = {
        name: view(method, name, poses, batch.acoustics).shape[-1]
        for name in ("phase", "motion", "minibatch", "displacement")
    }
    assert channels == {"phase": 4 + 1, "motion": 63 + 27, "minibatch": 63, "displacement": 48}


def test_the_gradient_through_the_frozen_classifier_is_the_finite_difference(method, batch):
    """docs/facts/multi_adversary.md, section 7, trap 2, in float64, for a direction and for single
    coordinates."""
    views, adversary = method.views, method.players.adversaries["phase"].double().eval()
    for module in (method.players.scales, views.classifier):
        module.double()
    acoustics = batch.acoustics.double()
    poses = method.players.scales.poses(batch.joints.double()).requires_grad_()

    def loss(values):
        return adversary.generator_loss(adversary.view(views, values, acoustics))

    (gradient,) = torch.autograd.grad(loss(poses), poses)
    assert float(gradient.abs().max()) > 0
    torch.manual_seed(0)
    directions = [torch.randn_like(poses)]
    for place in gradient.abs().flatten().topk(3).indices:
        unit = torch.zeros(poses.numel(), dtype=torch.float64)
        unit[place] = 1
        directions.append(unit.view_as(poses))
    step = 1e-5
    for direction in directions:
        with torch.no_grad():
            difference = loss(poses + step * direction) - loss(poses - step * direction)
        expected = float((gradient * direction).sum())
        assert float(difference) / (2 * step) == pytest.approx(expected, rel=1e-4, abs=1e-10)


def test_hard_labels_are_one_hot_for_both_and_still_have_a_gradient(method, batch):
    poses = method.players.scales.poses(batch.joints)
    soft = view(method, "phase", poses, batch.acoustics)[..., :4]
    method.views.labels = "hard"
    generated = poses.clone().requires_grad_()
    shown = view(method, "phase", generated, batch.acoustics)[..., :4]
    np.testing.assert_allclose(shown.detach().sort(dim=-1).values[..., :3], 0, atol=1e-6)
    assert torch.equal(shown.detach().argmax(-1), soft.argmax(-1))
    assert torch.equal(view(method, "phase", poses, batch.acoustics)[..., :4], shown.detach())
    shown[..., 1].sum().backward()
    assert float(generated.grad.abs().max()) > 0


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"phrase": {"weight": 1}}, "phrase.*phase, motion, minibatch, displacement"),
        ({"phase": {"dense": 8}}, "phase has no weight"),
        ({"phase": {"weight": -1}}, "weight=-1: must not be negative"),
        ({"phase": {"weight": 1, "widht": 3}}, "phase.widht: no such setting.*dense"),
        ({"phase": {"weight": 1, "dense": 2.5}}, "dense=2.5: a whole number"),
        ({"motion": {"weight": 1, "dropout": 1.0}}, "dropout=1.0: from 0 to below 1"),
        ({"motion": {"weight": "much"}}, "not a number"),
        ({"motion": {"weight": 1, "loss": "hinge"}}, "'hinge'.*non_saturating, least_squares"),
        ({"motion": {"weight": 1, "loss": 3}}, "loss=3: not like 'non_saturating'"),
    ],
)
def test_wrong_adversaries_are_refused_by_name(settings, message):
    with pytest.raises(ConfigError, match=message):
        checked(settings)


def test_adversaries_keep_their_order_and_a_null_leaves_one_out():
    settings = {"displacement": {"weight": 1}, "motion": None, "phase": {"weight": 2, "dense": 7}}
    found = checked(settings)
    assert list(found) == ["phase", "displacement"]
    assert found["phase"].arguments == {
        "weight": 2, "loss": "non_saturating", "dense": 7, "hidden": 64, "dropout": 0.3
    }  # fmt: skip
