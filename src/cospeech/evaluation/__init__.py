"""The one evaluation of all methods: which metrics, over which windows, beside which rows."""

from cospeech.evaluation.catalogue import Catalogue, standard_catalogue
from cospeech.evaluation.epochs import EpochEvaluation, EvaluationFields
from cospeech.evaluation.real_windows import real_windows
from cospeech.evaluation.recordings import evaluate_recordings
from cospeech.evaluation.references import References, read_rows, reference_rows

__all__ = [
    "Catalogue",
    "EpochEvaluation",
    "EvaluationFields",
    "References",
    "evaluate_recordings",
    "read_rows",
    "real_windows",
    "reference_rows",
    "standard_catalogue",
]
