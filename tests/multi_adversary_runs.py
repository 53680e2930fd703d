"""Tiny multi-adversary trainings, for the tests."""

import dataclasses
import functools

import numpy as np
import torch
from lightning import Callback, Trainer

from callbacks.step_seed import SeedEachStep
from cospeech.corpus.splits import Span
from cospeech.corpus.store_writer import StoreWriter
from cospeech.corpus.synthetic import synthesise
from cospeech.corpus.window_loader import WindowLoader
from cospeech.corpus.windows import WindowDataset
from cospeech.methods.multi_adversary import MultiAdversary
from cospeech.motion.phases import PHASE_INDEX
from cospeech.speech.speech import Speech
from tests.corpora import make_recording, make_store

SMALL = {
    "hidden_size": 8,
    "adversaries": {
        "phase": {"weight": 2, "dense": 4, "hidden": 4},
        "motion": {"weight": 4, "dense": 4, "hidden": 4},
        "minibatch": {"weight": 4, "kernels": 5, "kernel_size": 2, "dense": 4, "hidden": 4},
        "displacement": {"weight": 1, "dense": 4, "hidden": 4},
    },
    "classifier_sizes": {"dense": 6, "recurrent": 6, "bidirectional": 4},
    "classifier_steps": 3,
    "pretraining_steps": 3,
    "snapshots": 3,
    "curriculum_batches": 2,
    "motion_pretraining_steps": 2,
    "adversarial_steps": 3,
    "learning_rate": 1e-3,
    "run": 2,
    "stride": 40,
}
"""Three levels of at most two batches: at most 3 + 3 + 6 + 2 + 3 steps."""

TINY = (
    "experiment=multi_adversary_quick",
    "data.minutes=6",
    "data.speakers=2",
    "model.hidden_size=16",
    "model.classifier_sizes={dense: 8, recurrent: 8, bidirectional: 8}",
    "model.classifier_steps=5",
    "model.pretraining_steps=5",
    "model.snapshots=2",
    "model.curriculum_batches=2",
    "model.motion_pretraining_steps=2",
    "model.adversarial_steps=4",
    "training.batch_size=8",
    "callbacks.render_samples.video=false",
    "callbacks.render_samples.clips=1",
    "logger=none",
)
"""The same from the command line, on the embedded corpus."""


def labelled_recording(name: str, seed: int, labelled: bool = True):
    """Noise that swells, wrists on circles; strokes where the left one is fast, else holds."""
    recording = make_recording(name, speaker=("ada", "ben")[seed % 2], seconds=20, seed=seed)
    rng = np.random.default_rng(seed)
    swell = np.repeat(rng.uniform(0.01, 0.3, 200), 1600)
    audio = (rng.standard_normal(320_000) * swell).clip(-1, 1).astype(np.float32)
    speech = Speech(audio, recording.speech.words)
    recording = dataclasses.replace(recording, speech=speech)
    if not labelled:
        return recording
    left = recording.motion.positions[:, 6].astype(np.float64)
    speed = np.linalg.norm(np.gradient(left, axis=0), axis=1)
    stroke, hold = PHASE_INDEX["stroke"], PHASE_INDEX["hold"]
    phases = np.where(speed > np.median(speed), stroke, hold).astype(np.int8)
    return dataclasses.replace(recording, phases=phases)


def embedded_store(folder):
    """A minute and a half of the embedded corpus: fingers, five spine joints, phases, 60 fps."""
    with StoreWriter(folder, "s", {}, "0") as writer:
        for recording in synthesise(1.5, seed=5, speakers=1):
            writer.add(recording)
        frames = writer.columns()["frames"]
        spans = [Span(i, 0, count) for i, count in enumerate(frames)]
        return writer.finish({"train": spans, "val": spans[:1], "test": spans[:1]})


def fingerless_store(folder, labelled: bool = True):
    return make_store(folder, [labelled_recording(f"take{i}", i, labelled) for i in range(5)])


def build(store, **changes) -> MultiAdversary:
    torch.manual_seed(0)
    return MultiAdversary(store.facts(), **{**SMALL, **changes})


def loader(method, store, split, runs=4):
    training = split == "train"
    windows = _windows(store, split, method.window, method.needs)
    return WindowLoader(windows, runs, seed=0, shuffle=training, drop_last=training)


@functools.lru_cache
def _windows(store, split, spec, needs):
    return WindowDataset(store, split, spec.of_split(split), needs)


class SaveAt(Callback):
    """A checkpoint after every step, named by the step's number."""

    def __init__(self, folder):
        self.folder, self.step = folder, 0

    def on_train_batch_end(self, trainer, pl_module, outputs, batch, batch_idx):
        self.step += 1
        trainer.save_checkpoint(self.folder / f"{self.step}.ckpt", weights_only=False)


class Watch(Callback):
    """Stages of all steps, and what was logged in each epoch."""

    def __init__(self):
        self.stages, self.logged, self.epochs = [], [], []

    def on_train_batch_start(self, trainer, pl_module, batch, batch_idx):
        self.stages.append(pl_module.progress.stage)

    def on_train_batch_end(self, trainer, pl_module, outputs, batch, batch_idx):
        self.logged.append({name: float(value) for name, value in outputs.items()})

    def on_train_epoch_end(self, trainer, pl_module):
        self.epochs.append({name: float(v) for name, v in trainer.callback_metrics.items()})


def fit(method, store, *callbacks, epochs=20, checkpoint=None, validate=False) -> Watch:
    watch = Watch()
    trainer = Trainer(
        max_epochs=epochs,
        accelerator="cpu",
        logger=False,
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
        num_sanity_val_steps=0,
        callbacks=[SeedEachStep(0), watch, *callbacks],
    )
    validation = loader(method, store, "val") if validate else None
    trainer.fit(
        method,
        loader(method, store, "train"),
        validation,
        ckpt_path=checkpoint,
        weights_only=True,
    )
    return watch
