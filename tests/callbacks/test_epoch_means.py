"""A run that is stopped within an epoch logs the same mean of it."""

import itertools

import pytest
import torch
from lightning import Callback, LightningModule, Trainer
from torch.utils.data import DataLoader

from callbacks.epoch_means import KeepEpochMeans

STEPS = 7
EPOCHS = 2


class Logging(LightningModule):
    """Logs as the methods do: means over windows, one of them now and then, and a maximum."""

    def __init__(self):
        super().__init__()
        self.automatic_optimization = False
        self.weight = torch.nn.Parameter(torch.zeros(1))
        self.means = []

    def on_train_epoch_start(self):
        self.trainer.callback_metrics.clear()  # as trainings in stages do

    def training_step(self, batch, batch_idx):
        self.optimizers().step()
        draws = torch.Generator().manual_seed(100 * self.current_epoch + batch_idx)
        loss, stage = torch.rand(2, generator=draws)
        self.log("train/loss", loss, on_step=False, on_epoch=True, batch_size=1 + batch_idx)
        self.log("train/stage", stage, on_step=False, on_epoch=True, reduce_fx="max")
        if batch_idx in (0, 3, 6) and self.current_epoch == 0:
            self.log("train/seldom", loss, on_step=False, on_epoch=True, batch_size=3)

    def on_train_epoch_end(self):
        logged = self.trainer.callback_metrics
        self.means.append({name: value.item() for name, value in logged.items()})

    def configure_optimizers(self):
        return torch.optim.SGD(self.parameters(), 0.1)


class Stop(Callback):
    """Saves and stops, as Ctrl-C does."""

    def __init__(self, epoch, step, path):
        self.at, self.path = (epoch, step), path

    def on_train_batch_end(self, trainer, pl_module, outputs, batch, batch_idx):
        if (trainer.current_epoch, batch_idx) == self.at:
            trainer.save_checkpoint(self.path)
            raise KeyboardInterrupt


def fit(folder, *callbacks, checkpoint=None):
    module = Logging()
    trainer = Trainer(
        max_epochs=EPOCHS,
        limit_train_batches=STEPS,
        accelerator="cpu",
        logger=False,
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
        callbacks=[KeepEpochMeans(), *callbacks],
        default_root_dir=str(folder),
    )
    trainer.fit(module, DataLoader(range(STEPS)), ckpt_path=checkpoint, weights_only=True)
    return module.means


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory):
    return fit(tmp_path_factory.mktemp("unbroken"))


STOPS = [
    [(0, 0)],
    [(0, STEPS - 2)],
    [(0, 1), (0, 2)],
    [(0, 3), (1, 1)],
]


@pytest.mark.parametrize("stops", STOPS, ids=str)
def test_a_resumed_epoch_has_the_mean_of_all_of_its_steps(stops, unbroken, tmp_path):
    paths = [None, *(tmp_path / f"{epoch}_{step}.ckpt" for epoch, step in stops)]
    for (epoch, step), (before, path) in zip(stops, itertools.pairwise(paths), strict=True):
        with pytest.raises((KeyboardInterrupt, SystemExit)):
            fit(tmp_path, Stop(epoch, step, path), checkpoint=before)
    resumed = fit(tmp_path, checkpoint=paths[-1])
    assert resumed == unbroken[stops[-1][0] :]


def test_an_epoch_that_had_ended_adds_nothing_to_the_next(unbroken, tmp_path):
    class Save(Callback):
        def on_train_epoch_end(self, trainer, pl_module):
            if trainer.current_epoch == 0:
                trainer.save_checkpoint(tmp_path / "ended.ckpt")

    fit(tmp_path, Save())
    assert fit(tmp_path, checkpoint=tmp_path / "ended.ckpt") == unbroken[1:]
