"""Gesture phases (Ferstl et al. 2020, section 3; Kendon's terms)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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

_FRAME_ROUNDING = 1e-6


@dataclass(frozen=True)
class PhaseSegment:
    """A stretch of time with one label.

    Attributes:
        start_s: Its first moment, s.
        end_s: The moment after its last, s.
        label: Name in `PHASES`.
    """

    start_s: float
    end_s: float
    label: str


def frame_phases(segments: Iterable[PhaseSegment], frames: int, fps: float) -> NDArray[np.int8]:
    """Label index of every frame.

    Frame i shows time ``i / fps`` and has the label of the segment with
    ``start_s <= i / fps < end_s``. Time without a segment is ``"none"``. Where segments overlap,
    the one that starts later counts, and of two that start together the later in ``segments``: a
    phase annotated inside a longer one stays visible.

    Args:
        segments: In any order.
        frames: Number of frames.
        fps: Frames per second.

    Returns:
        ``(frames,)`` int8 indices into `PHASES`.
    """
    labels = np.full(frames, PHASE_INDEX["none"], dtype=np.int8)
    for segment in sorted(segments, key=lambda segment: segment.start_s):
        first, stop = (
            # A time written with few digits must not fall a frame late.
            int(np.clip(np.ceil(time * fps - _FRAME_ROUNDING), 0, frames))
            for time in (segment.start_s, segment.end_s)
        )
        labels[first:stop] = PHASE_INDEX[segment.label]
    return labels


@dataclass(frozen=True)
class PhaseMerge:
    """A way to make fewer classes of the nine labels.

    Attributes:
        name: What it is called in settings.
        classes: Names of the classes; a class is an index into them.
        class_of: Class index of each of `PHASES`.
    """

    name: str
    classes: tuple[str, ...]
    class_of: tuple[int, ...]

    def __call__(self, labels: NDArray[np.integer]) -> NDArray[np.int64]:
        """Class index of every label; any shape.

        Raises:
            ValueError: A label is not an index into `PHASES`.
        """
        labels = np.asarray(labels)
        if labels.size and not (labels.min() >= 0 and labels.max() < len(PHASES)):
            raise ValueError(f"labels from {labels.min()} to {labels.max()}, not 0 to 8")
        return np.array(self.class_of, dtype=np.int64)[labels]


def _merge(name: str, classes: Mapping[str, tuple[str, ...]]) -> PhaseMerge:
    found = {label: i for i, labels in enumerate(classes.values()) for label in labels}
    return PhaseMerge(name, tuple(classes), tuple(found[label] for label in PHASES))


_HOLDS = ("pre_hold", "hold", "independent_hold", "rest_hold")
_OTHER = ("partial_retract", "retract", "none")

NINE_CLASSES = PhaseMerge("nine", PHASES, tuple(range(len(PHASES))))
"""As annotated."""

SIX_CLASSES = _merge(
    "six",
    {
        "preparation": ("preparation",),
        "stroke": ("stroke",),
        "hold": _HOLDS,
        "partial_retract": ("partial_retract",),
        "retract": ("retract",),
        "none": ("none",),
    },
)
"""Ferstl et al.: the four holds are one."""

FOUR_CLASSES = _merge(
    "four",
    {"preparation": ("preparation",), "stroke": ("stroke",), "hold": _HOLDS, "other": _OTHER},
)
"""Ferstl et al., for the GAN: the six with retractions and none as one. A relaxed rest
(`rest_hold`) is a hold, which velocities alone can't tell from one."""

FOUR_CLASSES_REST_OTHER = _merge(
    "four_rest_other",
    {
        "preparation": ("preparation",),
        "stroke": ("stroke",),
        "hold": tuple(label for label in _HOLDS if label != "rest_hold"),
        "other": ("rest_hold", *_OTHER),
    },
)
"""The four with a relaxed rest as other; for classifiers that see positions."""

FIVE_CLASSES = _merge(
    "five",
    {
        "rest": ("rest_hold", "none"),
        "preparation": ("preparation",),
        "stroke": ("stroke",),
        "hold": ("pre_hold", "hold", "independent_hold"),
        "retraction": ("partial_retract", "retract"),
    },
)
"""The phases of the UCI Gesture Phase set (Madeo et al.)."""

STROKE_CLASSES = _merge(
    "stroke",
    {
        "no_stroke": tuple(label for label in PHASES if label != "stroke"),
        "stroke": ("stroke",),
    },
)
"""Ferstl et al.'s one-class net: the class index is the target of its sigmoid."""

PHASE_MERGES: dict[str, PhaseMerge] = {
    merge.name: merge
    for merge in (
        NINE_CLASSES,
        SIX_CLASSES,
        FIVE_CLASSES,
        FOUR_CLASSES,
        FOUR_CLASSES_REST_OTHER,
        STROKE_CLASSES,
    )
}
"""By the name that settings give."""
