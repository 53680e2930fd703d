"""Trunk and head: sway, weight shifts, glances, nods and shakes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.synthetic.body import HAND_CHANNELS, Posture
from cospeech.corpus.synthetic.phrasing import Gesture
from cospeech.corpus.synthetic.skeleton import STANDING_HEIGHT_M
from cospeech.corpus.synthetic.speakers import Style
from cospeech.corpus.synthetic.takes import SpokenTake, TakePlan

_Array = NDArray[np.float64]

_NOD_S, _NOD_RAD = 0.42, 0.10
_SHAKE_S, _SHAKE_RAD, _SHAKE_HZ = 0.95, 0.13, 2.1
_BREATH_HZ = 0.27


def wander(
    times: _Array, channels: int, slow_hz: float, fast_hz: float, rng: np.random.Generator
) -> _Array:
    """Smooth noise ``(T, channels)`` of unit variance: eight sinusoids of chance frequency each.

    An analytic function of time, so that the frame rate doesn't change the motion.
    """
    frequencies = np.exp(rng.uniform(np.log(slow_hz), np.log(fast_hz), (8, channels)))
    offsets = rng.uniform(0, 2 * np.pi, (8, channels))
    # slow swings are the large ones
    weights = frequencies**-0.5
    weights /= np.sqrt(np.sum(weights**2, axis=0) / 2)
    result = np.zeros((len(times), channels))
    for frequency, offset, weight in zip(frequencies, offsets, weights, strict=True):
        result += weight * np.sin(2 * np.pi * frequency * times[:, None] + offset)
    return result


def hand_tremor(times: _Array, rng: np.random.Generator) -> _Array:
    """``(T, 2, 12)`` to add to the hands: millimetres and hundredths of a radian."""
    noise = wander(times, 2 * HAND_CHANNELS, 0.3, 2.5, rng).reshape(-1, 2, HAND_CHANNELS)
    return noise * np.array([0.002] * 3 + [0.02] * 3 + [0.02] * 6)


def make_posture(
    times: _Array,
    hands: _Array,
    take: TakePlan,
    spoken: SpokenTake,
    gestures: list[Gesture],
    rng: np.random.Generator,
) -> Posture:
    """Everything but the hands.

    Args:
        times: ``(T,)`` s.
        hands: ``(T, 2, 12)``: the trunk follows them a little.
        take: The plan.
        spoken: Its audio track.
        gestures: Their strokes make the head nod or shake.
        rng: Source of chance.
    """
    style = take.speaker.style
    heading = float(rng.uniform(-0.25, 0.25))
    openings = [
        float(start)
        for line, start in zip(take.lines, spoken.line_starts, strict=True)
        if line.sentence.opens_topic
    ]
    # at a new topic the weight goes to the other foot and the body turns a little
    shifts = _steps(times, [t - 0.6 for t in openings], (0.025, 0.015, 0.10), 1.1, rng)
    sway = wander(times, 6, 0.04, 0.35, rng) * style.sway
    hips = np.empty((len(times), 3))
    aside = shifts[:, 0] * style.sway + 0.010 * sway[:, 0]
    ahead = shifts[:, 1] * style.sway + 0.008 * sway[:, 1]
    hips[:, 0] = aside * np.cos(heading) + ahead * np.sin(heading)
    hips[:, 2] = ahead * np.cos(heading) - aside * np.sin(heading)
    hips[:, 1] = STANDING_HEIGHT_M - 0.003 + 0.001 * sway[:, 2] - 0.9 * (aside**2 + ahead**2)
    hips_turn = np.zeros((len(times), 3))
    hips_turn[:, 0] = 0.02 + 0.008 * sway[:, 3]
    hips_turn[:, 1] = heading + shifts[:, 2] * style.sway + 0.02 * sway[:, 4]
    hips_turn[:, 2] = 0.9 * aside + 0.006 * sway[:, 5]

    breath = np.sin(2 * np.pi * _BREATH_HZ * times + rng.uniform(0, 2 * np.pi))
    # the trunk turns towards the busier hand and leans after hands that reach out
    pull_aside = hands[:, 0, 0] - hands[:, 1, 0]
    reach = hands[:, :, 2].mean(axis=1) - 0.2
    height = hands[:, :, 1].mean(axis=1) + 0.3
    spine = np.empty((len(times), 3))
    noise = wander(times, 3, 0.05, 0.6, rng) * style.sway
    spine[:, 0] = 0.04 + 0.012 * breath + 0.20 * reach - 0.10 * height + 0.018 * noise[:, 0]
    spine[:, 1] = 0.28 * pull_aside + 0.025 * noise[:, 1]
    spine[:, 2] = -0.10 * pull_aside - 0.8 * hips_turn[:, 2] + 0.015 * noise[:, 2]

    head = wander(times, 3, 0.15, 1.4, rng) * (0.022, 0.030, 0.022)
    glances = _steps(
        times, [float(t) - 0.2 for t in spoken.line_starts], (0.05, 0.20, 0.06), 0.55, rng
    )
    head += glances
    # the eyes stay with the listener: the head undoes most of the trunk's turn
    head[:, 0] -= 0.8 * (spine[:, 0] - 0.04)
    head[:, 1] -= 0.7 * spine[:, 1] + 0.5 * (hips_turn[:, 1] - heading)
    head[:, 2] -= 0.7 * (spine[:, 2] + hips_turn[:, 2])
    _nod_and_shake(head, times, spoken, gestures, style, rng)
    return Posture(hips, hips_turn, spine, head, heading, style.elbow)


def _steps(
    times: _Array,
    moments: list[float],
    sizes: tuple[float, ...],
    length: float,
    rng: np.random.Generator,
) -> _Array:
    """Positions ``(T, len(sizes))`` that change by minimum jerk at each moment."""
    value = rng.normal(0, sizes)
    result = np.tile(value, (len(times), 1))
    for moment in moments:
        goal = np.clip(rng.normal(0, sizes), -2 * np.array(sizes), 2 * np.array(sizes))
        part = np.clip((times - moment) / length, 0, 1)[:, None]
        result += (goal - value) * (part**3 * (10 - 15 * part + 6 * part * part))
        value = goal
    return result


def _nod_and_shake(
    head: _Array,
    times: _Array,
    spoken: SpokenTake,
    gestures: list[Gesture],
    style: Style,
    rng: np.random.Generator,
) -> None:
    """Adds nods on stressed syllables and a shake to each negation, in place."""
    gestured = {gesture.cause.word: gesture.cause.concept for gesture in gestures}
    for index, word in enumerate(spoken.words):
        luck, size, early = rng.uniform(), rng.lognormal(0, 0.3), rng.normal(0.08, 0.03)
        start = word.onset - early
        if gestured.get(index) == "negation":
            part = (times - start) / _SHAKE_S
            window = np.sin(np.pi * np.clip(part, 0, 1)) ** 2
            head[:, 1] += (
                _SHAKE_RAD * size * window * np.sin(2 * np.pi * _SHAKE_HZ * (times - start))
            )
        elif word.stress == 2 and luck < style.nod * (0.8 if index in gestured else 0.15):
            part = (times - start) / _NOD_S
            head[:, 0] += _NOD_RAD * size * np.sin(np.pi * np.clip(part, 0, 1)) ** 2
