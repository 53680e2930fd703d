"""The commands in this process, as a user types them, on settings that take seconds."""

import signal
from pathlib import Path

import torch
from hydra import compose, initialize_config_dir
from hydra._internal.callbacks import Callbacks
from hydra.core.global_hydra import GlobalHydra
from hydra.core.utils import run_job
from hydra.types import HydraContext
from lightning import Callback

from cospeech import experiment
from tests.multi_adversary_runs import TINY
from tests.runs import CONF

CORPUS = (
    "data.minutes=4",
    "data.speakers=2",
    "data.val_share=0.15",
    "data.test_share=0.15",
    "metrics.encoder=trained",
    "metrics.encoder_epochs=1",
)
"""A small corpus and its encoder; of either speaker one recording validates and one tests."""

COMMON = (
    *CORPUS,
    "trainer=cpu",
    "callbacks.render_samples.video=false",
    "callbacks.render_samples.clips=1",
    "callbacks.render_samples.seconds=3",
)

TRIMODAL = (
    *COMMON,
    "model=trimodal",
    "model.hidden_size=8",
    "model.layers=1",
    "model.adversarial_start_epoch=1",
    "training.epochs=2",
    "training.batch_size=8",
    "+trainer.limit_train_batches=2",
    "+callbacks.spoil._target_=tests.trainings.SpoilTheEnd",
)
"""The adversary joins in the second epoch, which ends worse than the first."""

SETTINGS = {
    "trimodal": (*TRIMODAL, "logger=default"),
    "knn": (*COMMON, "model=knn", "training.batch_size=16", "logger=none"),
    "knn_cgan": (
        *COMMON,
        "model=knn_cgan",
        "model.generator_width=8",
        "model.critic_width=8",
        "model.critic_updates=14",
        "model.pair_stride=32",
        "training.batch_size=8",
        "logger=none",
    ),
    "multi_adversary": (
        *TINY,
        *CORPUS,
        "model=multi_adversary",
        "+model.adversaries.minibatch={kernels: 5, kernel_size: 2, dense: 4, hidden: 4}",
        "callbacks.render_samples.seconds=3",
        "trainer=cpu",
    ),
}
"""A method of each kind: trained by epochs, fitted without steps, judged by an average of its
weights, and trained in stages."""


def train(outputs: Path, *overrides: str) -> experiment.RunResult:
    """What ``train.py`` does with these settings."""
    return done("train", experiment.run, outputs, overrides)


def evaluate(outputs: Path, *overrides: str):
    """What ``evaluate.py`` does with these settings."""
    return done("evaluate", experiment.evaluate, outputs, overrides)


def done(script, task, outputs, overrides):
    """What a task gives back, done as by a root script with these settings."""
    with initialize_config_dir(str(CONF), version_base="1.3"):
        given = [f"outputs_dir={outputs}", *overrides]
        cfg = compose(script, overrides=given, return_hydra_config=True)
        context = HydraContext(GlobalHydra.instance().config_loader(), Callbacks(cfg))
        job = run_job(task, cfg, "hydra.run.dir", None, context, configure_logging=False)
        return job.return_value


class SpoilTheEnd(Callback):
    """Trebles the weights before the last epoch is judged, so that another one is the best."""

    @torch.no_grad()
    def on_validation_start(self, trainer, pl_module):
        if trainer.current_epoch == trainer.max_epochs - 1:
            for parameter in pl_module.parameters():
                parameter.mul_(3)


class Interrupt(Callback):
    """Ctrl-C in the middle of an epoch."""

    def __init__(self, epoch: int, batch: int) -> None:
        self.when = (epoch, batch)

    def on_train_batch_start(self, trainer, pl_module, batch, batch_idx):
        if (trainer.current_epoch, batch_idx) == self.when:
            signal.raise_signal(signal.SIGINT)
