"""What every method must do, whatever it is. Methods are found by their yaml."""

from pathlib import Path

import numpy as np
import pytest
import torch
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate
from lightning import Trainer

import cospeech.experiment  # noqa: F401  registers the resolver of run folders
from callbacks.step_seed import SeedEachStep
from cospeech.corpus.splits import Span
from cospeech.corpus.window_loader import WindowLoader, open_windows
from cospeech.errors import CospeechError
from cospeech.methods.base import GestureMethod
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.speech.speech import Speech
from tests.corpora import make_recording, make_store

CONF = Path(__file__).resolve().parents[2] / "conf"
MODELS = sorted(path.stem for path in (CONF / "model").glob("*.yaml"))


def model_config(name: str):
    overrides = [f"model={name}"]
    if (CONF / "experiment" / f"{name}_quick.yaml").is_file():
        overrides.append(f"experiment={name}_quick")
    with initialize_config_dir(str(CONF), version_base="1.3"):
        return compose("train", overrides=overrides).model


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """Six recordings long enough for runs of windows, without fingers, with phases."""
    recordings = [
        make_recording(f"take{i}", speaker=("ada", "ben")[i % 2], seconds=24, seed=i, phases=True)
        for i in range(6)
    ]
    return make_store(tmp_path_factory.mktemp("store"), recordings)


def build(name: str, store):
    torch.manual_seed(0)
    return instantiate(model_config(name), corpus=store.facts(), _convert_="all")


def loader(model, store, split="train"):
    dataset = open_windows(store, split, model)
    runs = 8 // dataset.spec.run
    return WindowLoader(dataset, runs, seed=0, shuffle=split == "train", drop_last=True)


def fit(model, store, folder, epochs=1):
    trainer = Trainer(
        max_epochs=epochs,
        limit_train_batches=2,
        accelerator="cpu",
        logger=False,
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
        callbacks=[SeedEachStep(0)],
        default_root_dir=str(folder),
    )
    trainer.fit(model, loader(model, store))
    return trainer


@pytest.fixture(params=MODELS)
def name(request):
    return request.param


@pytest.fixture
def method(name, store):
    model = build(name, store)
    if not isinstance(model, GestureMethod):
        pytest.skip(f"{name} makes no motion")
    return model


def test_two_steps_move_its_weights_and_leave_no_nan(name, store, tmp_path):
    model = build(name, store)
    before = {key: value.clone() for key, value in model.named_parameters()}
    fit(model, store, tmp_path)
    after = dict(model.named_parameters())
    assert any(not torch.equal(before[key], after[key]) for key in before)
    assert all(value.isfinite().all() for value in model.state_dict().values())


def test_the_same_seed_trains_the_same_weights(name, store, tmp_path):
    first, second = build(name, store), build(name, store)
    fit(first, store, tmp_path)
    fit(second, store, tmp_path)
    for (key, a), b in zip(first.state_dict().items(), second.state_dict().values(), strict=True):
        assert torch.equal(a, b), key


def test_samples_have_the_windows_shape_and_follow_the_seed(method, store):
    batch = next(iter(loader(method, store, "val")))
    method.eval()
    positions = method.sample(batch, torch.Generator().manual_seed(1))
    assert positions.shape == batch.positions.shape
    assert positions.shape[2:] == (10, 3)
    assert positions.isfinite().all()
    np.testing.assert_allclose(positions[:, :, 0], 0, atol=1e-6)  # the spine is the origin
    again = method.sample(batch, torch.Generator().manual_seed(1))
    assert torch.equal(positions, again)


@pytest.mark.parametrize("seconds", [0.5, 2.2667, 7.03])
def test_generated_motion_covers_the_audio_exactly(method, store, seconds):
    speech = store.speech(Span(5, 0, 150))
    speech = Speech(speech.waveform[: round(seconds * 16_000)], speech.words)
    motion = method.generate(speech, speaker="ada", generator=torch.Generator().manual_seed(3))
    assert len(motion) == int(np.ceil(len(speech.waveform) / 16_000 * method.window.fps - 1e-9))
    assert motion.fps == method.window.fps
    assert motion.skeleton.joints == UPPER_BODY.joints
    assert motion.first_bad_frame() is None
    again = method.generate(speech, speaker="ada", generator=torch.Generator().manual_seed(3))
    np.testing.assert_array_equal(motion.positions, again.positions)


def test_speech_without_a_transcript_is_enough(method):
    waveform = np.sin(np.arange(40_000) / 20).astype(np.float32) * 0.3
    motion = method.generate(Speech(waveform, None))
    assert motion.first_bad_frame() is None


def test_unknown_speakers_and_controls_are_refused_with_the_known_ones(method, store):
    speech = store.speech(Span(5, 0, 60))
    with pytest.raises(CospeechError, match="ada") as caught:
        method.generate(speech, speaker="nobody")
    assert "nobody" in str(caught.value)
    with pytest.raises(CospeechError, match="levitation"):
        method.generate(speech, controls={"levitation": 1})


def test_a_checkpoint_is_enough_to_generate(method, store, tmp_path):
    trainer = fit(method, store, tmp_path)
    path = tmp_path / "model.ckpt"
    trainer.save_checkpoint(path)
    loaded = type(method).load_from_checkpoint(path, weights_only=True)
    speech = store.speech(Span(5, 0, 90))
    a = method.generate(speech, speaker="ben", generator=torch.Generator().manual_seed(0))
    b = loaded.generate(speech, speaker="ben", generator=torch.Generator().manual_seed(0))
    np.testing.assert_array_equal(a.positions, b.positions)


def test_testing_a_checkpoint_through_the_trainer_loads_safely(method, store, tmp_path):
    trainer = fit(method, store, tmp_path)
    path = tmp_path / "model.ckpt"
    trainer.save_checkpoint(path)
    trained = {key: value.clone() for key, value in method.state_dict().items()}
    with torch.no_grad():
        for parameter in method.parameters():
            parameter.zero_()
    trainer.test(
        method, loader(method, store, "test"), ckpt_path=path, verbose=False, weights_only=True
    )
    for key, value in method.state_dict().items():
        assert torch.equal(value, trained[key]), key


def test_generation_does_not_disturb_training(method, store):
    speech = store.speech(Span(5, 0, 60))
    method.train()
    torch.manual_seed(7)
    expected = torch.rand(3)
    torch.manual_seed(7)
    buffers = {key: value.clone() for key, value in method.named_buffers()}
    method.generate(speech)
    assert torch.equal(torch.rand(3), expected), "generate drew from the global generator"
    assert method.training
    for key, value in method.named_buffers():
        assert torch.equal(value, buffers[key]), key
