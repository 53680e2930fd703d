"""Networks between training and use."""

from collections.abc import Iterator
from contextlib import contextmanager

from torch import nn


@contextmanager
def evaluating(network: nn.Module) -> Iterator[None]:
    """The network in eval mode inside, and afterwards as it was."""
    training = network.training
    if any(module.training for module in network.modules()):  # looking is cheaper than setting
        network.eval()
    try:
        yield
    finally:
        if training:
            network.train()
