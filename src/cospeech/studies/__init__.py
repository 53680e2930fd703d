"""What `evaluate.py study=...` runs: evaluations of more than one number or run."""

from cospeech.studies.caused_gestures import caused_gestures
from cospeech.studies.control_adherence import control_adherence
from cospeech.studies.matching_synchrony import matching_synchrony
from cospeech.studies.motion_statistics import motion_statistics
from cospeech.studies.multi_adversary_figures import multi_adversary_figures
from cospeech.studies.noise import fgd_noise
from cospeech.studies.true_distribution import true_distribution

__all__ = [
    "caused_gestures",
    "control_adherence",
    "fgd_noise",
    "matching_synchrony",
    "motion_statistics",
    "multi_adversary_figures",
    "true_distribution",
]
