"""Which concept a stroke shows: by what the wrists do, whatever the size and place of the gesture.

A trained method may gesture smaller than people do, and elsewhere. So what is compared is the
course of the wrists' velocities, by its direction in that space alone (cosine). Recorded strokes of
held-out takes are told apart better by it than by positions, and a method that damps is not
punished for that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cospeech.motion.upper_body import UPPER_BODY
from cospeech.studies.caused_gestures.strokes import Stroke

Array = NDArray[np.float64]

WRISTS = (UPPER_BODY.index["left_wrist"], UPPER_BODY.index["right_wrist"])

STEPS = 7
"""Steps that a stroke of any length is cut into."""

_MOTIONLESS_M = 1e-6


def wrist_steps(positions: ArrayLike, fps: float, start_s: float, end_s: float) -> Array:
    """How both wrists move over a stretch of time, in `STEPS` steps of equal length.

    Args:
        positions: ``(T, 10, 3)`` upper body, root-relative, metres; between frames it is a line.
        fps: Frames per second.
        start_s: Start of the stretch, seconds.
        end_s: Its end.

    Returns:
        ``(STEPS, 2, 3)`` metres per step, left wrist first.
    """
    wrists = np.asarray(positions, dtype=np.float64)[:, WRISTS].reshape(-1, 6)
    frames = np.linspace(start_s, end_s, STEPS + 1) * fps
    known = np.arange(len(wrists))
    places = np.stack([np.interp(frames, known, path) for path in wrists.T], axis=-1)
    return np.diff(places, axis=0).reshape(STEPS, 2, 3)


@dataclass(frozen=True, eq=False)
class ConceptShapes:
    """What strokes of each concept look like, one shape per choice of hands.

    A concept made by the left hand, the right or both is three movements of the wrists, and their
    mean is none of them.

    Attributes:
        concepts: ``(K,)`` names in order.
        shapes: ``(C, STEPS * 6)`` unit vectors.
        concept_of: ``(C,)`` index of each shape's concept.
    """

    concepts: tuple[str, ...]
    shapes: Array
    concept_of: NDArray[np.int64]

    @classmethod
    def of(cls, steps: ArrayLike, strokes: Sequence[Stroke]) -> ConceptShapes:
        """The mean shapes of recorded strokes.

        Args:
            steps: ``(n, STEPS, 2, 3)`` from `wrist_steps`.
            strokes: ``(n,)`` theirs.
        """
        flat = np.asarray(steps, dtype=np.float64).reshape(len(strokes), -1)
        labels = [(stroke.concept, stroke.hands) for stroke in strokes]
        concepts = tuple(sorted({concept for concept, _ in labels}))
        known = sorted(set(labels))
        means = [flat[[label == each for label in labels]].mean(axis=0) for each in known]
        return cls(
            concepts,
            _directions(np.reshape(means, (len(known), -1))),
            np.array([concepts.index(concept) for concept, _ in known], dtype=np.int64),
        )

    def likeness(self, steps: ArrayLike) -> Array:
        """How like each concept strokes are: the cosine with the likest of its shapes.

        Args:
            steps: ``(n, STEPS, 2, 3)``.

        Returns:
            ``(n, K)`` from -1 to 1; 0 for wrists that don't move.
        """
        flat = np.asarray(steps, dtype=np.float64)
        cosines = _directions(flat.reshape(len(flat), -1)) @ self.shapes.T
        each = [cosines[:, self.concept_of == k].max(axis=1) for k in range(len(self.concepts))]
        return np.stack(each, axis=1)


def votes(likeness: Array) -> Array:
    """Which concept each stroke is taken for, ``(n, K)``: 1 for the likest, shared between equals.

    So motion that shows nothing is right once in K.
    """
    best = likeness == likeness.max(axis=1, keepdims=True)
    shares: Array = best / best.sum(axis=1, keepdims=True)
    return shares


def places(likeness: Array) -> Array:
    """The share of the other concepts that are less like a stroke than each, ``(n, K)``.

    1 for the likest, 0 for the least like; those equally like count half.
    """
    others = likeness[:, None, :]
    own = likeness[:, :, None]
    lower = (others < own).sum(axis=2) + 0.5 * ((others == own).sum(axis=2) - 1)
    shares: Array = lower / max(1, likeness.shape[1] - 1)
    return shares


def matched(scores: Array, concepts: NDArray[np.int64]) -> tuple[float, float]:
    """Sum of what strokes score for the concepts that caused them, and what luck gives.

    Luck is what they score for the concepts of the take's other strokes: what comes of showing each
    concept as often, without knowing when. Of a single stroke it is the mean over all concepts.

    Args:
        scores: ``(n, K)`` `votes` or `places` of the strokes of one take.
        concepts: ``(n,)`` index of the concept that caused each.
    """
    count = len(concepts)
    own = float(scores[np.arange(count), concepts].sum())
    if count == 1:
        return own, float(scores.mean())
    return own, (float(scores[:, concepts].sum()) - own) / max(1, count - 1)


def _directions(flat: Array) -> Array:
    lengths = np.linalg.norm(flat, axis=1, keepdims=True)
    moving = lengths > _MOTIONLESS_M
    return np.divide(flat, lengths, out=np.zeros_like(flat), where=moving)
