"""Weights of the published code."""

from __future__ import annotations

from collections.abc import Mapping

from torch import Tensor

PUBLISHED_LAYERS = {
    "first_layer.0": "first_layer.0",
    "hidden_to_output.0": "head.0",
    "hidden_to_output.3": "last",
    "encode_speech.0": "encode_frame.0.0",
    "encode_speech.3": "encode_frame.1.0",
    "reduce_speech_enc.0": "reduce.0",
    "conditioning_1.0": "condition.0",
}
"""Layers of the published network and of ours; its other two are never used."""


def our_name(published: str) -> str | None:
    """What a tensor of the published network is called here; None for one that is never used."""
    layer, _, part = published.rpartition(".")
    return f"{PUBLISHED_LAYERS[layer]}.{part}" if layer in PUBLISHED_LAYERS else None


def from_published(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """A published network's tensors under the names of `GesticulatorNetwork`."""
    named = {our_name(name): tensor for name, tensor in tensors.items()}
    return {name: tensor for name, tensor in named.items() if name is not None}
