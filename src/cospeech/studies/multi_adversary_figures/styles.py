"""How systems are named and drawn: told apart by dash and marker as well as by colour."""

from __future__ import annotations

import math
from typing import NamedTuple

from cospeech.reporting.charts import SERIES

_TITLES = {
    "full": "full model",
    "mse_only": "MSE only",
    "no_phase_no_displacement": "no phase, no displacement",
}
_DASHES = ((), (7, 3), (2, 2.5), (10, 3, 2, 3), (5, 5), (12, 4), (1, 4), (8, 2, 1, 2, 1, 2))
_MARKERS = ("o", "s", "^", "D", "v")
SMALLEST = 0.001
"""A smaller number is shown as about 0."""


def title_of(name: str) -> str:
    """A system's name in words: ``no_motion`` is ``no motion``."""
    return _TITLES.get(name, name.replace("_", " "))


class SystemStyle(NamedTuple):
    """How a system is drawn.

    Attributes:
        colour: Its name in the pages' style sheet.
        dash: Lengths of its line's dashes and gaps, pixels; empty for a solid one.
        marker: Matplotlib's name of its marker; empty for none.
    """

    colour: str
    dash: tuple[float, ...]
    marker: str


def style_of(place: int) -> SystemStyle:
    """The style of the system at a place; the first is real motion, solid and without markers."""
    if place == 0:
        return SystemStyle("c0", (), "")
    i = place - 1
    return SystemStyle(
        SERIES[i % len(SERIES)], _DASHES[i % len(_DASHES)], _MARKERS[i % len(_MARKERS)]
    )


def shown(value: float | None, digits: int = 3) -> str:
    """A number with so many significant digits; a dash for nothing."""
    if value is None or math.isnan(value):
        return "\N{EN DASH}"
    if value == 0 or not math.isfinite(value):
        return f"{value:.0f}"
    if abs(value) < SMALLEST:
        return "≈0"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    return f"{value:.{max(0, decimals)}f}"
