"""Table 2 and figure 2 of Habibie et al. 2022: does controlled motion do what was asked?"""

from cospeech.studies.control_adherence.study import control_adherence

__all__ = ["control_adherence"]
