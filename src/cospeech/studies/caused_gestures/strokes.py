"""Strokes whose causes are known: which word, which concept, when."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.manifest import rebuild
from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.corpus.synthetic.lexicon import BEAT, INDEPENDENT_HOLD, LISTING
from cospeech.errors import CospeechError
from cospeech.foreign import understood
from cospeech.motion.upper_body import EVALUATION_FPS

Kind = Literal["words", "beats"]

KINDS: tuple[Kind, ...] = ("words", "beats")
"""Strokes that a word's meaning causes, and beats, which a stressed syllable does.

Items of a list and independent holds are neither: they count as strokes, and nothing is asked of
them.
"""


@dataclass(frozen=True)
class Stroke:
    """A stroke and its cause.

    Attributes:
        concept: Kind of gesture (`cospeech.corpus.synthetic.lexicon.CONCEPTS`).
        hands: Which hands make it: ``"left"``, ``"right"`` or ``"both"``.
        start_s: Onset, seconds from the start of the take.
        end_s: End.
    """

    concept: str
    hands: str
    start_s: float
    end_s: float

    @property
    def kind(self) -> Kind | None:
        """What is asked of it; None for items of a list and independent holds."""
        if self.concept == BEAT:
            return "beats"
        return None if self.concept in (LISTING, INDEPENDENT_HOLD) else "words"

    @property
    def middle_s(self) -> float:
        """Where a stroke is fastest, seconds."""
        return (self.start_s + self.end_s) / 2


@dataclass(frozen=True, eq=False)
class Take:
    """A stretch of a recording with its strokes.

    Attributes:
        span: Where it is in the store.
        name: Of the recording.
        speaker: Of the recording.
        positions: ``(T, 10, 3)`` recorded upper body at the evaluation rate, root-relative, metres.
        strokes: All of them, in order.
    """

    span: Span
    name: str
    speaker: str
    positions: NDArray[np.float32]
    strokes: tuple[Stroke, ...]

    @property
    def gesturing_s(self) -> tuple[float, float]:
        """From the first stroke's onset to the last one's end, seconds.

        Hands rest before and after in all takes alike, whatever is said.
        """
        return self.strokes[0].start_s, self.strokes[-1].end_s

    def of_kind(self, kind: Kind) -> list[Stroke]:
        """Its strokes of a kind."""
        return [stroke for stroke in self.strokes if stroke.kind == kind]


def read_takes(store: Store, spans: Sequence[Span]) -> list[Take]:
    """The takes of some spans that have strokes of known cause.

    Args:
        store: The corpus.
        spans: Stretches of its recordings; strokes that one cuts are left out.

    Raises:
        CospeechError: None has, or the annotations are damaged.
    """
    takes = []
    for span in spans:
        recording = store.recordings[span.recording]
        strokes = _read_strokes(store, span)
        if strokes:
            positions = store.upper_body(span.recording, span.start, span.stop)
            takes.append(Take(span, recording.id, recording.speaker, positions, strokes))
    if not takes:
        raise CospeechError(
            f"{store.name}: nothing is known of what caused its gestures",
            "judge a run of the embedded corpus, where it is: train.py data=synthetic",
        )
    return takes


def _read_strokes(store: Store, span: Span) -> tuple[Stroke, ...]:
    values = store.annotations(span.recording)
    first_s = span.start / EVALUATION_FPS
    duration_s = (span.stop - span.start) / EVALUATION_FPS
    path, what = store.path / "annotations.jsonl", "annotations of a store"
    with understood(path, what, rebuild(store.path)):
        strokes = [
            Stroke(
                str(gesture["kind"]),
                str(gesture["hand"]),
                float(gesture["stroke_start"]) - first_s,
                float(gesture["stroke_end"]) - first_s,
            )
            for gesture in values.get("gestures", ())
        ]
    inside = [s for s in strokes if 0 <= s.start_s < s.end_s <= duration_s]
    return tuple(sorted(inside, key=lambda stroke: stroke.start_s))
