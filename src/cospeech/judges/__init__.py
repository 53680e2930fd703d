"""What judges motion and is trained for it: the motion auto-encoder and the phase classifier."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cospeech.judges.motion_autoencoder import MotionAutoencoder as EvaluationEncoder

__all__ = ["EvaluationEncoder"]


def __getattr__(name: str) -> Any:
    """The judge that is the encoder of the evaluation."""
    if name != "EvaluationEncoder":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from cospeech.judges.motion_autoencoder import MotionAutoencoder

    return MotionAutoencoder
