"""How systems and phases look: told apart by dash, marker and name as well as by colour."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from cospeech.reporting.markup import escaped

_TITLES = {
    "full": "full model",
    "mse_only": "MSE only",
    "no_phase_no_displacement": "no phase, no displacement",
}

_DASHES = ("", "", "7 3", "2 2.5", "10 3 2 3", "5 5", "12 4", "1 4", "8 2 1 2 1 2")
_MARKERS = (
    "",
    "M{x} {y}m-3.6 0a3.6 3.6 0 1 0 7.2 0a3.6 3.6 0 1 0 -7.2 0z",
    "M{x} {y}m-3.2 -3.2h6.4v6.4h-6.4z",
    "M{x} {y}m0 -4.2l4.2 7.2h-8.4z",
    "M{x} {y}m0 -4.6l4.6 4.6l-4.6 4.6l-4.6 -4.6z",
    "M{x} {y}m0 4.2l4.2 -7.2h-8.4z",
)
SMALLEST = 0.001
"""A smaller number is shown as about 0."""

COLOURS = 9
"""Colours in the style sheet, ``c0`` (real) to ``c8``; then they repeat."""

PHASE_CLASSES = {
    "preparation": "p1",
    "stroke": "p2",
    "hold": "p3",
    "pre_hold": "p4",
    "independent_hold": "p5",
    "rest_hold": "p6",
    "partial_retract": "p7",
    "retract": "p8",
    "retraction": "p8",
    "rest": "p6",
}
"""CSS class of each phase; any other is grey."""


def title_of(name: str) -> str:
    """A system's name in words: ``no_motion`` is ``no motion``."""
    return _TITLES.get(name, name.replace("_", " "))


@dataclass(frozen=True)
class Look:
    """How a system is drawn.

    Attributes:
        style: CSS class that sets its colour.
        dash: ``stroke-dasharray`` of its line; empty for a solid one.
        marker: Path of its marker, with ``{x}`` and ``{y}``; empty for none.
    """

    style: str
    dash: str
    marker: str

    def mark(self, x: float, y: float) -> str:
        """An SVG path of the marker at a place; empty for none."""
        return self.marker.format(x=f"{x:.1f}", y=f"{y:.1f}")


def looks_of(names: Sequence[str]) -> dict[str, Look]:
    """A look for every system; the first is the bold line of real motion."""
    looks = {}
    for i, name in enumerate(names):
        colour = i if i < COLOURS else 1 + (i - COLOURS) % (COLOURS - 1)
        marker = _MARKERS[0] if i == 0 else _MARKERS[1 + (i - 1) % (len(_MARKERS) - 1)]
        dash = _DASHES[0] if i == 0 else _DASHES[1 + (i - 1) % (len(_DASHES) - 1)]
        looks[name] = Look(f"c{colour}", dash, marker)
    return looks


def phase_style(phase: str) -> str:
    """CSS class of a phase."""
    return PHASE_CLASSES.get(phase, "p0")


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


def lines_of(text: str, width: int) -> list[str]:
    """Words put on lines of at most about ``width`` characters, escaped for HTML."""
    lines = [""]
    for word in text.split():
        if lines[-1] and len(lines[-1]) + 1 + len(word) > width:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return [escaped(line) for line in lines]


def centred_text(x: float, y: float, text: str, width: int, style: str = "") -> str:
    """SVG text around ``x``, its first line at ``y``, broken after about ``width`` characters."""
    spans = "".join(
        f'<tspan x="{x:.1f}" dy="{0 if i == 0 else 14}">{line}</tspan>'
        for i, line in enumerate(lines_of(text, width))
    )
    of = f' class="{style}"' if style else ""
    return f'<text y="{y:.1f}" text-anchor="middle"{of}>{spans}</text>'
