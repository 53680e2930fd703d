"""One take: speech and motion of one speaker on one clock."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cospeech.motion.motion import Motion
from cospeech.speech.speech import Speech


@dataclass(frozen=True, eq=False)
class WindowList:
    """The windows of a recording that its published preprocessing keeps.

    Attributes:
        fps: Frame rate of the windows and of the recording's motion.
        frames: Frames that the published filters looked at.
        stride: Frames from one candidate window's start to the next.
        starts: ``(W,)`` int64 first frames of the windows kept, ascending.
        audio_starts: ``(W,)`` int64 first samples of the windows' audio, at 16 kHz: published code
            does not always cut audio at ``start / fps``.
        dropped: Reason -> number of candidate windows left out.
    """

    fps: float
    frames: int
    stride: int
    starts: NDArray[np.int64]
    audio_starts: NDArray[np.int64]
    dropped: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Remark:
    """Something about a recording that its user should know; it is used all the same.

    Attributes:
        kind: In a few words, the same for all of its kind, for counting: ``"no usable phases"``.
        text: A sentence: what, in which file.
        advice: What to do about it, or to type; empty where nothing needs doing.
        path: The file, where the remark is about one: odd, or not to be used.
    """

    kind: str
    text: str
    advice: str = ""
    path: Path | None = None


@dataclass(frozen=True, eq=False)
class Recording:
    """Speech and motion of one take, as a reader yields it.

    Attributes:
        id: Unique within the corpus; letters, digits, ``-``, ``_``, ``.``.
        speaker: Speaker name.
        speech: Audio and words; a waveform of no samples where the corpus has no audio.
        motion: Full-skeleton motion at its native rate.
        phases: Gesture-phase label per motion frame, ``(T,)`` int8 into
            `cospeech.motion.phases.PHASES`; None when not annotated.
        annotations: Anything else known about the take, as JSON values (for the embedded corpus:
            strokes, their causes, the speaker's style).
        split: ``"train"``, ``"val"`` or ``"test"`` when the corpus publishes its split.
        source: Where it comes from: file names or the generator's arguments.
        licence: Licence of the data.
        interlocutor: Speech of the other side of a dialogue, on the same clock.
        windows: The only windows of the published list; None where any window may be used.
        remarks: What its user should know.
        files: Those it was made of; where several were tried, the ones that were used.
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
    interlocutor: Speech | None = None
    windows: WindowList | None = None
    remarks: tuple[Remark, ...] = ()
    files: tuple[Path, ...] = ()
