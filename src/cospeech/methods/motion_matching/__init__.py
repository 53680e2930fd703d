"""Motion matching and its refinement by a conditional GAN (Habibie et al. 2022)."""

from cospeech.methods.motion_matching.module import MotionMatching
from cospeech.methods.motion_matching.refinement.module import RefinedMotionMatching

__all__ = ["MotionMatching", "RefinedMotionMatching"]
