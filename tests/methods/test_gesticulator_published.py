"""Published checkpoints of Gesticulator: read as they are, and never allowed to run anything."""

import math
import os
import subprocess
import sys
import types
from contextlib import suppress
from functools import cache

import numpy as np
import pytest
import torch

from cospeech.corpus.facts import placeholder_facts
from cospeech.errors import CospeechError, InputFileError
from cospeech.methods.gesticulator import import_published, inputs
from cospeech.methods.gesticulator.published import TEXT_SIZE, read_published
from cospeech.speech.speech import Speech, Word
from tests.parity import formulas


@pytest.fixture
def settings(monkeypatch):
    """Makes the dictionary that Lightning 0.8 put settings into, of a class that goes away."""
    module = types.ModuleType("pytorch_lightning.utilities.parsing")

    class AttributeDict(dict):
        pass

    AttributeDict.__module__, AttributeDict.__qualname__ = module.__name__, "AttributeDict"
    module.AttributeDict = AttributeDict
    for name in ("pytorch_lightning", "pytorch_lightning.utilities", module.__name__):
        monkeypatch.setitem(sys.modules, name, module)
    return AttributeDict


def mean_pose(size=45):
    return formulas.gesticulator_inputs(size)[2].numpy()


@cache
def weights(size):
    return formulas.gesticulator_weights("no_pca_45" if size == 45 else "pca_12")


def checkpoint(settings, size=45, **changed):
    """What the published code writes, with weights by formula."""
    values = {"activation": "TanH", "mean_pose": mean_pose(size), "audio_dim": 64, "n_layers": 1}
    return {
        "epoch": 99,
        "state_dict": dict(weights(size)),
        "hparams_name": "args",
        "hyper_parameters": settings(values | changed),
    }


def save(content, path, monkeypatch, zipped=True):
    torch.save(content, path, _use_new_zipfile_serialization=zipped)
    for name in [name for name in sys.modules if name.startswith("pytorch_lightning")]:
        monkeypatch.delitem(sys.modules, name)
    return path


@pytest.mark.parametrize("zipped", [True, False])
def test_a_checkpoint_moves_as_published(settings, tmp_path, monkeypatch, zipped):
    path = save(checkpoint(settings), tmp_path / "model.ckpt", monkeypatch, zipped)
    read = read_published(path)
    assert "pytorch_lightning.utilities.parsing" not in sys.modules
    assert (read.audio, read.network.training) == ("spectrogram", False)
    speech = formulas.gesticulator_inputs(45)[0][:, :-1]
    with torch.no_grad():
        start = read.mean_pose.expand(4, 3, -1)
        poses = read.network.roll(read.network.encode(speech), start)
    published = formulas.expected("gesticulator")["out45_autoregressive"]
    np.testing.assert_allclose(poses, published, atol=1e-5, rtol=0)


@pytest.mark.parametrize(
    "pose",
    [
        mean_pose().astype(np.float64),
        mean_pose().astype(">f4"),
        torch.from_numpy(mean_pose()),
        mean_pose().tolist(),
    ],
    ids=["doubles", "big endian", "tensor", "list"],
)
def test_the_mean_pose_is_read_as_it_was_pickled(settings, tmp_path, monkeypatch, pose):
    content = checkpoint(settings, mean_pose=pose)
    read = read_published(save(content, tmp_path / "model.ckpt", monkeypatch))
    np.testing.assert_array_equal(read.mean_pose, mean_pose())


def test_what_old_checkpoints_put_out_is_multiplied_by_pi(settings, tmp_path, monkeypatch):
    path = save(checkpoint(settings), tmp_path / "model.ckpt", monkeypatch)
    new, old = read_published(path).network, read_published(path, output_times_pi=True).network
    said = torch.randn(2, 256, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        torch.testing.assert_close(old.pose(said, None), math.pi * new.pose(said, None))


@pytest.mark.parametrize(
    ("audio", "size"),
    [("mfcc", 26), ("prosody", 4), ("mfcc_prosody", 30), ("spectrogram_prosody", 68)],
)
def test_what_it_hears_follows_from_the_first_layer(settings, tmp_path, monkeypatch, audio, size):
    content = checkpoint(settings)
    content["state_dict"]["encode_speech.0.weight"] = torch.zeros(248, size + TEXT_SIZE)
    path = save(content, tmp_path / "model.ckpt", monkeypatch)
    assert read_published(path).audio == audio
    monkeypatch.setattr(inputs, "ContextualVectors", Bert)
    assert import_published(path, placeholder_facts()).network.speech_size == size + TEXT_SIZE


class Bert:
    dimensions, version = 768, "bert"

    def __init__(self, name, special_tokens):
        assert (name, special_tokens) == ("bert-base-cased", False)

    def vectors(self, words):
        return np.full((len(words), 768), 0.1, dtype=np.float32)


def test_a_checkpoint_speaks(settings, tmp_path, monkeypatch):
    monkeypatch.setattr(inputs, "ContextualVectors", Bert)
    path = save(checkpoint(settings), tmp_path / "model.ckpt", monkeypatch)
    method = import_published(path, placeholder_facts())
    waveform = np.sin(np.arange(24_000) / 9).astype(np.float32) * 0.3
    motion = method.generate(Speech(waveform, (Word("Well.", 0.2, 0.9),)))
    assert (len(motion), motion.first_bad_frame()) == (30, None)
    np.testing.assert_array_equal(method.mean_pose, mean_pose())
    with torch.no_grad():
        method.network.last.bias += 0.3
    speech = Speech(waveform, (Word("Well.", 0.2, 0.9),))
    other = method.generate(speech).rotations_local
    assert np.abs(other - motion.rotations_local).max() > 0.1


def test_what_does_not_fit_is_told_in_a_line(settings, tmp_path, monkeypatch):
    monkeypatch.setattr(inputs, "ContextualVectors", Bert)
    path = save(checkpoint(settings, 12), tmp_path / "model.ckpt", monkeypatch)
    assert read_published(path).mean_pose.shape == (12,)
    with pytest.raises(CospeechError, match="12 principal components, and a checkpoint doesn't"):
        import_published(path, placeholder_facts())


def test_vectors_of_another_language_model_are_refused(settings, tmp_path, monkeypatch):
    monkeypatch.setattr(inputs, "ContextualVectors", type("Minor", (Bert,), {"dimensions": 384}))
    path = save(checkpoint(settings), tmp_path / "model.ckpt", monkeypatch)
    with pytest.raises(CospeechError, match="not those of bert-base-cased, which"):
        import_published(path, placeholder_facts())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"encode_speech.0.weight": torch.zeros(248, 305 + 64)}, "is 369 numbers, not 773"),
        ({"encode_speech.0.weight": torch.zeros(248)}, "no weights for encode_frame.0.0"),
        ({"first_layer.0.weight": torch.zeros(9, 612)}, r"weights.*first_layer.0.weight is \[9"),
        ({"hidden_to_output.0.weight": torch.zeros(45, 384)}, "weights.*head.0.weight is .45, 384"),
        ({"conditioning_2.0.weight": torch.zeros(3)}, "no place for 'conditioning_2.0.weight'"),
        ({"reduce_speech_enc.0.bias": 3}, "no tensor reduce.0.bias"),
        *(
            ({"reduce_speech_enc.0.bias": torch.full((612,), value, dtype=dtype)}, message)
            for value, dtype, message in [
                (math.nan, torch.float32, "reduce.0.bias holds values that are not finite"),
                (-math.inf, torch.float32, "reduce.0.bias holds values that are not finite"),
                (1e300, torch.float64, "reduce.0.bias holds values that are not finite"),
                (1, torch.complex64, "reduce.0.bias holds torch.complex64, not torch.float32"),
                (1, torch.int8, "reduce.0.bias holds torch.int8, not torch.float32"),
            ]
        ),
    ],
)
def test_other_tensors_are_refused_in_a_line(settings, tmp_path, monkeypatch, change, message):
    content = checkpoint(settings)
    content["state_dict"] |= change
    path = save(content, tmp_path / "model.ckpt", monkeypatch)
    with pytest.raises(InputFileError, match=message) as caught:
        read_published(path)
    assert "\n" not in caught.value.problem


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mean_pose": None}, "no vector of 45 finite numbers"),
        ({"mean_pose": mean_pose(12)}, "no vector of 45 finite numbers"),
        ({"mean_pose": mean_pose().reshape(9, 5)}, "no vector of 45 finite numbers"),
        ({"mean_pose": np.full(45, np.nan)}, "no vector of 45 finite numbers"),
        ({"mean_pose": np.array([{}] * 45)}, "no vector of 45 finite numbers"),
        ({"mean_pose": np.zeros(45, complex)}, "no vector of 45 finite numbers"),
        ({"mean_pose": [1e300] * 45}, "no vector of 45 finite numbers"),
        ({"mean_pose": [True] * 45}, "no vector of 45 finite numbers"),
        ({"mean_pose": torch.ones(45, dtype=torch.bool)}, "no vector of 45 finite numbers"),
        ({"mean_pose": torch.ones(45, dtype=torch.complex64)}, "no vector of 45 finite numbers"),
        ({"activation": "LeakyReLU"}, "activation 'LeakyReLU'"),
    ],
)
def test_other_settings_are_refused_in_a_line(settings, tmp_path, monkeypatch, change, message):
    path = save(checkpoint(settings, **change), tmp_path / "model.ckpt", monkeypatch)
    with pytest.raises(InputFileError, match=message) as caught:
        read_published(path)
    assert "\n" not in caught.value.problem


class Malicious:
    def __init__(self, function, *arguments) -> None:
        self.call = (function, arguments)

    def __reduce__(self):
        return self.call


@pytest.mark.parametrize("zipped", [True, False])
@pytest.mark.parametrize("place", ["hyper_parameters", "mean_pose", "callbacks"])
def test_a_hostile_checkpoint_runs_nothing(settings, tmp_path, monkeypatch, zipped, place):
    touched = tmp_path / "touched"
    attacks = [
        Malicious(os.system, f"touch {touched}"),
        Malicious(subprocess.call, ["touch", str(touched)]),
        Malicious(eval, f"open({str(touched)!r}, 'w')"),
    ]
    for number, attack in enumerate(attacks):
        content = checkpoint(settings)
        if place == "mean_pose":
            content["hyper_parameters"][place] = attack
        else:
            content[place] = attack
        path = tmp_path / f"{number}.ckpt"
        torch.save(content, path, _use_new_zipfile_serialization=zipped)
        with suppress(InputFileError):
            read_published(path)
        assert not touched.exists()


def test_a_dictionary_of_another_class_is_refused(settings, tmp_path, monkeypatch):
    settings.__qualname__ = settings.__name__ = "OtherDict"
    sys.modules[settings.__module__].OtherDict = settings
    path = save(checkpoint(settings), tmp_path / "model.ckpt", monkeypatch)
    with pytest.raises(InputFileError, match="not a checkpoint file that can be read safely"):
        read_published(path)
