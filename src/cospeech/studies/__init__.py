"""What `evaluate.py study=...` runs: evaluations of more than one number or run."""

from cospeech.studies.gestures import multi_adversary_figures
from cospeech.studies.noise import fgd_noise

__all__ = ["fgd_noise", "multi_adversary_figures"]
