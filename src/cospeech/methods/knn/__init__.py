"""Controllable k-NN motion matching (Habibie et al. 2022, stage 1)."""

from cospeech.methods.knn.module import MotionMatching

__all__ = ["MotionMatching"]
