"""Weights of the published code."""

from __future__ import annotations

PUBLISHED_NAMES = {
    "first_layer.0": "first_layer.0",
    "hidden_to_output.0": "head.0",
    "hidden_to_output.3": "last",
    "encode_speech.0": "encode_frame.0.0",
    "encode_speech.3": "encode_frame.1.0",
    "reduce_speech_enc.0": "reduce.0",
    "conditioning_1.0": "condition.0",
}
"""Layers of the published network and of ours; its other two are never used."""
