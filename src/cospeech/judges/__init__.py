"""What judges motion and is trained for it: the motion auto-encoder and the phase classifier."""

from cospeech.judges.motion_autoencoder import MotionAutoencoder as EvaluationEncoder

__all__ = ["EvaluationEncoder"]
