"""The encoder that judges a store is trained beside where it is kept."""

import logging
import tempfile
from types import SimpleNamespace

import pytest
import torch

from cospeech import encoders
from cospeech.encoders import encoder_for, keep_encoder
from cospeech.errors import InputFileError
from cospeech.judges.motion_autoencoder import MotionAutoencoder
from cospeech.metrics.encoder import packaged_encoder, save_encoder
from tests.corpora import make_recording, make_store
from tests.damage import flipped


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


def test_what_is_packaged_or_given_is_taken_and_nothing_is_trained(tmp_path, monkeypatch, caplog):
    store = make_store(tmp_path, [make_recording(f"take{i}", seconds=6, seed=i) for i in range(6)])
    mine = MotionAutoencoder(store.facts()).encoder("mine")
    save_encoder(mine, tmp_path / "mine.pt")
    monkeypatch.setattr(encoders, "Trainer", lambda **_: pytest.fail("trains"))
    given = {"packaged": packaged_encoder(), str(tmp_path / "mine.pt"): mine}
    for choice, encoder in given.items():
        with caplog.at_level(logging.INFO):
            assert encoder_for(store, choice, epochs=1, seed=0).sha256 == encoder.sha256
        assert caplog.messages[-1] == f"judged by the encoder {encoder.sha256[:12]} ({choice})"
    assert not (store.path / "encoders").exists()


def test_a_checkpoint_that_was_written_badly_is_no_encoder(tmp_path, monkeypatch):
    store = make_store(tmp_path, [make_recording(f"take{i}", seconds=6, seed=i) for i in range(6)])
    best = tmp_path / "best.ckpt"
    torch.save({"state_dict": MotionAutoencoder(store.facts()).state_dict()}, best)
    whole = best.read_bytes()
    trainer = SimpleNamespace(fit=lambda *_: None)
    monkeypatch.setattr(encoders, "Trainer", lambda **_: trainer)
    monkeypatch.setattr(
        encoders, "ModelCheckpoint", lambda *_, **__: SimpleNamespace(best_model_path=str(best))
    )
    for damaged in (b"", whole[:-300], flipped(whole)):
        best.write_bytes(damaged)
        with pytest.raises(InputFileError, match=r"best\.ckpt") as caught:
            encoder_for(store, "trained", epochs=1, seed=0)
        assert "run the command again" in caught.value.hint
    best.write_bytes(whole)
    assert encoder_for(store, "trained", epochs=1, seed=0)


def test_a_damaged_encoder_is_not_kept(tmp_path):
    store = make_store(tmp_path, [make_recording(f"take{i}", seconds=6, seed=i) for i in range(6)])
    path = keep_encoder(store, MotionAutoencoder(store.facts()).encoder("untrained"), 1, 0)
    assert encoders.is_kept(store, 1, 0)
    path.write_bytes(path.read_bytes()[:-100])
    assert not encoders.is_kept(store, 1, 0)


@pytest.mark.filterwarnings("ignore:.*does not have many workers", "ignore:.*logging interval")
def test_the_encoder_has_the_weights_of_its_best_epoch(tmp_path, monkeypatch):
    def spoil(self):
        for parameter in self.parameters():
            torch.nn.init.zeros_(parameter)

    monkeypatch.setattr(MotionAutoencoder, "on_train_end", spoil)  # after the checkpoints
    takes = [make_recording(f"take{i}", seconds=6, seed=i) for i in range(6)]
    encoder = encoder_for(make_store(tmp_path, takes), "trained", epochs=1, seed=0)
    assert any(value.any() for value in encoder.parameters())
