"""The motion auto-encoder whose latent space the Fréchet gesture distance is measured in."""

from cospeech.judges.motion_autoencoder.module import MotionAutoencoder

__all__ = ["MotionAutoencoder"]
