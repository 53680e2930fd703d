"""What every step of a manual optimisation does."""

from __future__ import annotations

from collections.abc import Mapping

from lightning import LightningModule
from lightning.pytorch.core.optimizer import LightningOptimizer
from torch import Tensor


def descend(
    module: LightningModule,
    optimizer: LightningOptimizer,
    loss: Tensor | None,
    largest_norm: float | None = None,
) -> None:
    """Take one step of an optimiser.

    Args:
        module: Whose training it is.
        optimizer: Holds the parameters that move.
        loss: Scalar to make smaller; None, the total of losses that nobody feels, moves nothing.
        largest_norm: Gradients of a larger norm are shortened to it.
    """
    if loss is None:
        return
    optimizer.zero_grad()
    module.manual_backward(loss)
    if largest_norm is not None:
        module.clip_gradients(optimizer.optimizer, largest_norm, "norm")
    optimizer.step()


def log_losses(
    module: LightningModule, losses: Mapping[str, Tensor], batch_size: int
) -> dict[str, Tensor]:
    """Log the values of one step as ``train/NAME``, averaged over the epoch and all processes.

    Returns:
        What is logged, without gradients: what a training step gives to callbacks.
    """
    values = {f"train/{name}": loss.detach() for name, loss in losses.items()}
    module.log_dict(values, on_step=False, on_epoch=True, batch_size=batch_size, sync_dist=True)
    return values
