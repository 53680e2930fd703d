"""Training of the motion auto-encoder."""

import math

import pytest
import torch
from lightning import Trainer, seed_everything
from torch.utils.data import DataLoader, Dataset

from cospeech.corpus.batch import GestureBatch
from cospeech.errors import InputFileError
from cospeech.judges.motion_autoencoder import MotionAutoencoder
from cospeech.judges.motion_autoencoder.module import reconstruction_loss
from cospeech.metrics.encoder import load_any
from cospeech.motion.codecs import DirectionVectorCodec, direction_vectors

BONES = [0.26, 0.18, 0.14, 0.22, 0.36, 0.33, 0.22, 0.36, 0.33]


def waving(count, seed=0):
    """Windows of people who wave alike, each as widely and as late as they please."""
    generator = torch.Generator().manual_seed(seed)
    rest, swing = torch.randn(2, 1, 1, 9, 3, generator=torch.Generator().manual_seed(1))
    width, late = torch.rand(2, count, 1, 1, 1, generator=generator)
    time = torch.arange(34.0).view(1, 34, 1, 1) / 15
    directions = rest + width * swing * torch.sin(math.pi * time + 6 * late)
    return DirectionVectorCodec([0.0] * 27, BONES).decode(directions.flatten(-2), unit_length=True)


def facts(positions):
    mean = direction_vectors(positions).mean((0, 1)).flatten().tolist()
    return {"words": [], "speakers": ["a"], "mean_direction": mean, "bone_lengths": BONES}


class Batches(Dataset):
    """Ready batches of the given sizes."""

    def __init__(self, positions, *sizes):
        self.parts = positions.split(sizes)

    def __len__(self):
        return len(self.parts)

    def __getitem__(self, index):
        part = self.parts[index]
        return GestureBatch(torch.arange(len(part)), positions=part)


def loader(positions, *sizes):
    return DataLoader(Batches(positions, *sizes), batch_size=None)


def trainer(folder, epochs):
    return Trainer(
        max_epochs=epochs,
        accelerator="cpu",
        logger=False,
        enable_progress_bar=False,
        enable_model_summary=False,
        default_root_dir=folder,
    )


def test_loss_by_hand():
    """Errors 0 and 1 in turn: mean L1 1/2, differences all 1; two such windows sum to 3."""
    reconstruction = torch.zeros(2, 34, 27)
    reconstruction[:, 1::2] = 1
    loss = reconstruction_loss(reconstruction, torch.zeros(2, 34, 27))
    assert loss.item() == pytest.approx(2 * (0.5 + 1))


def test_optimiser_is_the_published_one():
    optimiser = MotionAutoencoder(facts(waving(2))).configure_optimizers()
    assert optimiser.defaults["lr"] == 5e-4
    assert optimiser.defaults["betas"] == (0.5, 0.999)


def test_learns_a_few_windows(tmp_path):
    """After 100 steps the error is under a third of the mean pose's."""
    seed_everything(0)
    positions = waving(32)
    module = MotionAutoencoder(facts(positions), learning_rate=2e-3)
    features = module.codec.encode(positions)
    data = loader(positions, 32)
    run = trainer(tmp_path, 100)
    run.fit(module, data, data)
    assert run.callback_metrics["val/reconstruction"].item() < 0.33 * features.abs().mean().item()

    encoder = module.encoder("a test")
    assert encoder.source == "a test"
    module.eval()
    torch.testing.assert_close(encoder.encode_positions(positions), module.network.encode(features))
    torch.testing.assert_close(encoder.network(features), module(positions))

    # The run's own checkpoint serves as metrics.encoder=<path>.
    path = tmp_path / "last.ckpt"
    run.save_checkpoint(path)
    assert load_any(path).sha256 == encoder.sha256
    again = MotionAutoencoder.load_from_checkpoint(path, weights_only=True)
    assert again.encoder().sha256 == encoder.sha256


def test_exported_encoder_does_not_follow_further_training():
    positions = waving(16)
    module = MotionAutoencoder(facts(positions))
    encoder = module.encoder()
    before = encoder.sha256
    optimiser = module.configure_optimizers()
    reconstruction_loss(module(positions), module.codec.encode(positions)).backward()
    optimiser.step()
    assert encoder.sha256 == before
    assert module.encoder().sha256 != before


def test_validation_error_is_the_mean_over_windows(tmp_path):
    """Uneven validation batches, weighted by their size."""
    positions = waving(20)
    module = MotionAutoencoder(facts(positions))
    run = trainer(tmp_path, 1)
    logged = run.validate(module, loader(positions, 12, 8), verbose=False)[0]
    module.eval()
    features = module.codec.encode(positions)
    expected = (module(positions) - features).abs().mean().item()
    assert logged[module.monitor] == pytest.approx(expected, rel=1e-5)


def test_checkpoint_of_another_method_is_no_encoder(tmp_path):
    path = tmp_path / "other.ckpt"
    torch.save({"pytorch-lightning_version": "2.6.6", "state_dict": {"a": torch.zeros(1)}}, path)
    with pytest.raises(InputFileError, match="another method than motion_autoencoder"):
        load_any(path)
