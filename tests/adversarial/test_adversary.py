"""GAN losses by hand, and which weights an adversary's two losses reach."""

import math

import pytest
import torch
from torch import nn

from cospeech.adversarial.adversary import Adversary
from cospeech.adversarial.losses import (
    LEAST_SQUARES,
    NON_SATURATING,
    ON_PROBABILITIES,
    ON_SCORES,
    WASSERSTEIN,
    chosen_losses,
    log_discriminator_loss,
    log_generator_loss,
)
from cospeech.errors import ConfigError


def test_log_losses_by_hand():
    real, fake = torch.tensor([0.5, 0.8]), torch.tensor([0.25, 0.5])
    # -(ln .5 + ln .75 + ln .8 + ln .5) / 2
    by_hand = -(math.log(0.5) + math.log(0.75) + math.log(0.8) + math.log(0.5)) / 2
    assert log_discriminator_loss(real, fake).item() == pytest.approx(by_hand, rel=1e-6)
    assert log_discriminator_loss(real, fake).item() == pytest.approx(0.948560, abs=1e-6)
    assert log_generator_loss(fake).item() == pytest.approx(math.log(8) / 2, rel=1e-6)


def test_an_undecided_discriminator_costs_two_ln_two():
    half = torch.full((3, 1), 0.5)
    assert log_discriminator_loss(half, half).item() == pytest.approx(2 * math.log(2), rel=1e-6)


def test_losses_stay_finite_when_the_discriminator_is_sure_and_wrong():
    assert log_generator_loss(torch.zeros(1)).item() == pytest.approx(8 * math.log(10), rel=1e-5)
    assert math.isfinite(log_discriminator_loss(torch.zeros(1), torch.ones(1)).item())


def test_wasserstein_by_hand():
    real, fake = torch.tensor([1.0, 3.0]), torch.tensor([-1.0, 4.0])
    assert float(WASSERSTEIN.discriminator(real, fake)) == 1.5 - 2.0
    assert float(WASSERSTEIN.generator(fake)) == -1.5


def test_least_squares_by_hand():
    real, fake = torch.tensor([1.0, 0.5]), torch.tensor([0.5, -1.0])
    assert float(LEAST_SQUARES.discriminator(real, fake)) == (0 + 0.25) / 2 + (0.25 + 1) / 2
    assert float(LEAST_SQUARES.generator(fake)) == (0.25 + 4) / 2


def test_losses_are_chosen_by_name():
    assert chosen_losses("non_saturating", ON_PROBABILITIES, "a") is NON_SATURATING
    assert chosen_losses("wasserstein", ON_SCORES, "a") is WASSERSTEIN
    message = "a.loss='wasserstein' is not one of non_saturating, least_squares"
    with pytest.raises(ConfigError, match=message):
        chosen_losses("wasserstein", ON_PROBABILITIES, "a.loss")


@pytest.fixture
def adversary():
    torch.manual_seed(0)
    network = nn.Sequential(nn.Linear(2, 1), nn.Sigmoid())
    return Adversary(network, NON_SATURATING, weight=5.0, start_epoch=11)


def test_own_loss_moves_only_the_discriminator(adversary):
    fake = torch.randn(4, 2, requires_grad=True)
    adversary.own_loss(torch.randn(4, 2), fake).backward()
    assert fake.grad is None
    assert all(p.grad is not None for p in adversary.parameters())


def test_generator_loss_moves_only_the_sample(adversary):
    fake = torch.randn(4, 2, requires_grad=True)
    adversary.generator_loss(fake).backward()
    assert fake.grad is not None
    assert fake.grad.abs().sum() > 0
    assert all(p.grad is None and p.requires_grad for p in adversary.parameters())


def test_a_descending_sample_looks_more_real(adversary):
    fake = torch.randn(4, 2, requires_grad=True)
    before = adversary.generator_loss(fake)
    before.backward()
    with torch.no_grad():
        fake -= 0.5 * fake.grad
    assert adversary.generator_loss(fake) < before


def test_frozen_weights_stay_frozen_after_a_generator_loss(adversary):
    adversary.discriminator[0].bias.requires_grad_(False)
    adversary.generator_loss(torch.randn(4, 2))
    assert [p.requires_grad for p in adversary.parameters()] == [True, False]


def test_it_plays_from_its_start_epoch(adversary):
    assert [adversary.is_active(epoch) for epoch in (0, 10, 11, 99)] == [False, False, True, True]
