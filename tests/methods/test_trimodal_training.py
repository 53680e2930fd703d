"""The trimodal training step against the published one, and what each step may move."""

import numpy as np
import pytest
import torch
from lightning import Trainer
from torch import nn
from torch.utils.data import DataLoader

from cospeech.corpus.batch import GestureBatch
from cospeech.methods.trimodal import Trimodal
from tests.parity_formulas import SPEAKERS, WORDS, expected, fill, inputs

WEIGHTS = {"huber": 500, "kld": 0.1, "diversity": 0.05, "adversarial": 5, "discriminator": 1}


def facts(words: int = WORDS, speakers: int = SPEAKERS) -> dict:
    specials = ["<PAD>", "<SOS>", "<EOS>", "<UNK>"]
    return {
        "words": specials + [f"word{i}" for i in range(words - 4)],
        "speakers": [f"speaker{i}" for i in range(1, speakers + 1)],
        "mean_direction": [0.0] * 27,
        "bone_lengths": [0.2] * 9,
    }


class FeatureCodec(nn.Module):
    """The parity poses are features that no skeleton has; they pass through as they are."""

    def encode(self, positions: torch.Tensor) -> torch.Tensor:
        return positions


class Scripted(Trimodal):
    """The real step without randomness, at scripted epochs, with its logs kept."""

    epochs = (0, 0, 11, 11, 11)

    def __init__(self, **arguments) -> None:
        super().__init__(**arguments)
        self.steps: list[dict[str, float]] = []

    @property
    def current_epoch(self) -> int:
        return self.epochs[min(len(self.steps), len(self.epochs) - 1)]

    def _style_noise(self, count: int) -> None:
        return None

    def _permutation(self, count: int) -> torch.Tensor:
        return (torch.arange(count) + 1) % count

    def log_dict(self, values, **options) -> None:
        self.steps.append({name: float(value) for name, value in values.items()})


def parity_batch() -> GestureBatch:
    x = inputs()
    return GestureBatch(
        window_ids=torch.arange(8),
        positions=x["poses"],
        audio=x["audio"],
        words=x["words"],
        speakers=x["speakers"],
    )


def train(method: Trimodal, batch: GestureBatch, steps: int, callbacks=()) -> None:
    trainer = Trainer(
        accelerator="cpu",
        max_epochs=1,
        logger=False,
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
        callbacks=list(callbacks),
    )
    trainer.fit(method, DataLoader([batch] * steps, batch_size=None, collate_fn=lambda item: item))


@pytest.fixture(scope="module")
def trained(shared):
    method = Scripted(corpus=facts(), dropout=0.0, embedding_dropout=0.0)
    method.codec = FeatureCodec()
    fill(method.generator)
    fill(method.adversary.discriminator)
    train(method, parity_batch(), steps=5)
    return method


def test_five_iterations_give_the_published_losses(trained, shared):
    published = expected(shared)["training_losses"]
    for step, row in zip(trained.steps, published, strict=True):
        for (name, weight), value in zip(WEIGHTS.items(), row, strict=True):
            if not np.isnan(value):
                assert weight * step[f"train/{name}"] == pytest.approx(value, rel=1e-3, abs=2e-6)


def test_warm_up_logs_the_adversarial_loss_without_training_the_discriminator(trained, shared):
    assert "train/discriminator" not in trained.steps[1]
    assert "train/discriminator" in trained.steps[2]
    assert trained.steps[0]["train/adversarial"] > 0
    total = sum(w * trained.steps[1][f"train/{n}"] for n, w in list(WEIGHTS.items())[:3])
    assert trained.steps[1]["train/loss"] == pytest.approx(total, rel=1e-6)


def test_the_generator_after_training_is_the_published_one(trained, shared):
    x = inputs()
    trained.generator.train()
    with torch.no_grad():
        output = trained.generator(x["seed_poses"], x["words"], x["audio"], x["speakers"])
    np.testing.assert_allclose(
        output.poses.numpy(), expected(shared)["generator_after_training_out"], atol=2e-3
    )
    print(np.abs(output.poses.numpy() - expected(shared)["generator_after_training_out"]).max())
