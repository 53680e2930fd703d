"""One gesture's stroke: its prototype in the hands, the style and the luck of the speaker.

Positions are those of `cospeech.corpus.synthetic.body.HAND_CHANNELS`: outwards, up, forward of the
point between the shoulders.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.synthetic.body import (
    CURLS,
    DEVIATION,
    FLEXION,
    HAND_CHANNELS,
    POSITION,
    PRONATION,
    SPREAD,
)
from cospeech.corpus.synthetic.lexicon import BEAT
from cospeech.corpus.synthetic.outlines import (
    LEFT,
    ONE_HANDED,
    RIGHT,
    SHAPES,
    TWO_HANDED_SHARE,
    outline,
)
from cospeech.corpus.synthetic.speakers import REST_POSTURES, Style

_Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Form:
    """The stroke of a gesture.

    Attributes:
        hands: Which hands make it: ``(left, right)``.
        start: ``(2, 12)`` at the stroke's onset.
        end: ``(2, 12)`` at its end.
        arc: ``(2, 12)`` added in the middle of the way.
        sine: ``(2, 12)`` amplitude of the oscillation's sine part.
        cosine: ``(2, 12)`` amplitude of its cosine part, as 1 - cos.
        cycles: Oscillations during the stroke.
    """

    hands: tuple[bool, bool]
    start: _Array
    end: _Array
    arc: _Array
    sine: _Array
    cosine: _Array
    cycles: int


def rest_pose(style: Style) -> _Array:
    """``(2, 12)``: both hands in the speaker's rest posture."""
    posture = REST_POSTURES[style.rest]
    left = {
        "sides": hand_pose((0.235, -0.53, 0.03), "relaxed", 0.25, 0.1),
        "clasped": hand_pose((0.055, -0.40, 0.19), "relaxed", 0.5, 0.1),
        "belly": hand_pose((0.105, -0.30, 0.21), "relaxed", 0.35, 0.15),
    }[posture]
    right = left.copy()
    if posture == "clasped":
        # one hand lies over the other
        right[POSITION] += (-0.03, 0.03, 0.04)
    return np.stack([left, right])


def relaxed_pose(style: Style, rng: np.random.Generator) -> _Array:
    """``(2, 12)``: hands lowered half-way, where a partial retraction leads."""
    poses = np.stack(
        [hand_pose((0.13, -0.35, 0.24), "relaxed", style.palm + 0.2, 0.1) for _ in range(2)]
    )
    poses[:, 0] += style.width
    poses[:, POSITION] += rng.normal(0, (0.025, 0.02, 0.02), size=(2, 3))
    return poses


def hand_pose(
    position: tuple[float, float, float], shape: str, pronation: float, flexion: float
) -> _Array:
    """``(12,)`` a hand."""
    pose = np.zeros(HAND_CHANNELS)
    pose[POSITION] = position
    pose[PRONATION], pose[FLEXION] = pronation, flexion
    pose[CURLS], pose[SPREAD] = SHAPES[shape][:5], SHAPES[shape][5]
    return pose


def choose_hands(
    concept: str, style: Style, previous: tuple[bool, bool] | None, rng: np.random.Generator
) -> tuple[bool, bool]:
    """Which hands make a gesture: ``(left, right)``.

    Args:
        concept: Kind of gesture.
        style: Of the speaker.
        previous: Hands of the gesture before; speakers tend to stay with a hand.
        rng: Source of chance.
    """
    both_luck, stay_luck, right_luck = rng.uniform(size=3)
    two_handed = 0.0 if concept in ONE_HANDED else TWO_HANDED_SHARE.get(concept, style.two_handed)
    if both_luck < two_handed:
        return True, True
    if previous in ((True, False), (False, True)) and stay_luck < 0.45:
        return previous
    # people point to a side with the hand on that side
    right_share = style.right_share + {"left": -0.3, "right": 0.3}.get(concept, 0.0)
    is_right = right_luck < right_share
    return not is_right, is_right


def continue_hands(concept: str, style: Style, previous: tuple[bool, bool]) -> tuple[bool, bool]:
    """Hands of a gesture without preparation: those that are up, or the better of the two."""
    if previous == (True, True) and concept in ONE_HANDED:
        return (False, True) if style.right_share > 0.5 else (True, False)
    return previous


def make_form(
    concept: str,
    word: str,
    list_position: int | None,
    hands: tuple[bool, bool],
    here: _Array,
    prepared: bool,
    amplitude: float,
    style: Style,
    rng: np.random.Generator,
) -> Form:
    """The stroke of one gesture; never the same twice.

    Args:
        concept: Kind of gesture.
        word: The word that causes it.
        list_position: For items of a list, which one.
        hands: Which hands make it.
        here: ``(2, 12)`` where the hands are before it.
        prepared: Whether a preparation may bring the hands to its own start.
        amplitude: Size, 1 is average.
        style: Of the speaker.
        rng: Source of chance.
    """
    start, end = here.copy(), here.copy()
    arc, sine, cosine = (np.zeros((2, HAND_CHANNELS)) for _ in range(3))
    shared = outline(concept, word, list_position, LEFT if hands[LEFT] else RIGHT, rng)
    common = rng.normal(0, (0.025, 0.025, 0.02))
    cycles = shared.cycles
    for side in (LEFT, RIGHT):
        if not hands[side]:
            continue
        scale = amplitude * float(np.exp(rng.normal(0, 0.08)))
        palm = style.palm if shared.pronation is None else shared.pronation + 0.2 * style.palm
        pose = hand_pose(shared.start, shared.shape, palm, shared.flexion)
        pose[POSITION] += (style.width, style.height, 0.0)
        pose[POSITION] += common + rng.normal(0, 0.012, 3)
        pose[PRONATION] += rng.normal(0, 0.15)
        pose[FLEXION] += rng.normal(0, 0.1)
        pose[DEVIATION] += rng.normal(0, 0.08)
        if shared.shape == "relaxed":
            pose[CURLS] += style.curl - 0.3
        pose[CURLS] += rng.normal(0, 0.05, 5)
        move = np.zeros(HAND_CHANNELS)
        move[POSITION] = np.array(shared.move) * scale + rng.normal(0, 0.012, 3)
        move[PRONATION], move[FLEXION] = shared.pronation_move, shared.flexion_move * scale
        if hands == (True, True):
            # two hands in front of the body don't pass through each other
            pose[0] = max(pose[0], 0.05)
            move[0] = max(move[0], 0.04 - pose[0])
        arc[side, POSITION] = np.array(shared.arc) * scale + rng.normal(0, 0.008, 3)
        sine[side, POSITION] = np.array(shared.sine) * scale
        cosine[side, POSITION] = np.array(shared.cosine) * scale
        if prepared:
            start[side], end[side] = pose, pose + move
        elif concept == BEAT:
            # up from where the hand is and down again, a little beside
            end[side, POSITION] += (0.15 * move[POSITION]) + rng.normal(0, 0.02, 3)
            end[side, 3:] = 0.6 * end[side, 3:] + 0.4 * pose[3:]
            arc[side, POSITION] += np.array([0.01, 0.75 * abs(shared.move[1]) + 0.02, 0.01]) * scale
            arc[side, FLEXION] -= 0.25 * scale
        else:
            end[side] = here[side] + move
            end[side, 3:] = (pose + move)[3:]
            # stay inside the gesture space when strokes in one direction follow each other
            centre = pose[POSITION] + 0.5 * move[POSITION]
            end[side, POSITION] += 0.25 * (centre - here[side, POSITION])
    return Form(hands, start, end, arc, sine, cosine, cycles)
