"""Objects get what they are given; weights that a training goes on with are whole."""

import pytest
import torch
from hydra.errors import InstantiationException
from omegaconf import OmegaConf
from torch import nn

from cospeech.corpus.facts import placeholder_facts
from cospeech.errors import InputFileError
from cospeech.experiment.building import build, load_weights
from cospeech.experiment.failures import as_sentence
from tests.damage import flipped


def test_weights_are_whole_or_named_with_what_to_do(tmp_path):
    path = tmp_path / "best.ckpt"
    saved = nn.Linear(30, 40)
    torch.save({"state_dict": saved.state_dict()}, path)
    whole = path.read_bytes()
    loaded = nn.Linear(30, 40)
    load_weights(loaded, path, "train again")
    assert torch.equal(loaded.weight, saved.weight)
    for damaged in (b"", whole[: len(whole) // 2], flipped(whole)):
        path.write_bytes(damaged)
        with pytest.raises(InputFileError, match=r"best\.ckpt") as caught:
            load_weights(loaded, path, "train again")
        assert caught.value.hint == "train again"
    path.write_bytes(whole)
    with pytest.raises(InputFileError, match=r"best\.ckpt"):
        load_weights(nn.Linear(31, 40), path, "train again")


class Told:
    def __init__(self, corpus, size, more=()):
        if size < 0:
            raise ValueError("size is negative")
        self.corpus, self.more = corpus, more


def node(**settings):
    return OmegaConf.create({"model": {"_target_": f"{__name__}.Told", **settings}}).model


def test_facts_of_a_corpus_reach_a_method_as_they_are():
    """A transcript's words are no references of a config."""
    corpus = placeholder_facts()
    corpus["words"] += ["${nowhere}", "???", "${oc.env:HOME}"]
    built = build(node(size=1, more=[{"a": 1}]), corpus=corpus)
    assert built.corpus is corpus
    assert type(built.more) is list
    assert type(built.more[0]) is dict


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"size": -1}, "ValueError: size is negative"),
        ({"size": 1, "unknown": 2}, "unexpected keyword argument 'unknown'"),
        ({}, "missing 1 required positional argument: 'size'"),
    ],
)
def test_what_a_constructor_raises_is_told_with_its_setting(given, told):
    with pytest.raises(InstantiationException) as caught:
        build(node(**given), corpus=placeholder_facts())
    sentence = as_sentence(caught.value)
    assert sentence.problem.startswith("model: ")
    assert told in sentence.problem
    assert sentence.hint == "mend this setting"
