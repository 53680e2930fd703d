"""Weights that a training goes on with are whole, and its own."""

import pytest
import torch
from torch import nn

from cospeech.errors import InputFileError
from cospeech.experiment.building import load_weights
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
