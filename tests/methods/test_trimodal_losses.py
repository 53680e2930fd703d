"""The trimodal losses by hand."""

import math

import pytest
import torch
from torch.nn import functional

from cospeech.methods.trimodal.losses import (
    diversity_loss,
    reconstruction_loss,
    style_divergence,
)


def test_reconstruction_by_hand():
    # h(.05; .1) = .0025 / .2 = .0125; h(.3; .1) = .3 - .05 = .25; mean of (0, .0125, .25)
    difference = torch.tensor([[[0.0, 0.05, -0.3]]])
    assert reconstruction_loss(difference, torch.zeros(1, 1, 3)).item() == pytest.approx(0.0875)


def test_reconstruction_is_ten_times_torchs_huber_loss():
    torch.manual_seed(0)
    a, b = torch.randn(2, 5, 27), torch.randn(2, 5, 27)
    huber = functional.huber_loss(a, b, delta=0.1)
    assert reconstruction_loss(a, b).item() == pytest.approx(10 * huber.item(), rel=1e-5)


def test_diversity_by_hand():
    poses = torch.tensor([[[0.01, 0.2]], [[0.0, 0.0]]])
    other = torch.zeros(2, 1, 2)
    z, other_z = torch.tensor([[1.0, 0.0], [0.0, 0.0]]), torch.tensor([[0.0, 0.0], [1.0, 0.0]])
    # item 0: (.0001 / .1 + .2 - .025) / (.5 + 1e-5) = .176 / .50001; item 1: 0
    assert diversity_loss(poses, other, z, other_z).item() == pytest.approx(-0.176 / 0.50001 / 2)


def test_diversity_is_clamped_per_item():
    poses, other = torch.ones(2, 34, 27), torch.zeros(2, 34, 27)
    z = torch.zeros(2, 16)
    other_z = torch.stack([torch.zeros(16), torch.ones(16)])
    # item 0: 918 * .975 / 1e-5 is far above 1000; item 1: 918 * .975 / 1.00001
    by_hand = -(1000 + 918 * 0.975 / 1.00001) / 2
    assert diversity_loss(poses, other, z, other_z).item() == pytest.approx(by_hand, rel=1e-5)


def test_diversity_gradient_reaches_the_poses_alone():
    torch.manual_seed(0)
    poses, other = (torch.randn(2, 3, 27, requires_grad=True) for _ in range(2))
    z, other_z = (torch.randn(2, 16, requires_grad=True) for _ in range(2))
    diversity_loss(poses, other, z, other_z).backward()
    assert poses.grad is not None
    assert other.grad is None
    assert z.grad is None
    assert other_z.grad is None


def test_style_divergence_by_hand():
    mu, logvar = torch.tensor([[1.0, 0.0]]), torch.tensor([[0.0, math.log(2.0)]])
    # -.5 * mean(1 + 0 - 1 - 1, 1 + ln 2 - 0 - 2) = .5 * mean(1, 1 - ln 2)
    by_hand = 0.5 * (1 + 1 - math.log(2)) / 2
    assert style_divergence(mu, logvar).item() == pytest.approx(by_hand)
    assert style_divergence(torch.zeros(3, 16), torch.zeros(3, 16)).item() == 0
