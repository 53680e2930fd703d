"""The evaluation of Ferstl et al. 2020 (section 8) for trained systems, on a prepared corpus."""

from cospeech.studies.multi_adversary_figures.study import multi_adversary_figures

__all__ = ["multi_adversary_figures"]
