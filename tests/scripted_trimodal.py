"""The trimodal training step without randomness, at scripted epochs, with its logs kept."""

import torch
from lightning import Trainer
from torch.utils.data import DataLoader

from cospeech.corpus.batch import GestureBatch
from cospeech.methods.trimodal import Trimodal

WEIGHTS = {"huber": 500, "kld": 0.1, "diversity": 0.05, "adversarial": 5, "discriminator": 1}


def facts(words: int, speakers: int) -> dict:
    specials = ["<PAD>", "<SOS>", "<EOS>", "<UNK>"]
    return {
        "words": specials + [f"word{i}" for i in range(words - 4)],
        "speakers": [f"speaker{i}" for i in range(1, speakers + 1)],
        "mean_direction": [0.0] * 27,
        "bone_lengths": [0.2] * 9,
    }


class Scripted(Trimodal):
    """The real step; step i is of the i-th epoch, later ones of the last."""

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


def train(method: Trimodal, batch: GestureBatch, steps: int) -> None:
    trainer = Trainer(
        accelerator="cpu",
        max_epochs=1,
        logger=False,
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
    )
    trainer.fit(method, DataLoader([batch] * steps, batch_size=None, collate_fn=lambda item: item))
