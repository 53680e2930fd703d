"""Gesticulator fitted to a small corpus: what a checkpoint of it holds."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from lightning import Trainer

from cospeech.corpus.splits import Span
from cospeech.corpus.window_loader import WindowLoader, open_windows
from cospeech.evaluation import standard_catalogue
from cospeech.methods.gesticulator import Gesticulator
from cospeech.methods.gesticulator.networks import Standardised
from tests.corpora import make_recording, make_store
from tests.fabricated.mocap import TRINITY_BODY, swinging


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    takes = [
        replace(
            make_recording(f"take{i}", seconds=12.0, seed=i),
            motion=swinging(TRINITY_BODY, f"take{i}", 12.0, 15.0),
        )
        for i in range(4)
    ]
    return make_store(tmp_path_factory.mktemp("store"), takes)


def trained(store, folder, epochs=1, ckpt_path=None, **settings):
    torch.manual_seed(0)
    method = Gesticulator(store.facts(), text="none", dropout=0.0, **settings)
    dataset = open_windows(store, "train", method, standard_catalogue().fields)
    trainer = Trainer(
        max_epochs=epochs,
        limit_train_batches=2,
        accelerator="cpu",
        logger=False,
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
        default_root_dir=str(folder),
    )
    loader = WindowLoader(dataset, 2, seed=0, shuffle=True, drop_last=True)
    trainer.fit(method, loader, ckpt_path=ckpt_path, weights_only=True)
    return method, trainer, dataset


def test_poses_of_components_begin_at_the_mean_and_a_checkpoint_holds_them(store, tmp_path, caplog):
    with caplog.at_level("INFO", logger="cospeech.methods.gesticulator.module"):
        method, trainer, dataset = trained(store, tmp_path, pca=4, audio="prosody")
    (said,) = [r.getMessage() for r in caplog.records if "principal components keep" in r.msg]
    assert said.startswith("4 principal components keep ")
    assert method.network.pose_size == 4
    np.testing.assert_allclose(method.mean_pose, 0, atol=1e-5)  # of what is centred
    rotations = torch.from_numpy(dataset.every_frame("rotations"))
    scores = method.codec.encode(rotations)
    kept = scores.var(dim=0).sum() / method.codec.features.encode(rotations).var(dim=0).sum()
    assert said.endswith(f"{100 * kept:.1f} % of the training poses' variance")
    path = tmp_path / "model.ckpt"
    trainer.save_checkpoint(path)
    loaded = Gesticulator.load_from_checkpoint(path, weights_only=True)
    speech = store.speech(Span(0, 0, 60))
    motions = [one.generate(speech) for one in (method, loaded)]
    np.testing.assert_array_equal(motions[0].positions, motions[1].positions)


def test_training_in_components_goes_on_to_the_bit(store, tmp_path):
    settings = {"pca": 4, "audio": "mfcc", "epochs_without_history": 1}
    whole, _, _ = trained(store, tmp_path, 2, **settings)
    _, trainer, _ = trained(store, tmp_path, 1, **settings)
    trainer.save_checkpoint(tmp_path / "first.ckpt")
    resumed, _, _ = trained(store, tmp_path, 2, tmp_path / "first.ckpt", **settings)
    for name, value in whole.state_dict().items():
        assert torch.equal(value, resumed.state_dict()[name]), name


def test_speech_is_standardised_by_the_training_speech_and_a_checkpoint_holds_it(store, tmp_path):
    settings = {"audio": "spectrogram_prosody", "standardise_speech": True, "initialisation": "he"}
    method, trainer, dataset = trained(store, tmp_path, **settings)
    names = ("mel_gesticulator", "prosody_gesticulator")
    assert [field.name for field in method.fields] == list(names)
    frames = np.concatenate([dataset.every_frame(name) for name in names], axis=1)
    scales = method.network.standardised
    np.testing.assert_allclose(scales.mean, frames.mean(axis=0), rtol=1e-4, atol=1e-4)
    moving = frames.std(axis=0) > 1e-6
    np.testing.assert_allclose(scales.deviation[moving], frames.std(axis=0)[moving], rtol=1e-3)
    assert (scales.deviation[~moving] == 1).all()

    heard = torch.from_numpy(frames[:60])
    with torch.no_grad():
        first, second = method.network.encode_frame[1:]
        by_hand = second(first((heard - scales.mean) / scales.deviation))
        torch.testing.assert_close(method.network.eval().encode_frame(heard), by_hand)
    path = tmp_path / "model.ckpt"
    trainer.save_checkpoint(path)
    loaded = Gesticulator.load_from_checkpoint(path, weights_only=True)
    speech = store.speech(Span(0, 0, 60))
    motions = [one.generate(speech).positions for one in (method, loaded)]
    np.testing.assert_array_equal(*motions)
    scales.mean += 1.0
    assert np.abs(method.generate(speech).positions - motions[0]).max() > 1e-4


def test_numbers_that_never_change_are_divided_by_one():
    scales = Standardised(3)
    pieces = [
        np.zeros((0, 2)),
        [[2.0, -14.9]],
        [[4.0, -14.9], [3.0, -14.9]],
        [[3.0, -14.9]] * 100_000,
    ]
    scales.fit(1, [np.array(piece, dtype=np.float32) for piece in pieces])
    made = scales(torch.tensor([[7.0, 3.0, -13.9]]))
    torch.testing.assert_close(made, torch.tensor([[7.0, 0.0, 1.0]]), rtol=1e-6, atol=1e-5)
    torch.testing.assert_close(scales.deviation[1], torch.tensor((2 / 100_003) ** 0.5))
