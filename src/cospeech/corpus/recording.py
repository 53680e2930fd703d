"""One take: speech and motion of one speaker on one clock."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cospeech.motion.motion import Motion
from cospeech.speech.speech import Speech


@dataclass(frozen=True, eq=False)
class Recording:
    """Speech and motion of one take, as a reader yields it.

    Attributes:
        id: Unique within the corpus; letters, digits, ``-``, ``_``, ``.``.
        speaker: Speaker name.
        speech: Audio and words.
        motion: Full-skeleton motion at its native rate.
        phases: Gesture-phase label per motion frame, ``(T,)`` int8 into
            `cospeech.motion.phases.PHASES`; None when not annotated.
        annotations: Anything else known about the take, as JSON values (for the embedded corpus:
            strokes, their causes, the speaker's style).
        split: ``"train"``, ``"val"`` or ``"test"`` when the corpus publishes its split.
        source: Where it comes from: file names or the generator's arguments.
        licence: Licence of the data.
    """

    id: str
    speaker: str
    speech: Speech
    motion: Motion
    phases: NDArray[np.int8] | None = None
    annotations: dict[str, Any] = field(default_factory=dict)
    split: str | None = None
    source: str = ""
    licence: str = ""
