"""An adversary is one object: discriminator, loss pair, weight, start."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from torch import Tensor, nn

from cospeech.adversarial.losses import GanLosses


class Adversary(nn.Module):
    """A discriminator with what training needs to know of it.

    The optimiser stays with the method, whose checkpoint holds its state.

    Args:
        discriminator: Maps samples to outputs that ``losses`` understands.
        losses: The GAN objective.
        weight: Weight of the generator's loss; 0 trains and logs the adversary without letting the
            generator feel it.
        start_epoch: First epoch (counted from 0) in which it trains and is felt.
    """

    def __init__(
        self, discriminator: nn.Module, losses: GanLosses, weight: float, start_epoch: int
    ) -> None:
        super().__init__()
        self.discriminator = discriminator
        self.losses = losses
        self.weight = weight
        self.start_epoch = start_epoch

    def is_active(self, epoch: int) -> bool:
        """Whether it plays in ``epoch``."""
        return epoch >= self.start_epoch

    def outputs(self, real: Tensor, fake: Tensor) -> tuple[Tensor, Tensor]:
        """The discriminator on both; ``fake`` is detached. Batches stay apart for batch norm."""
        real_output = self.discriminator(real)
        return real_output, self.discriminator(fake.detach())

    def own_loss(self, real: Tensor, fake: Tensor) -> Tensor:
        """The discriminator's loss on its `outputs`."""
        return self.losses.discriminator(*self.outputs(real, fake))

    def generator_loss(self, fake: Tensor) -> Tensor:
        """The generator's loss, unweighted; gradient passes through frozen weights to ``fake``."""
        with self._frozen():
            return self.losses.generator(self.discriminator(fake))

    @contextmanager
    def _frozen(self) -> Iterator[None]:
        trainable = [p for p in self.discriminator.parameters() if p.requires_grad]
        for parameter in trainable:
            parameter.requires_grad_(False)
        try:
            yield
        finally:
            for parameter in trainable:
                parameter.requires_grad_(True)
