"""Gesture phases that were annotated for each hand."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from cospeech.formats.phase_files.labels import normalised
from cospeech.motion.phases import PHASES, PhaseSegment, frame_phases

BUSIEST_FIRST = (
    "stroke",
    "independent_hold",
    "preparation",
    "pre_hold",
    "hold",
    "partial_retract",
    "retract",
    "rest_hold",
    "none",
)
"""Of two hands, the one whose phase stands earlier here is what the gesture is known by: what
carries meaning, then what leads to it, then what follows it."""

_SIDES = {
    word: side
    for side, words in {
        "left": "left l lh links linke linker gauche izquierda izquierdo sinistra esquerda",
        "right": "right r rh rechts rechte rechter droite derecha derecho destra direita",
        "both": "both bh beide deux ambas",
    }.items()
    for word in words.split()
}


def are_hands(names: Sequence[str]) -> bool:
    """Whether tiers are those of the left, the right and both hands, by their names.

    ``phase_left`` and ``phase_right`` are, ``LH phase`` and ``RH phase``, ``Hand (R)`` and
    ``Hand (L)``, ``main gauche``, ``main droite`` and ``deux mains``.
    """
    words = [_words(name) for name in names]
    sides = [tuple(_SIDES[word] for word in some if word in _SIDES) for some in words]
    rest = {tuple(word.rstrip("s") for word in some if word not in _SIDES) for some in words}
    alone = all(len(side) == 1 for side in sides)
    return alone and len(set(sides)) == len(sides) > 1 and len(rest) == 1


def side_of(text: str) -> str | None:
    """``"left"``, ``"right"`` or ``"both"``, where a text says that alone or with "hand"."""
    sides = [_SIDES[word] for word in _words(text) if word in _SIDES]
    return sides[0] if len(sides) == 1 else None


def _words(name: str) -> list[str]:
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)  # PhaseLeft
    return normalised(apart).split()


def busier_hand(hands: Sequence[Sequence[PhaseSegment]]) -> list[PhaseSegment]:
    """One sequence of phases for both hands: at any time the first of theirs in `BUSIEST_FIRST`.

    Args:
        hands: Segments of each hand.

    Returns:
        Segments that don't overlap, in order; none where no hand has one.
    """
    times = [t for hand in hands for segment in hand for t in (segment.start_s, segment.end_s)]
    edges = np.unique(times)
    nothing = len(BUSIEST_FIRST)
    best = np.full(max(0, len(edges) - 1), nothing)
    rank = np.array([BUSIEST_FIRST.index(label) for label in PHASES])
    for hand in hands:
        # The stretches between edges are numbered like frames, for which overlaps are solved.
        numbered = []
        covered = np.zeros(len(best), np.bool_)
        for one in hand:
            first, stop = np.searchsorted(edges, (one.start_s, one.end_s)).tolist()
            numbered.append(PhaseSegment(first, stop, one.label))
            covered[first:stop] = True
        labels = frame_phases(numbered, len(best), 1.0)
        best = np.where(covered, np.minimum(best, rank[labels]), best)
    return [
        PhaseSegment(float(start), float(end), BUSIEST_FIRST[place])
        for start, end, place in zip(edges[:-1], edges[1:], best, strict=True)
        if place < nothing
    ]
