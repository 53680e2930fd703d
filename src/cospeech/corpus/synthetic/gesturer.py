"""From phases and forms to the paths of both hands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.synthetic.body import FLEXION, HAND_CHANNELS, POSITION, keep_clear
from cospeech.corpus.synthetic.forms import (
    Form,
    choose_hands,
    continue_hands,
    make_form,
    relaxed_pose,
    rest_pose,
)
from cospeech.corpus.synthetic.lexicon import INDEPENDENT_HOLD
from cospeech.corpus.synthetic.outlines import LEFT, RIGHT
from cospeech.corpus.synthetic.phrasing import Gesture, Phase
from cospeech.corpus.synthetic.speakers import Style
from cospeech.corpus.synthetic.takes import SpokenTake, TakePlan

_Array = NDArray[np.float64]

_LOUDNESS_GAIN = 0.09  # natural logarithm of size per standard deviation of the syllable's level
_AROUSAL_GAIN = 0.35
_LONG_REST_S = 1.3
_MEAN_SPEED = 1.4  # m/s at most over a phase; minimum jerk peaks at 1.9 times that
_IDLE_MEAN_SPEED = 0.8


@dataclass(frozen=True, eq=False)
class HandPaths:
    """Paths of both hands, one segment per phase.

    On a segment ``s`` runs from 0 to 1 by minimum jerk, and a channel is ``start + (end - start) s
    + arc sin(pi s) + sine sin(2 pi c s) + cosine (1 - cos(2 pi c s))`` with ``c`` cycles: at rest
    at both ends, whatever its shape.

    Attributes:
        times: ``(K + 1,)`` segment borders, s.
        poses: ``(K + 1, 2, 12)`` hands at the borders.
        arc: ``(K, 2, 12)``.
        sine: ``(K, 2, 12)``.
        cosine: ``(K, 2, 12)``.
        cycles: ``(K,)``.
        lags: ``(2,)`` delay of the left and the right hand, s.
    """

    times: _Array
    poses: _Array
    arc: _Array
    sine: _Array
    cosine: _Array
    cycles: _Array
    lags: _Array

    def at(self, times: _Array) -> _Array:
        """Hands ``(T, 2, 12)`` at ``times`` in seconds."""
        hands = np.empty((len(times), 2, HAND_CHANNELS))
        for side in (LEFT, RIGHT):
            moments = times - self.lags[side]
            which = np.clip(
                np.searchsorted(self.times, moments, side="right") - 1, 0, len(self.cycles) - 1
            )
            start, stop = self.times[which], self.times[which + 1]
            part = np.clip((moments - start) / (stop - start), 0, 1)
            way = (part**3 * (10 - 15 * part + 6 * part * part))[:, None]
            turn = 2 * np.pi * self.cycles[which][:, None] * way
            before, after = self.poses[which, side], self.poses[which + 1, side]
            hands[:, side] = (
                before
                + (after - before) * way
                + self.arc[which, side] * np.sin(np.pi * way)
                + self.sine[which, side] * np.sin(turn)
                + self.cosine[which, side] * (1 - np.cos(turn))
            )
        return hands


def amplitudes(take: TakePlan, spoken: SpokenTake, gestures: list[Gesture]) -> _Array:
    """Size of each gesture without chance, ``(G,)``: speaker, arousal, loudness of the syllable."""
    levels = np.array([word.loudness for word in spoken.words if word.stress == 2] or [0.0])
    mean, spread = float(levels.mean()), float(levels.std()) + 1e-6
    sizes = []
    for gesture in gestures:
        level = spoken.words[gesture.cause.word].loudness
        louder = float(np.clip((level - mean) / spread, -2, 2))
        arousal = take.lines[gesture.line].arousal
        sizes.append(
            take.speaker.style.amplitude * np.exp(_LOUDNESS_GAIN * louder + _AROUSAL_GAIN * arousal)
        )
    return np.array(sizes)


def plan_hands(
    gestures: list[Gesture],
    phases: list[Phase],
    sizes: _Array,
    words: list[str],
    style: Style,
    rng: np.random.Generator,
) -> tuple[HandPaths, list[Form]]:
    """Moves the hands through the phases.

    Args:
        gestures: In order.
        phases: Their phases, without gaps.
        sizes: ``(G,)`` from `amplitudes`.
        words: The word behind each gesture.
        style: Of the speaker.
        rng: Source of chance.

    Returns:
        The paths and the form of each gesture.
    """
    rest = rest_pose(style)
    pose = _jitter(rest, 0.012, rng)
    segments: list[tuple[_Array, _Array, _Array, int]] = []
    borders = [pose]
    forms: list[Form] = []
    still = np.zeros((2, HAND_CHANNELS))

    def form_of(index: int) -> Form:
        if index == len(forms):
            gesture = gestures[index]
            previous = forms[-1].hands if forms else None
            if gesture.prepared or previous is None:
                hands = choose_hands(gesture.cause.concept, style, previous, rng)
            else:
                hands = continue_hands(gesture.cause.concept, style, previous)
            size = float(sizes[index] * np.exp(rng.normal(0, 0.08)))
            forms.append(
                make_form(
                    gesture.cause.concept,
                    words[index],
                    gesture.cause.list_position,
                    hands,
                    pose,
                    gesture.prepared,
                    size,
                    style,
                    rng,
                )
            )
        return forms[index]

    for phase in phases:
        length = phase.end - phase.start
        arc, sine, cosine, cycles = still, still, still, 1
        if phase.label == "preparation":
            form = form_of(phase.gesture)
            target = _with_idle_hand(form, pose, rest, length, rng)
            target = _in_time(pose, target, length)
            arc = _curve(pose, target, rng)
        elif phase.label in ("stroke", "independent_hold"):
            form = form_of(phase.gesture)
            target = form.end.copy()
            for side in (LEFT, RIGHT):
                if not form.hands[side]:
                    target[side] = pose[side]
            if gestures[phase.gesture].cause.concept == INDEPENDENT_HOLD:
                target = _drift(pose, length, rng)
            else:
                cycles = form.cycles
                target, arc, sine, cosine = _stroke_in_time(pose, target, form, length)
        elif phase.label == "partial_retract":
            target = 0.25 * pose + 0.75 * relaxed_pose(style, rng)
            arc = _curve(pose, target, rng)
        elif phase.label == "retract":
            target = _in_time(pose, _jitter(rest, 0.015, rng), length)
            arc = _curve(pose, target, rng)
        else:
            target = _drift(pose, length, rng)
            if phase.label == "none" and length > _LONG_REST_S and rng.uniform() < 0.35:
                # the hands shift or fumble a little: movement that is no gesture
                arc = np.zeros_like(still)
                arc[:, POSITION] = np.abs(rng.normal((0, 0.01, 0.01), 0.02, (2, 3)))
                arc[:, FLEXION] = rng.normal(0, 0.2)
        segments.append((arc, sine, cosine, cycles))
        borders.append(target)
        pose = target
    weaker = LEFT if style.right_share > 0.5 else RIGHT
    lags = np.zeros(2)
    lags[weaker] = style.hand_lag
    paths = HandPaths(
        np.array([phases[0].start, *(phase.end for phase in phases)]),
        np.stack(borders),
        np.stack([arc for arc, _, _, _ in segments]),
        np.stack([sine for _, sine, _, _ in segments]),
        np.stack([cosine for _, _, cosine, _ in segments]),
        np.array([cycles for _, _, _, cycles in segments]),
        lags,
    )
    return paths, forms


def stroke_extents(paths: HandPaths, gestures: list[Gesture], forms: list[Form]) -> list[float]:
    """How far each gesture's leading wrist gets from where its stroke starts, m."""
    extents = []
    for gesture, form in zip(gestures, forms, strict=True):
        moments = np.linspace(gesture.start, gesture.end, 24)
        side = RIGHT if form.hands[RIGHT] else LEFT
        wrist = keep_clear(paths.at(moments + paths.lags[side]))[:, side, POSITION]
        away = np.sqrt(np.sum((wrist - wrist[0]) ** 2, axis=-1))
        extents.append(float(away.max()))
    return extents


def _norm(hands: _Array) -> _Array:
    """Distance ``(2, 1)`` that each hand's position spans."""
    square: _Array = np.sum(hands[:, POSITION] ** 2, axis=-1, keepdims=True)
    return np.sqrt(square)


def _in_time(pose: _Array, target: _Array, length: float) -> _Array:
    """The target, or as far towards it as a hand can get in ``length`` seconds."""
    way = target - pose
    return pose + way * np.minimum(1, _MEAN_SPEED * length / (_norm(way) + 1e-9))


def _stroke_in_time(
    pose: _Array, target: _Array, form: Form, length: float
) -> tuple[_Array, _Array, _Array, _Array]:
    """Target, arc, sine and cosine of a stroke, shrunk together where time is short."""
    way = target - pose
    turns = 2 * np.pi * form.cycles * np.maximum(_norm(form.sine), _norm(form.cosine))
    # to the middle of an arc and back in the same time is about as fast as 1.7 of its height
    effort = _norm(way) + 1.7 * _norm(form.arc) + turns
    share = np.minimum(1, _MEAN_SPEED * length / (effort + 1e-9))
    return pose + way * share, form.arc * share, form.sine * share, form.cosine * share


def _with_idle_hand(
    form: Form, pose: _Array, rest: _Array, length: float, rng: np.random.Generator
) -> _Array:
    """The form's start; a hand it doesn't use sinks towards its rest or stays."""
    target = form.start.copy()
    for side in (LEFT, RIGHT):
        luck, depth = rng.uniform(size=2)
        if form.hands[side]:
            continue
        target[side] = pose[side]
        if luck < 0.5:
            # without hurry: nobody looks at this hand
            far = float(_norm(rest - pose)[side, 0])
            sunk = min(0.4 + 0.6 * depth, _IDLE_MEAN_SPEED * length / (far + 1e-9))
            target[side] = (1 - sunk) * pose[side] + sunk * rest[side]
    return target


def _curve(pose: _Array, target: _Array, rng: np.random.Generator) -> _Array:
    """An arc for a way: hands swing outwards and forwards rather than move in straight lines."""
    arc = np.zeros_like(pose)
    way = target[:, POSITION] - pose[:, POSITION]
    distance = np.sqrt(np.sum(way * way, axis=-1, keepdims=True))
    arc[:, POSITION] = distance * rng.normal((0.05, 0.0, 0.10), 0.06, (2, 3))
    arc[:, FLEXION] = 0.5 * distance[:, 0]
    return arc


def _drift(pose: _Array, length: float, rng: np.random.Generator) -> _Array:
    """Where held hands get to: they sag and wander by millimetres."""
    moved = pose.copy()
    moved[:, POSITION] += rng.normal(0, 0.003, (2, 3)) * np.sqrt(length)
    moved[:, 1] -= 0.004 * min(length, 1.5)
    moved[:, 3:] += rng.normal(0, 0.02, moved[:, 3:].shape)
    return moved


def _jitter(pose: _Array, metres: float, rng: np.random.Generator) -> _Array:
    moved = pose.copy()
    moved[:, POSITION] += rng.normal(0, metres, (2, 3))
    moved[:, 3:] += rng.normal(0, 0.05, moved[:, 3:].shape)
    return moved
