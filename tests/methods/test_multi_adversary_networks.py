"""The multi-adversary networks against loops and definitions."""

import math

import pytest
import torch

from cospeech.methods.multi_adversary.networks import (
    Generator,
    MinibatchDiscriminator,
    MinibatchSimilarity,
    SequenceDiscriminator,
    WindowDropout,
)


def test_similarities_are_salimans_double_loop():
    torch.manual_seed(0)
    layer = MinibatchSimilarity(12, kernels=4, kernel_size=3)
    windows = torch.randn(5, 12)
    projected = (windows @ layer.weight * layer.scale).reshape(5, 4, 3)
    expected = torch.zeros(5, 4)
    for i in range(5):
        for j in range(5):
            if i != j:
                for b in range(4):
                    distance = (projected[i, b] - projected[j, b]).abs().sum()
                    expected[i, b] += math.exp(-distance.item()) / 4
    torch.testing.assert_close(layer(windows), expected)


def test_equal_windows_are_wholly_alike_and_a_lone_one_like_none():
    layer = MinibatchSimilarity(12, kernels=4, kernel_size=3)
    alike = layer(torch.randn(1, 12).expand(6, 12))
    torch.testing.assert_close(alike, torch.ones(6, 4))
    torch.testing.assert_close(layer(torch.randn(1, 12)), torch.zeros(1, 4))


def test_the_first_distances_are_near_one():
    torch.manual_seed(1)
    layer = MinibatchSimilarity(6300, kernels=100, kernel_size=3)
    projected = (torch.randn(32, 6300) @ layer.weight * layer.scale).unflatten(1, (100, 3))
    distances = (projected[:, None] - projected[None]).abs().sum(-1)
    others = distances[~torch.eye(32, dtype=torch.bool)]
    assert float(others.mean()) == pytest.approx(1.0, abs=0.05)


def test_a_step_of_rmsprop_hardly_changes_the_first_similarities():
    """As of other networks, whose weights are fewer and larger (see `MinibatchSimilarity`)."""
    torch.manual_seed(3)
    layer = MinibatchSimilarity(6300, kernels=100, kernel_size=3)
    windows = torch.randn(16, 6300)
    before = layer(windows).detach()
    optimizer = torch.optim.RMSprop(layer.parameters(), lr=1e-4)
    layer(windows).sum().backward()
    optimizer.step()
    assert 1e-5 < float((layer(windows) - before).abs().mean()) < 0.01


def test_the_minibatch_adversary_sees_repetition_and_the_others_do_not():
    torch.manual_seed(2)
    windows = torch.randn(4, 10, 6)
    repeated = windows[:1].expand(4, 10, 6)
    minibatch = MinibatchDiscriminator(10, 6, 8, 2, 8, 8, 0.0).eval()
    alone = SequenceDiscriminator(6, 8, 8, 0.0).eval()
    assert not torch.allclose(minibatch(windows)[0], minibatch(repeated)[0])
    torch.testing.assert_close(alone(windows)[0], alone(repeated)[0])
    for network in (minibatch, alone):
        probabilities = network(windows)
        assert probabilities.shape == (4,)
        assert ((probabilities > 0) & (probabilities < 1)).all()


def test_the_generator_has_the_papers_size_and_looks_at_no_later_step():
    torch.manual_seed(3)
    generator = Generator(27, 63).eval()
    # 27 * 256 + 256, batch norm 512, GRU 3 * 256 * (256 + 256 + 2), 256 * 63 + 63
    assert sum(p.numel() for p in generator.parameters()) == 7168 + 512 + 394_752 + 16_191
    speech = torch.randn(2, 30, 27)
    changed = speech.clone()
    changed[:, 20:] += 1
    assert torch.equal(generator(speech)[:, :20], generator(changed)[:, :20])
    assert not torch.equal(generator(speech)[:, 20:], generator(changed)[:, 20:])


def test_dropout_can_be_switched():
    torch.manual_seed(4)
    generator = Generator(27, 9, hidden_size=64)
    speech = torch.randn(8, 20, 27)

    def zeros(module):
        found = []
        handle = module.register_forward_hook(
            lambda _module, _inputs, output: found.append(float((output == 0).float().mean()))
        )
        generator(speech)
        handle.remove()
        return found[0]

    generator.set_dropout(0.0, 0.5)
    assert zeros(generator.recurrent_dropout) == pytest.approx(0.5, abs=0.02)
    generator.set_dropout(0.0, 0.2)
    assert zeros(generator.recurrent_dropout) == pytest.approx(0.2, abs=0.02)
    without = zeros(generator.dense_dropout)  # what the ReLU cuts
    generator.set_dropout(0.3, 0.2)
    assert zeros(generator.dense_dropout) == pytest.approx(without + 0.3 * (1 - without), abs=0.02)


def test_dropout_behind_the_gru_adds_no_jitter():
    torch.manual_seed(5)
    dropout = WindowDropout(0.5)
    hidden = torch.rand(6, 30, 40) + 1
    found = dropout(hidden) / hidden
    assert torch.equal(found, found[:, :1].expand_as(found))  # one mask for all steps
    assert set(found.unique().tolist()) == {0.0, 2.0}
    assert not torch.equal(found[0], found[1])  # but each window has its own
    assert torch.equal(dropout.eval()(hidden), hidden)
