"""The encoder that judges a store is trained beside where it is kept."""

import tempfile

import pytest
import torch

from cospeech.encoders import encoder_for
from cospeech.methods.motion_autoencoder import MotionAutoencoder
from tests.corpora import make_recording, make_store


@pytest.mark.filterwarnings("ignore:.*does not have many workers", "ignore:.*logging interval")
def test_an_encoder_is_trained_without_a_folder_for_temporary_files(tmp_path, monkeypatch):
    takes = [make_recording(f"take{i}", "ab"[i % 2], seconds=6, seed=i) for i in range(6)]
    store = make_store(tmp_path, takes)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "absent"))
    encoder = encoder_for(store, "trained", epochs=1, seed=0)
    folder = store.path / "encoders"
    assert [path.name for path in folder.glob("*.pt")] == ["autoencoder-e1-s0.pt"]
    assert not [path for path in folder.iterdir() if path.is_dir()]
    assert encoder_for(store, "trained", epochs=1, seed=0).sha256 == encoder.sha256


@pytest.mark.filterwarnings("ignore:.*does not have many workers", "ignore:.*logging interval")
def test_the_encoder_has_the_weights_of_its_best_epoch(tmp_path, monkeypatch):
    def spoil(self):
        for parameter in self.parameters():
            torch.nn.init.zeros_(parameter)

    monkeypatch.setattr(MotionAutoencoder, "on_train_end", spoil)  # after the checkpoints
    takes = [make_recording(f"take{i}", seconds=6, seed=i) for i in range(6)]
    encoder = encoder_for(make_store(tmp_path, takes), "trained", epochs=1, seed=0)
    assert any(value.any() for value in encoder.parameters())
