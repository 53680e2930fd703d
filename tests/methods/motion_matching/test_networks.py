"""The refinement networks against the published table and plain functions."""

import math

import pytest
import torch
from torch import nn
from torch.nn import functional

from cospeech.errors import ConfigError
from cospeech.methods.motion_matching.refinement.networks import POOLED, Critic, Refiner


def size_of(network):
    return sum(parameter.numel() for parameter in network.parameters())


def block(inputs, outputs):
    return 3 * inputs * outputs + 3 * outputs  # weights; bias, scale and shift


def test_published_sizes():
    assert size_of(Refiner(28, 165)) == 3_912_741
    assert size_of(Critic(193)) == 1_826_560


def test_sizes_scale_with_the_width():
    w = 32
    pairs = [(103, w), (w, 2 * w), (2 * w, 2 * w), (2 * w, 4 * w)]
    pairs += [(6 * w, 2 * w), (4 * w, 2 * w), (3 * w, 2 * w)]
    expected = sum(block(a, b) + block(b, b) for a, b in pairs) + 2 * w * 75 + 75
    assert size_of(Refiner(28, 75, width=w)) == expected
    pairs = [(103, 128), (128, 64), (64, 32)]
    expected = sum(block(a, b) + block(b, b) for a, b in pairs) + 32 * 8
    assert size_of(Critic(103, width=128)) == expected


def test_the_papers_generator_has_eight_blocks_each_way():
    refiner = Refiner(28, 165, form="paper")
    sizes = [193, 128, 128, 256, 256, 256, 256, 512, 512, 512, 256, 256, 256, 256, 128, 128, 165]
    layers = [layer for layer in refiner.modules() if isinstance(layer, nn.Conv1d)]
    assert [layer.in_channels for layer in layers] + [layers[-1].out_channels] == sizes
    order = "".join(
        {"Conv1d": "c", "BatchNorm1d": "b", "ReLU": "r", "MaxPool1d": "/", "Upsample": "*"}[
            type(layer).__name__
        ]
        for layer in refiner.network
    )
    twice = 2 * "cbr"
    assert order == f"{twice}/{twice}/{twice}/{twice}{twice}*{twice}*{twice}*cbrc"


def test_the_unet_is_the_table():
    """Layer by layer in plain functions, in evaluation."""
    torch.manual_seed(0)
    refiner = Refiner(28, 12, width=8).train()
    audio, poses = torch.randn(2, 16, 28), torch.randn(2, 16, 12)
    for _ in range(3):
        refiner(audio, poses)
    state = {name: value for name, value in refiner.eval().state_dict().items()}

    def double(hidden, name):
        for conv, norm in ((0, 1), (3, 4)):
            weights = [state[f"network.{name}.{conv}.{part}"] for part in ("weight", "bias")]
            hidden = functional.conv1d(hidden, *weights, padding=1)
            mean, var, scale, shift = (
                state[f"network.{name}.{norm}.{part}"][:, None]
                for part in ("running_mean", "running_var", "weight", "bias")
            )
            hidden = (hidden - mean) / (var + 1e-5).sqrt() * scale + shift
            hidden = torch.where(hidden > 0, hidden, 0.2 * hidden)
        return hidden

    def halved(hidden):
        return (hidden[..., ::2] + hidden[..., 1::2]) / 2

    def doubled(hidden):
        return torch.stack([hidden, hidden], dim=-1).flatten(-2)

    skip1 = double(torch.cat([audio, poses], dim=2).mT, "down.0")
    skip2 = double(halved(skip1), "down.1")
    skip3 = double(halved(skip2), "down.2")
    hidden = double(halved(skip3), "middle")
    for name, skip in (("up.0", skip3), ("up.1", skip2), ("up.2", skip1)):
        hidden = double(torch.cat([doubled(hidden), skip], dim=1), name)
    last = state["network.last.weight"][..., 0], state["network.last.bias"]
    expected = functional.linear(hidden.mT, *last)
    torch.testing.assert_close(refiner(audio, poses), expected, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("form", ["code", "paper"])
@pytest.mark.parametrize("frames", [1, 7, 8, 64, 77])
def test_any_length_is_padded_with_its_last_frame(form, frames):
    torch.manual_seed(1)
    refiner = Refiner(4, 6, width=8, form=form).eval()
    audio, poses = torch.randn(2, frames, 4), torch.randn(2, frames, 6)
    refined = refiner(audio, poses)
    assert refined.shape == poses.shape
    missing = -frames % 8
    longer = [
        torch.cat([values, values[:, -1:].expand(-1, missing, -1)], dim=1)
        for values in (audio, poses)
    ]
    torch.testing.assert_close(refined, refiner(*longer)[:, :frames])


def test_far_away_frames_do_not_matter_to_the_generator():
    torch.manual_seed(2)
    refiner = Refiner(4, 6, width=8).eval()
    audio, poses = torch.randn(1, 256, 4), torch.randn(1, 256, 6)
    changed = poses.clone()
    changed[:, 200:] += 1
    before, after = refiner(audio, poses), refiner(audio, changed)
    assert torch.equal(before[:, :128], after[:, :128])
    assert not torch.allclose(before[:, 192:200], after[:, 192:200])


def test_the_critic_is_the_table():
    torch.manual_seed(3)
    critic = Critic(10, frames=16, width=16)
    for parameter in critic.parameters():
        nn.init.normal_(parameter, 0.3, 0.5)
    windows = torch.randn(5, 16, 10)
    state, hidden = critic.state_dict(), windows.mT
    for pair in range(3):
        for conv in (7 * pair, 7 * pair + 3):
            names = (f"convolutions.{conv}", f"convolutions.{conv + 1}")
            hidden = functional.conv1d(
                hidden, state[f"{names[0]}.weight"], state[f"{names[0]}.bias"], padding=1
            )
            mean = hidden.mean(-1, keepdim=True)
            deviation = (hidden.var(-1, unbiased=False, keepdim=True) + 1e-5).sqrt()
            scale, shift = (state[f"{names[1]}.{part}"][:, None] for part in ("weight", "bias"))
            hidden = (hidden - mean) / deviation * scale + shift
            hidden = torch.where(hidden > 0, hidden, 0.2 * hidden)
        hidden = (hidden[..., ::2] + hidden[..., 1::2]) / 2
    expected = hidden.flatten(1) @ state["output.weight"][0]
    torch.testing.assert_close(critic(windows), expected, rtol=1e-4, atol=1e-4)


def test_the_critic_sees_each_window_by_itself():
    torch.manual_seed(4)
    critic = Critic(10, frames=16, width=16)
    windows = torch.randn(5, 16, 10)
    alone = torch.cat([critic(window[None]) for window in windows])
    torch.testing.assert_close(critic(windows), alone, rtol=1e-4, atol=1e-5)


def test_weights_begin_as_published():
    torch.manual_seed(5)
    for network in (Refiner(28, 165), Critic(193), Refiner(28, 165, form="paper")):
        for layer in network.modules():
            if isinstance(layer, nn.Conv1d | nn.Linear):
                taps = math.prod(layer.weight.shape[2:])
                fans = sum(layer.weight.shape[:2]) * taps
                expected = math.sqrt(2) * math.sqrt(2 / fans)
                assert float(layer.weight.detach().std()) == pytest.approx(expected, rel=0.1)
                assert layer.bias is None or not layer.bias.any()
            elif isinstance(layer, nn.BatchNorm1d | nn.InstanceNorm1d):
                assert (layer.weight == 1).all()
                assert not layer.bias.any()


def test_impossible_networks():
    with pytest.raises(ConfigError, match="no generator form 'other'"):
        Refiner(28, 165, form="other")
    with pytest.raises(ConfigError, match="a critic of 60 frames"):
        Critic(193, frames=60)
    with pytest.raises(ConfigError, match="width 30"):
        Critic(193, width=30)


def any_refiner(form, residual):
    """With weights and statistics that training might have led to."""
    torch.manual_seed(6)
    refiner = Refiner(2, 3, width=4, form=form, residual=residual)
    for layer in refiner.modules():
        if isinstance(layer, nn.BatchNorm1d):
            nn.init.normal_(layer.running_mean)
            nn.init.uniform_(layer.running_var, 0.5, 2)
        if isinstance(layer, nn.Conv1d | nn.BatchNorm1d):
            nn.init.normal_(layer.weight)
            nn.init.normal_(layer.bias)
    return refiner


def shown(refiner, audio, poses, pieces):
    """What comes of so many pieces of 8 frames at a time, and at the end."""
    network, whole = refiner.piecewise(), len(poses) // POOLED * POOLED
    with torch.no_grad():
        made = [
            network(audio[first:stop], poses[first:stop], False)
            for first in range(0, whole, pieces * POOLED)
            for stop in [min(first + pieces * POOLED, whole)]
        ]
        return [*made, network(audio[whole:], poses[whole:], True)]


every_refiner = pytest.mark.parametrize(
    ("form", "residual"), [("code", False), ("code", True), ("paper", False), ("paper", True)]
)


@every_refiner
@pytest.mark.parametrize("frames", [0, 3, 8, 61, 64, 200])
def test_pieces_are_refined_to_what_the_whole_is(form, residual, frames):
    refiner = any_refiner(form, residual).double()
    audio, poses = (torch.randn(frames, size, dtype=torch.double) for size in (2, 3))
    made = shown(refiner, audio, poses, 1)
    assert refiner.training
    with torch.no_grad():
        whole = refiner.eval()(audio[None], poses[None])[0] if frames else poses
    torch.testing.assert_close(torch.cat(made), whole, rtol=1e-9, atol=1e-9)
    seen = range(POOLED, frames + 1, POOLED)
    complete = torch.tensor([len(refined) for refined in made[:-1]]).cumsum(0)
    assert complete.tolist() == [max(0, count - refiner.behind) for count in seen]


@every_refiner
@pytest.mark.parametrize("pieces", [2, 9, 200])
def test_pieces_are_refined_the_same_to_the_bit_however_many_are_shown_together(
    form, residual, pieces
):
    refiner = any_refiner(form, residual)
    audio, poses = torch.randn(1003, 2), torch.randn(1003, 3)
    alone, together = (torch.cat(shown(refiner, audio, poses, n)) for n in (1, pieces))
    assert torch.equal(alone, together)
