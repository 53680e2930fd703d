"""What is added to the total, what is only evaluated, and what a step without a loss moves."""

import pytest
import torch

from cospeech.training.losses import WeighedLosses


def test_the_total_is_the_weighed_sum_and_the_values_are_not_weighed():
    losses = WeighedLosses()
    losses.add("near", 2, lambda: torch.tensor(3.0))
    losses.add("far", 0.5, lambda: torch.tensor(8.0))
    assert float(losses.total) == 2 * 3 + 0.5 * 8
    assert {name: float(value) for name, value in losses.values.items()} == {"near": 3, "far": 8}


def test_a_loss_of_weight_0_is_evaluated_without_gradient_and_not_felt():
    number, losses = torch.tensor(3.0, requires_grad=True), WeighedLosses()
    losses.add("watched", 0, number.square)
    assert losses.total is None
    losses.add("felt", 1, number.exp)
    assert float(losses.values["watched"].detach()) == 9
    assert not losses.values["watched"].requires_grad
    losses.total.backward()
    assert float(number.grad) == pytest.approx(float(number.detach().exp()))
    assert torch.is_grad_enabled()


def test_a_watched_loss_that_is_no_number_spoils_nothing():
    losses = WeighedLosses()
    losses.add("felt", 1, lambda: torch.tensor(2.0))
    losses.add("watched", 0, lambda: torch.tensor(float("nan")))
    assert float(losses.total) == 2


def test_losses_are_added_in_their_order():
    """Float sums depend on it, and runs are repeated to the bit."""
    numbers = [1e8, 3.0, -1e8]
    for order in (numbers, numbers[::-1], [3.0, 1e8, -1e8]):
        losses, expected = WeighedLosses(), torch.tensor(0.0)
        for number in order:
            losses.add(f"{number}", 1, lambda number=number: torch.tensor(number))
            expected = expected + torch.tensor(number)
        assert float(losses.total) == float(expected)
