"""When to gesture: which words cause gestures, and the phases around their strokes.

The shares and mean durations of the phases follow the annotated corpus of Ferstl et al. 2020,
Table 1 (226 minutes of one speaker): 38 strokes a minute, two thirds of them with a preparation of
their own, a full retraction only about twice a minute.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cospeech.corpus.synthetic.lexicon import BEAT, INDEPENDENT_HOLD, LISTING, concept_of
from cospeech.corpus.synthetic.speakers import Style
from cospeech.corpus.synthetic.takes import SpokenTake

_LEXICAL_SHARE = {
    "size_large": 0.9,
    "size_small": 0.85,
    "left": 0.9,
    "right": 0.9,
    "up": 0.85,
    "down": 0.85,
    "forward": 0.75,
    "back": 0.7,
    "there": 0.7,
    "number": 0.7,
    "self": 0.35,
    "other": 0.35,
    "negation": 0.7,
    "cycle": 0.8,
    "uncertain": 0.75,
    LISTING: 0.9,
}
"""Probability that a word with a concept, if there is time, causes its gesture."""

_CLOSEST_S = 0.62  # between two stroke onsets
_LEAD_SPREAD_S = 0.045
_SHORTEST_PREPARATION_S = 0.22
_SHORTEST_HOLD_S = 0.14


@dataclass(frozen=True)
class Cause:
    """A word that causes a gesture.

    Attributes:
        word: Index of the word in the take.
        concept: Kind of gesture (`cospeech.corpus.synthetic.lexicon.CONCEPTS`).
        time: Onset of the word's stressed syllable, s.
        list_position: For items of a list, which one.
    """

    word: int
    concept: str
    time: float
    list_position: int | None = None


@dataclass(frozen=True)
class Gesture:
    """A gesture on the clock.

    Attributes:
        cause: Why it is made.
        start: Onset of its stroke, or of the pose for an independent hold, s.
        end: Its end, s.
        prepared: Whether a preparation comes before it; otherwise it starts where the hands are.
        line: Index of the line it accompanies.
    """

    cause: Cause
    start: float
    end: float
    prepared: bool
    line: int


@dataclass(frozen=True)
class Phase:
    """A stretch of one label.

    Attributes:
        label: Name in `cospeech.motion.phases.PHASES`.
        start: s.
        end: s.
        gesture: Index of the gesture it leads to (preparation, pre-hold), is (stroke, independent
            hold) or follows (the others); -1 before the first gesture.
    """

    label: str
    start: float
    end: float
    gesture: int


def find_causes(take: SpokenTake, style: Style, rng: np.random.Generator) -> list[Cause]:
    """The words that cause gestures: evoking words first, stressed syllables in between.

    A word's chance grows with the time since the last gesture, so that the rate settles near the
    speaker's own.
    """
    period = 60 / style.rate
    causes: list[Cause] = []
    last = -np.inf
    for index, word in enumerate(take.words):
        concept = LISTING if word.list_position is not None else concept_of(word.text)
        since = word.onset - last
        # drawn for every word, so that one decision doesn't shift the luck of all later ones
        luck, held = rng.uniform(size=2)
        if since < _CLOSEST_S:
            continue
        if concept is not None and luck < _LEXICAL_SHARE[concept]:
            causes.append(Cause(index, concept, word.onset, word.list_position))
        elif word.stress == 2 and luck < np.clip((since / period - 0.25) * 1.05, 0, 0.97):
            causes.append(Cause(index, INDEPENDENT_HOLD if held < 0.018 else BEAT, word.onset))
        else:
            continue
        last = word.onset
    return causes


def place_strokes(
    causes: list[Cause], take: SpokenTake, style: Style, rng: np.random.Generator
) -> list[Gesture]:
    """Puts each stroke before its stressed syllable and gives it a length.

    Strokes lead their syllable by about 0.2 s (the speaker's own habit, plus scatter).
    """
    gestures: list[Gesture] = []
    leads = np.clip(rng.normal(style.lead, _LEAD_SPREAD_S, len(causes)), 0.05, 0.4)
    starts = np.maximum([cause.time for cause in causes] - leads, 0.35)
    for i, cause in enumerate(causes):
        line = take.words[cause.word].line
        following = starts[i + 1] if i + 1 < len(causes) else take.line_ends[-1] + 0.6
        room = float(following - starts[i])
        chains = i > 0 and _may_chain(causes[i - 1], cause, style, rng)
        if cause.concept == INDEPENDENT_HOLD:
            length = 1.25 * rng.lognormal(0, 0.2)
        else:
            lexical = 1.0 if cause.concept in (BEAT, LISTING) else 1.12
            length = 0.60 * style.tempo * lexical * rng.lognormal(0, 0.26)
        # room for the next gesture's preparation, or at least none to spare
        length = float(np.clip(length, 0.28, max(room - _SHORTEST_PREPARATION_S, 0.3)))
        before = gestures[-1].end if gestures else 0.0
        prepared = not chains or starts[i] - before > 1.0
        gestures.append(Gesture(cause, float(starts[i]), float(starts[i]) + length, prepared, line))
    return gestures


def _may_chain(before: Cause, cause: Cause, style: Style, rng: np.random.Generator) -> bool:
    """Whether a gesture may start from where the last one ended."""
    chance = {BEAT: 0.5, LISTING: 0.55, INDEPENDENT_HOLD: 0.0, "number": 0.4}.get(
        cause.concept, 0.22
    )
    if before.concept == cause.concept:
        chance += 0.12
    return bool(rng.uniform() < chance * style.chain)


def fill_phases(
    gestures: list[Gesture], take: SpokenTake, style: Style, rng: np.random.Generator
) -> tuple[list[Gesture], list[Phase]]:
    """The phases between the strokes.

    Returns:
        The gestures, some strokes lengthened to reach the next one, and the phases, which cover the
        take from 0 to its end without gaps.
    """
    duration = take.speech.duration
    phases: list[Phase] = []
    if not gestures:
        return [], [Phase("none", 0.0, duration, -1)]

    def add(label: str, end: float, gesture: int) -> None:
        start = phases[-1].end if phases else 0.0
        phases.append(Phase(label, start, end, gesture))

    placed: list[Gesture] = []
    for i, gesture in enumerate(gestures):
        if i == 0:
            preparation = min(_draw(0.46, style.tempo, rng), gesture.start - 0.1)
            add("none", gesture.start - preparation, -1)
            add("preparation", gesture.start, 0)
        is_hold = gesture.cause.concept == INDEPENDENT_HOLD
        end = gesture.end
        last = i + 1 == len(gestures)
        if not last:
            following = gestures[i + 1]
            if not following.prepared and following.start - end < 0.28:
                end = following.start
        add("independent_hold" if is_hold else "stroke", end, i)
        placed.append(Gesture(gesture.cause, gesture.start, end, gesture.prepared, gesture.line))
        if last:
            hold = min(_draw(0.6, style.hold, rng), 0.4 * (duration - end))
            add("hold", end + hold, i)
            add("retract", min(end + hold + _draw(0.45, style.tempo, rng), duration - 0.1), i)
            add("none", duration, i)
        elif following.start > end:
            new_line = following.line != gesture.line
            for label, stop, owner in _between(end, i, following, new_line, style, rng):
                add(label, stop, owner)
    return placed, phases


def _between(
    start: float,
    index: int,
    following: Gesture,
    new_line: bool,
    style: Style,
    rng: np.random.Generator,
) -> list[tuple[str, float, int]]:
    """Labels, ends and owners of the phases between one stroke's end and the next one's start."""
    stop = following.start
    gap = stop - start
    if not following.prepared:
        return [("hold", stop, index)]
    preparation = min(_draw(0.5, style.tempo, rng), max(gap, _SHORTEST_PREPARATION_S))
    pre_hold = _draw(0.45, style.hold, rng) if rng.uniform() < 0.31 else 0.0
    if gap - preparation < pre_hold:
        pre_hold = 0.0
    left = gap - preparation - pre_hold
    labels: list[tuple[str, float, int]] = []
    lull = 1.0 if new_line else 0.45
    retraction = _draw(0.5, style.tempo, rng)
    if left > 1.1 + retraction and rng.uniform() < 0.5 * lull:
        hold = rng.uniform(0, 0.5) * (left - 1.0 - retraction)
        if hold > _SHORTEST_HOLD_S:
            labels.append(("hold", start + hold, index))
        else:
            hold = 0.0
        labels.append(("retract", start + hold + retraction, index))
        labels.append(("none", start + left, index))
    elif left > retraction and rng.uniform() < min(0.65 * left, 1) * (0.9 if new_line else 0.6):
        labels += _relax(start, left, retraction, index, rng)
    elif left > _SHORTEST_HOLD_S:
        labels.append(("hold", start + left, index))
    else:
        preparation += left
    if pre_hold:
        labels.append(("preparation", stop - pre_hold, index + 1))
        labels.append(("pre_hold", stop, index + 1))
    else:
        labels.append(("preparation", stop, index + 1))
    return labels


def _relax(
    start: float, left: float, retraction: float, index: int, rng: np.random.Generator
) -> list[tuple[str, float, int]]:
    """A partial retraction, with a hold before it and a rest after it where there is time."""
    spare = left - retraction
    hold, rest = spare, 0.0
    if spare > 0.5 and rng.uniform() < 0.75:
        rest = spare if spare < 1.1 else spare * rng.uniform(0.5, 0.9)
        hold = spare - rest
    if hold <= _SHORTEST_HOLD_S:
        retraction, hold = retraction + hold, 0.0
    labels = [("hold", start + hold, index)] if hold else []
    labels.append(("partial_retract", start + hold + retraction, index))
    if rest:
        labels.append(("rest_hold", start + left, index))
    return labels


def _draw(mean: float, habit: float, rng: np.random.Generator) -> float:
    return float(np.clip(mean * habit * rng.lognormal(-0.03, 0.25), 0.4 * mean, 2.2 * mean))
