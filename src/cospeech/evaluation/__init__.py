"""The one evaluation of all methods: which metrics, over which windows, beside which rows."""

from cospeech.evaluation.catalogue import Catalogue, standard_catalogue
from cospeech.evaluation.epochs import EpochEvaluation, EvaluationFields
from cospeech.evaluation.real_windows import long_enough, real_windows
from cospeech.evaluation.recordings import evaluate_recordings, generated_motions
from cospeech.evaluation.references import References, read_rows, reference_rows

__all__ = [
    "Catalogue",
    "EpochEvaluation",
    "EvaluationFields",
    "References",
    "evaluate_recordings",
    "generated_motions",
    "long_enough",
    "read_rows",
    "real_windows",
    "reference_rows",
    "standard_catalogue",
]
