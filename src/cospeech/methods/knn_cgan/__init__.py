"""k-NN motion matching refined by a conditional GAN (Habibie et al. 2022)."""

from cospeech.methods.knn_cgan.module import RefinedMotionMatching

__all__ = ["RefinedMotionMatching"]
