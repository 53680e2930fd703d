"""Control of motion matching by masks, without training (Habibie et al. 2022, section 3.1.3).

A schedule (`Controls`) says which criterion holds when; `plan_controls` turns it into one mask per
step of the search. The package's README describes the language of criteria.
"""

from cospeech.matching.control.expressions import Criterion, parse_criterion
from cospeech.matching.control.frames import database_mask
from cospeech.matching.control.planning import ControlPlan, Fallback, plan_controls
from cospeech.matching.control.quantities import QUANTITIES, Quantity, measure
from cospeech.matching.control.schedule import (
    Controls,
    KeywordControl,
    SpanControl,
    read_controls,
    read_values,
)
from cospeech.matching.control.words import WordPattern

__all__ = [
    "QUANTITIES",
    "ControlPlan",
    "Controls",
    "Criterion",
    "Fallback",
    "KeywordControl",
    "Quantity",
    "SpanControl",
    "WordPattern",
    "database_mask",
    "measure",
    "parse_criterion",
    "plan_controls",
    "read_controls",
    "read_values",
]
