"""Gesture phases (Ferstl et al. 2020, section 3; Kendon's terms)."""

from __future__ import annotations

PHASES: tuple[str, ...] = (
    "preparation",
    "pre_hold",
    "stroke",
    "hold",
    "independent_hold",
    "rest_hold",
    "partial_retract",
    "retract",
    "none",
)
"""The nine annotated labels, in the order of the published table; a frame's label is an index."""

PHASE_INDEX: dict[str, int] = {name: i for i, name in enumerate(PHASES)}
