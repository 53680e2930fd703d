"""The gradient penalty beside the Wasserstein loss, by hand and by differences."""

import math

import pytest
import torch

from cospeech.adversarial.adversary import Adversary
from cospeech.adversarial.losses import WASSERSTEIN
from cospeech.errors import ConfigError
from cospeech.methods.motion_matching.refinement.losses import (
    gradient_penalty,
    penalty_points,
    reconstruction_loss,
)
from cospeech.methods.motion_matching.refinement.networks import Critic


def seeded(seed=0):
    return torch.Generator().manual_seed(seed)


def windows(seed, channels=10):
    return torch.randn(6, 16, channels, generator=seeded(seed), dtype=torch.float64)


def critic(seed=0):
    torch.manual_seed(seed)
    return Critic(10, frames=16, width=16).double()


def test_reconstruction_is_the_mean_absolute_difference():
    matched, refined = torch.zeros(2, 3, 2), torch.full((2, 3, 2), -0.5)
    refined[0, 0, 0] = 5.5
    assert float(reconstruction_loss(matched, refined)) == pytest.approx((11 * 0.5 + 5.5) / 12)


@pytest.mark.parametrize("at", ["interpolates", "generated"])
def test_a_linear_critic_has_the_same_slope_everywhere(at):
    """``D(x) = sum(w x)`` has the slope w, so the penalty is ``(|w| - 1)^2``."""
    weights = torch.full((16, 10), 0.25, dtype=torch.float64, requires_grad=True)
    penalty = gradient_penalty(lambda x: (x * weights).sum(dim=(1, 2)), windows(1), windows(2), at)
    norm = 0.25 * math.sqrt(160)
    assert float(penalty.detach()) == pytest.approx((norm - 1) ** 2)
    penalty.backward()
    # d/dw (|w| - 1)^2 = 2 (|w| - 1) w / |w|
    torch.testing.assert_close(
        weights.grad, torch.full_like(weights, 2 * (norm - 1) * 0.25 / norm).detach()
    )


def test_the_slope_of_a_quadratic_critic_is_looked_at_where_it_should_be():
    """``D(x) = |x|^2 / 2`` has the slope x: its norm tells the point."""
    real, fake = windows(1), windows(2)
    places = torch.rand(6, 1, 1, generator=seeded(7), dtype=torch.float64)
    between = real + places * (fake - real)
    for at, points in (("interpolates", between), ("generated", fake)):
        penalty = gradient_penalty(
            lambda x: x.square().sum(dim=(1, 2)) / 2, real, fake, at, seeded(7)
        )
        norms = points.flatten(1).norm(dim=1)
        assert float(penalty.detach()) == pytest.approx(float((norms - 1).square().mean()))


def test_what_real_and_generated_windows_share_stays_as_it_is():
    real, fake = windows(1).float(), windows(2).float()
    fake[..., :4] = real[..., :4]
    points = penalty_points(real, fake, "interpolates", seeded())
    assert torch.equal(points[..., :4], real[..., :4])
    share = (points - real)[..., 4:] / (fake - real)[..., 4:]
    # One place for all frames and channels of a window, another for each window.
    torch.testing.assert_close(share, share[:, :1, :1].expand_as(share), rtol=1e-3, atol=1e-3)
    assert len(share[:, 0, 0].unique()) == 6
    assert 0 <= share.min() < share.max() <= 1


def test_speech_has_a_part_in_the_slope():
    """A critic that listens only: the poses' slope is 0, the speech's is not."""
    penalty = gradient_penalty(
        lambda x: 3 * x[:, 0, 0], windows(1), windows(1)
    )  # one number with slope 3
    assert float(penalty.detach()) == pytest.approx(4)


def test_draws_come_from_torch_unless_a_generator_is_given():
    network, real, fake = critic(), windows(1), windows(2)

    def penalty(generator=None):
        return gradient_penalty(network, real, fake, generator=generator).item()

    torch.manual_seed(5)
    first = penalty()
    assert penalty() != first
    torch.manual_seed(5)
    assert penalty() == first
    state = torch.get_rng_state()
    assert penalty(seeded(5)) == penalty(seeded(5))
    assert torch.equal(torch.get_rng_state(), state)


@pytest.mark.parametrize("at", ["interpolates", "generated"])
def test_slopes_and_the_penaltys_own_gradient_by_differences(at):
    network, real, fake = critic(), windows(1), windows(2)
    points = penalty_points(real, fake, at, seeded(3))
    step, norms = 1e-6, []
    for window in points:
        slope = torch.zeros_like(window)
        for place in range(window.numel()):
            bump = torch.zeros_like(window)
            bump.view(-1)[place] = step
            scores = network(torch.stack([window + bump, window - bump])).detach()
            slope.view(-1)[place] = (scores[0] - scores[1]) / (2 * step)
        norms.append(slope.norm())
    penalty = gradient_penalty(network, real, fake, at, seeded(3))
    expected = (torch.stack(norms) - 1).square().mean()
    assert float(penalty.detach()) == pytest.approx(float(expected), rel=1e-5)
    penalty.backward()
    for parameter in (network.convolutions[0].weight, network.convolutions[1].weight):
        found = float(parameter.grad.flatten()[0])
        values = []
        for bump in (step, -step):
            with torch.no_grad():
                parameter.view(-1)[0] += bump
            values.append(gradient_penalty(network, real, fake, at, seeded(3)).item())
            with torch.no_grad():
                parameter.view(-1)[0] -= bump
        assert found == pytest.approx((values[0] - values[1]) / (2 * step), rel=1e-3, abs=1e-6)


def test_a_critic_without_slope_gives_finite_gradients():
    weights = torch.zeros(16, 10, dtype=torch.float64, requires_grad=True)
    penalty = gradient_penalty(lambda x: (x * weights).sum(dim=(1, 2)), windows(1), windows(2))
    assert float(penalty.detach()) == 1
    penalty.backward()
    assert weights.grad.isfinite().all()


def test_the_critics_losses_never_reach_the_generator():
    network, real = critic(), windows(1)
    made = torch.zeros_like(real, requires_grad=True)
    adversary = Adversary(network, WASSERSTEIN, 1.0, 0)
    for at in ("interpolates", "generated"):
        loss = adversary.own_loss(real, 2 * made) + gradient_penalty(network, real, 2 * made, at)
        loss.backward()
    assert made.grad is None
    assert all(p.grad is not None and p.grad.isfinite().all() for p in network.parameters())


def test_the_generators_loss_reaches_it_and_leaves_the_critic_alone():
    network = critic()
    made = torch.zeros(6, 16, 10, dtype=torch.float64, requires_grad=True)
    Adversary(network, WASSERSTEIN, 1.0, 0).generator_loss(made + windows(2)).backward()
    assert made.grad.abs().sum() > 0
    assert all(parameter.grad is None for parameter in network.parameters())


@pytest.mark.slow
def test_a_critic_learns_to_tell_two_kinds_apart_at_a_slope_near_one():
    torch.manual_seed(0)
    network = Critic(10, frames=16, width=32)
    optimizer = torch.optim.Adam(network.parameters(), 5e-4, betas=(0.0, 0.9))
    time = torch.arange(16.0)[:, None]
    for _ in range(500):
        real = torch.sin(0.4 * time + torch.rand(32, 1, 10))
        fake = torch.sin(1.6 * time + torch.rand(32, 1, 10))
        gap = WASSERSTEIN.discriminator(network(real), network(fake))
        penalty = gradient_penalty(network, real, fake)
        optimizer.zero_grad()
        (gap + 10 * penalty).backward()
        optimizer.step()
    assert float(gap.detach()) < -1
    assert float(penalty.detach()) < 0.1


def test_unknown_points():
    with pytest.raises(ConfigError, match="no penalty at 'real'"):
        gradient_penalty(critic(), windows(1), windows(2), "real")
