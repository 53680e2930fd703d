"""The evaluation of Ferstl et al. 2020 (section 8) for trained systems, on a prepared corpus."""

from cospeech.studies.gestures.study import multi_adversary_figures
from cospeech.studies.gestures.systems import TrainedSystem

__all__ = ["TrainedSystem", "multi_adversary_figures"]
