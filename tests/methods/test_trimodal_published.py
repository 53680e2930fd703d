"""Published checkpoints: loaded as they are, and never allowed to run anything."""

import argparse
import contextlib
import os
import pickle
import subprocess
import sys
import types

import numpy as np
import pytest
import torch

from cospeech.errors import CospeechError, InputFileError
from cospeech.methods.trimodal import import_published, import_published_discriminator
from cospeech.methods.trimodal.networks import ConvDiscriminator, Generator
from cospeech.methods.trimodal.published import read_published


def small_state(**arguments) -> dict[str, torch.Tensor]:
    torch.manual_seed(0)
    sizes = {"word_size": 6, "style_size": 4, "hidden_size": 8, "layers": 2}
    return Generator(12, 3, **sizes, **arguments).state_dict()


@pytest.mark.parametrize("context", ["both", "audio", "text"])
@pytest.mark.parametrize("style", ["speaker", "random", "none"])
def test_sizes_and_kind_are_read_from_the_tensors(context, style):
    state = small_state(context=context, style=style)
    loaded = import_published(state, context=context)
    assert (loaded.context, loaded.style) == (context, style)
    assert loaded.style_size == (0 if style == "none" else 4)
    for name, tensor in loaded.state_dict().items():
        assert torch.equal(tensor, state[name])


def test_a_discriminator_for_60_frames_loads():
    state = ConvDiscriminator(60, hidden_size=8, layers=2).state_dict()
    loaded = import_published_discriminator({"dis_dict": state})
    assert loaded(torch.zeros(1, 60, 27)).shape == (1, 1)


def vocabulary_module(monkeypatch) -> types.ModuleType:
    """A module like the published one, whose objects checkpoints hold."""
    module = types.ModuleType("published_vocabulary")

    class Vocab:
        def __init__(self, name: str) -> None:
            self.name = name
            self.word2index = {"hello": 4}
            self.word_embedding_weights = np.zeros((5, 3), dtype=np.float32)

    Vocab.__module__, Vocab.__qualname__ = module.__name__, "Vocab"
    module.Vocab = Vocab
    monkeypatch.setitem(sys.modules, module.__name__, module)
    return module


def checkpoint(monkeypatch, context: str = "both") -> dict:
    module = vocabulary_module(monkeypatch)
    return {
        "args": argparse.Namespace(input_context=context, z_type="speaker"),
        "epoch": 93,
        "lang_model": module.Vocab("words"),
        "speaker_model": module.Vocab("vid"),
        "pose_dim": 27,
        "gen_dict": small_state(context=context),
        "dis_dict": ConvDiscriminator(hidden_size=8).state_dict(),
    }


@pytest.mark.parametrize("zipped", [True, False])
def test_a_published_checkpoint_loads_without_its_classes(tmp_path, monkeypatch, zipped):
    path = tmp_path / "checkpoint_best.bin"
    content = checkpoint(monkeypatch, "audio")
    torch.save(content, path, _use_new_zipfile_serialization=zipped)
    monkeypatch.delitem(sys.modules, "published_vocabulary")
    generator = import_published(path)
    assert generator.context == "audio"
    for name, tensor in generator.state_dict().items():
        assert torch.equal(tensor, content["gen_dict"][name])
    assert import_published_discriminator(str(path)).gru.hidden_size == 8
    loaded = read_published(path)
    assert loaded["epoch"] == 93
    assert loaded["lang_model"].state["word2index"] == {"hello": 4}
    assert "published_vocabulary" not in sys.modules


class Malicious:
    def __init__(self, function, *arguments) -> None:
        self.call = (function, arguments)

    def __reduce__(self):
        return self.call


@pytest.mark.parametrize("zipped", [True, False])
def test_a_malicious_checkpoint_runs_nothing(tmp_path, monkeypatch, zipped):
    touched = tmp_path / "touched"
    attacks = [
        Malicious(os.system, f"touch {touched}"),
        Malicious(subprocess.call, ["touch", str(touched)]),
        Malicious(eval, f"open({str(touched)!r}, 'w')"),
        Malicious(exec, f"open({str(touched)!r}, 'w')"),
    ]
    for number, attack in enumerate(attacks):
        path = tmp_path / f"{number}.bin"
        content = checkpoint(monkeypatch) | {"lang_model": attack}
        torch.save(content, path, _use_new_zipfile_serialization=zipped)
        with contextlib.suppress(InputFileError):
            import_published(path)
        assert not touched.exists()


def test_a_bare_pickle_runs_nothing(tmp_path):
    touched = tmp_path / "touched"
    path = tmp_path / "evil.bin"
    path.write_bytes(pickle.dumps(Malicious(eval, f"open({str(touched)!r}, 'w')"), protocol=2))
    with pytest.raises(InputFileError, match="not a checkpoint file that can be read safely"):
        import_published(path)
    assert not touched.exists()


def test_unusable_files_are_named(tmp_path):
    with pytest.raises(InputFileError, match="no such checkpoint"):
        import_published(tmp_path / "missing.bin")
    for content in (b"PK", b"not a checkpoint", b"PK\x03\x04broken"):
        path = tmp_path / "broken.bin"
        path.write_bytes(content)
        with pytest.raises(InputFileError, match=r"broken.bin: is damaged, or not a checkpoint"):
            import_published(path)
    path = tmp_path / "tensor.bin"
    torch.save(torch.zeros(3), path)
    with pytest.raises(InputFileError, match="holds a Tensor, not a dictionary of checkpoint"):
        import_published(path)


def test_foreign_tensors_are_refused():
    with pytest.raises(CospeechError, match=r"there is no tensor 'text_encoder\.embedding"):
        import_published({"layer.weight": torch.zeros(2, 2)})
    with pytest.raises(
        CospeechError, match=r"holds no state dict under 'gen_dict'; keys: \['epoch"
    ):
        import_published({"epoch": 3, "name": "x"})
    state = small_state()
    del state["out.2.bias"]
    with pytest.raises(CospeechError, match=r"don't fit the published network[\s\S]*out\.2\.bias"):
        import_published(state)
    with pytest.raises(CospeechError, match="pass context='audio' or context='text'"):
        import_published(small_state(context="text"))
