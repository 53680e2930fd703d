"""The encoder behind every Fréchet gesture distance: network, frozen encoder, files."""

from cospeech.metrics.encoder.files import (
    import_published,
    load_any,
    load_encoder,
    save_encoder,
)
from cospeech.metrics.encoder.frozen import GestureEncoder
from cospeech.metrics.encoder.network import FEATURE_SIZE, POSE_SIZE, PoseAutoencoder
from cospeech.metrics.encoder.packaged import packaged_encoder

__all__ = [
    "FEATURE_SIZE",
    "POSE_SIZE",
    "GestureEncoder",
    "PoseAutoencoder",
    "import_published",
    "load_any",
    "load_encoder",
    "packaged_encoder",
    "save_encoder",
]
