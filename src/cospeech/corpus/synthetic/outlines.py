"""The prototype of every kind of gesture, before style and chance.

Positions are those of `cospeech.corpus.synthetic.body.HAND_CHANNELS`: outwards, up, forward of the
point between the shoulders, m.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cospeech.corpus.synthetic.lexicon import (
    BEAT,
    FINGERS_FOR_NUMBER,
    INDEPENDENT_HOLD,
    LISTING,
)

LEFT, RIGHT = 0, 1

SHAPES: dict[str, tuple[float, ...]] = {
    "relaxed": (0.25, 0.25, 0.35, 0.40, 0.45, 0.15),
    "open": (0.05, 0.05, 0.05, 0.08, 0.12, 0.9),
    "flat": (0.15, 0.05, 0.05, 0.05, 0.08, 0.15),
    "point": (0.8, 0.03, 1.25, 1.35, 1.35, 0.0),
    "pinch": (0.75, 0.75, 0.55, 0.65, 0.75, 0.2),
    "one": (0.9, 0.03, 1.35, 1.35, 1.35, 0.7),
    "two": (0.9, 0.03, 0.03, 1.35, 1.35, 0.7),
    "three": (0.9, 0.03, 0.03, 0.03, 1.35, 0.7),
    "four": (0.9, 0.03, 0.03, 0.03, 0.03, 0.7),
    "many": (0.05, 0.03, 0.03, 0.03, 0.03, 0.7),
}
"""Hand shapes: bend of thumb, index, middle, ring, little finger, and spread, rad."""

_COUNTING_SHAPES = {1: "one", 2: "two", 3: "three", 4: "four"}

TWO_HANDED_SHARE = {
    "size_large": 0.85,
    "size_small": 0.4,
    "negation": 0.4,
    "cycle": 0.35,
    "uncertain": 0.8,
    "other": 0.25,
    LISTING: 0.0,
}
"""Share of a concept's gestures made with both hands; the speaker's habit where none is given."""

ONE_HANDED = frozenset(
    ("left", "right", "up", "down", "forward", "back", "there", "number", "self")
)
"""Concepts that two hands at once would make nonsense of."""


@dataclass(frozen=True)
class Outline:
    """One hand's stroke.

    Attributes:
        start: Wrist at the stroke's onset.
        move: Displacement over the stroke for amplitude 1.
        shape: Name in `SHAPES`.
        pronation: Of the forearm at the onset, rad; the speaker's habit when None.
        pronation_move: Change over the stroke, rad.
        flexion: Of the wrist at the onset, rad.
        flexion_move: Change over the stroke, rad.
        arc: Added in the middle of the way.
        sine: Sine part of an oscillation along the way.
        cosine: Its cosine part, as 1 - cos.
        cycles: Oscillations during the stroke.
    """

    start: tuple[float, float, float]
    move: tuple[float, float, float]
    shape: str = "relaxed"
    pronation: float | None = None
    pronation_move: float = 0.0
    flexion: float = 0.0
    flexion_move: float = 0.0
    arc: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sine: tuple[float, float, float] = (0.0, 0.0, 0.0)
    cosine: tuple[float, float, float] = (0.0, 0.0, 0.0)
    cycles: int = 1


_OUTLINES: dict[str, Outline] = {
    "size_large": Outline(
        (0.075, -0.20, 0.33), (0.24, 0.05, -0.05), "open", 0.0, flexion=-0.1, arc=(0.0, 0.02, 0.03)
    ),
    "size_small": Outline((0.17, -0.21, 0.30), (-0.09, 0.05, 0.05), "pinch", 0.35),
    "up": Outline((0.20, -0.31, 0.31), (0.02, 0.27, -0.01), "point", 0.3, arc=(0.0, 0.0, 0.03)),
    "down": Outline((0.19, -0.11, 0.32), (0.01, -0.25, -0.01), "point", 0.9, arc=(0.0, 0.0, 0.03)),
    "forward": Outline((0.16, -0.20, 0.23), (0.0, 0.03, 0.21), "flat", 0.2),
    "back": Outline((0.22, -0.20, 0.33), (0.06, 0.16, -0.22), "flat", -0.1, flexion=-0.2),
    "there": Outline((0.17, -0.21, 0.25), (0.11, 0.07, 0.17), "point", 0.7),
    "self": Outline((0.15, -0.24, 0.29), (-0.12, 0.09, -0.13), "flat", 0.1, flexion=0.35),
    "other": Outline((0.15, -0.25, 0.24), (0.06, 0.04, 0.18), "flat", -0.5, pronation_move=-0.5),
    "negation": Outline(
        (0.05, -0.20, 0.32), (0.24, -0.03, -0.01), "flat", 1.2, flexion=-0.1, arc=(0.0, -0.02, 0.03)
    ),
    "cycle": Outline(
        (0.16, -0.21, 0.27),
        (0.03, 0.0, 0.03),
        pronation=0.2,
        sine=(0.0, 0.065, 0.0),
        cosine=(0.0, 0.0, 0.055),
        cycles=2,
    ),
    "uncertain": Outline((0.14, -0.28, 0.27), (0.12, 0.06, 0.02), "open", -0.4, -0.7),
    INDEPENDENT_HOLD: Outline((0.19, -0.10, 0.31), (0.0, 0.0, 0.0), "open", 0.2, flexion=-0.35),
}

_BEATS: tuple[tuple[float, Outline], ...] = (
    (0.5, Outline((0.17, -0.19, 0.28), (0.02, -0.13, 0.03), flexion=-0.25, flexion_move=0.4)),
    (0.17, Outline((0.13, -0.23, 0.28), (0.12, -0.05, 0.02), arc=(0.0, 0.02, 0.02))),
    (0.17, Outline((0.17, -0.22, 0.24), (0.02, -0.05, 0.12), flexion=-0.2, flexion_move=0.3)),
    (0.16, Outline((0.15, -0.21, 0.26), (0.08, -0.08, 0.06), "open", 0.2, -0.9)),
)
"""Beats with their shares: downwards, outwards, forwards, and a hand that opens upwards."""
_BEAT_BORDERS = np.cumsum([share for share, _ in _BEATS])


def outline(
    concept: str, word: str, list_position: int | None, side: int, rng: np.random.Generator
) -> Outline:
    """The prototype for one gesture.

    Args:
        concept: Kind of gesture.
        word: The word that causes it; for numbers it says how many fingers are shown.
        list_position: For items of a list, which one.
        side: The hand that leads, `LEFT` or `RIGHT`.
        rng: Chooses the kind of beat.
    """
    if concept in ("left", "right"):
        # outwards for the hand on that side, across the body for the other
        outwards = (concept == "left") == (side == LEFT)
        start, move = ((0.10, -0.19, 0.33), 0.25) if outwards else ((0.24, -0.19, 0.34), -0.22)
        return Outline(start, (move, 0.01, 0.03), "point", 0.9, arc=(0.0, 0.02, 0.03))
    if concept == LISTING:
        # the items stand side by side, each further out
        place = 0.04 + 0.085 * min(list_position or 0, 4)
        return Outline(
            (place, -0.17, 0.33), (0.025, -0.11, 0.01), "flat", 0.1, flexion=-0.3, flexion_move=0.4
        )
    if concept == BEAT:
        return _BEATS[int(np.searchsorted(_BEAT_BORDERS[:-1], rng.uniform(), side="right"))][1]
    if concept == "number":
        shape = _COUNTING_SHAPES.get(FINGERS_FOR_NUMBER.get(word.lower(), 5), "many")
        return Outline(
            (0.19, -0.20, 0.30),
            (0.0, 0.05, 0.03),
            shape,
            -0.5,
            flexion=-0.4,
            cosine=(0.0, -0.02, 0.0),
            cycles=2,
        )
    return _OUTLINES[concept]
