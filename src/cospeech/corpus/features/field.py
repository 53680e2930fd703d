"""What a field of a batch declares of itself, and how its values come about."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.store import Store
from cospeech.errors import CospeechError
from cospeech.motion.skeleton import Skeleton
from cospeech.speech.speech import SAMPLE_RATE, Speech

if TYPE_CHECKING:
    from cospeech.corpus.features.span_motion import SpanMotion
    from cospeech.corpus.features.streaming import RowStream

Axis = Literal["method frames", "evaluation frames", "samples", "none"]
"""What an index along a window means: a frame at the method's rate, one at the evaluation's 15 fps,
a sample at 16 kHz; or one value is for the whole window."""

FieldSource = Literal[
    "sound", "words", "motion", "upper body", "rotations", "phases", "speaker", "search"
]
"""What of a recording a field is made from. ``"motion"`` is 3-D motion on any skeleton, ``"upper
body"`` on one with the ten evaluation joints; ``"search"`` is no recording's."""


@dataclass(frozen=True, kw_only=True)
class Field:
    """What a batch can hold of every window.

    Attributes:
        name: Its name in `GestureBatch`.
        reads: What it is made from.
        axis: The time axis that follows the batch's.
        unit: Unit of its numbers.
        width: Numbers per step of the axis; None where the skeleton says how many.
        has_padding: Whether it means something in a corpus where nothing has what it is made from.
        dtype: Of the batch's tensor.
    """

    name: str
    reads: FieldSource
    axis: Axis
    unit: str
    width: int | None = 1
    has_padding: bool = False
    dtype: type[np.generic] = np.float32


class Context(NamedTuple):
    """What of the sound a row of a field looks at.

    Attributes:
        rows_before: Earlier rows, at the field's own rate.
        rows_after: Later rows.
        samples: Samples of sound that each of them looks at from its time on.
    """

    rows_before: int
    rows_after: int
    samples: int


class Placed(NamedTuple):
    """How rows are computed of a part of the sound where it matters which part it is.

    Attributes:
        hop: Samples from one row's time to the next one's, from 0 on.
        multiple: Parts begin at a multiple of so many samples, fewer than ``hop``.
        compute: ``(rows, width)`` of samples and of where the first of them is in the sound: the
            rows whose times lie in the part.
    """

    hop: Fraction
    multiple: int
    compute: Callable[[NDArray[np.float32], int], NDArray[np.float32]]


@dataclass(frozen=True, kw_only=True)
class SpeechField(Field):
    """A field of speech with values on the method's frames, computed once per corpus and kept.

    Attributes:
        version: Counted up when ``compute`` gives other values; a name where others make them.
        fps: Its own frames per second, of which a method's frame takes the nearest; None: it is
            computed at the method's rate.
        sees_whole_clip: Whether a value depends on all of the sound, however far away.
        context: What of the sound a row looks at; None where rows of a part of the sound aren't
            those of the whole, to the bit.
        placed: How a part of the sound is computed; None where the same sound has the same rows
            wherever a row begins with it.
        opens: Begins its rows of a speech that is heard piece by piece, at a rate, where they are
            of words; None: `context` says it.
        compute: ``(frames, width)`` of a speech that has sound: at its own rate as many as there
            are, at least one; else of the rate and the number of frames given.
    """

    axis: Axis = "method frames"
    version: int | str = 1
    fps: float | None = None
    sees_whole_clip: bool = False
    context: Context | None = None
    placed: Placed | None = None
    opens: Callable[[float], RowStream] | None = None
    compute: Callable[[Speech, float, int], NDArray[np.float32]]

    def of_speech(
        self, speech: Speech, fps: float, frames: int | None = None
    ) -> NDArray[np.float32]:
        """Values of a method's frames: frame i shows ``i / fps`` s of the speech.

        Args:
            speech: Of any length.
            fps: The method's frames per second.
            frames: How many; None for as many as cover the sound.

        Returns:
            ``(frames, width)``, not normalised.

        Raises:
            CospeechError: The waveform holds NaN or infinity, or there is none to fill frames from.
        """
        if not np.isfinite(speech.waveform).all():
            raise CospeechError("the waveform holds NaN or infinity", "check the audio file")
        if frames is None:
            frames = math.ceil(len(speech.waveform) / SAMPLE_RATE * fps - 1e-9)
        if frames == 0:
            return np.zeros((0, self.width or 0), dtype=np.float32)
        if not len(speech.waveform):
            raise CospeechError(f"there is no sound to take {self.name} from")
        if self.fps is None:
            return self.compute(speech, fps, frames)
        values = self.compute(speech, self.fps, 0)
        return values[nearest(np.arange(frames) / fps, self.fps, len(values))]


@dataclass(frozen=True, kw_only=True)
class MotionField(Field):
    """A field of motion or its annotation with values on the method's frames.

    Attributes:
        of_motion: ``(T, ...)`` at all frames of a span's sequences together.
        roles: What the joints of a skeleton are; None where recordings may differ.
    """

    axis: Axis = "method frames"
    of_motion: Callable[[SpanMotion], NDArray[Any]]
    roles: Callable[[Skeleton], tuple[str, ...]] | None = None


@dataclass(frozen=True, eq=False)
class Places:
    """Where n windows are.

    Attributes:
        recordings: ``(n,)`` their recordings.
        starts_s: ``(n,)`` times of their first frames in the recordings, s.
        samples: ``(n,)`` their first samples of sound.
        stops: ``(n,)`` where the spans that they are of end, in evaluation frames.
        frames: Frames of each window at ``fps``.
        fps: Frames per second.
    """

    recordings: NDArray[np.int64]
    starts_s: NDArray[np.float64]
    samples: NDArray[np.int64]
    stops: NDArray[np.int64]
    frames: int
    fps: float

    @property
    def audio_samples(self) -> int:
        """Samples of sound that go with a window."""
        return round(self.frames / self.fps * SAMPLE_RATE)


Gather = Callable[[NDArray[np.int64]], NDArray[Any]]
"""Values of the windows at some indices, ``(B, ...)``."""


@dataclass(frozen=True, kw_only=True)
class WindowField(Field):
    """A field that is read from the store window by window, and not a table of frames.

    Attributes:
        reader: What gathers the values of windows at given places.
    """

    reader: Callable[[Store, Places], Gather]


FrameField = SpeechField | MotionField
"""A field whose values for a span are a table of the method's frames."""


def nearest(
    times_s: NDArray[np.float64], fps: float, count: int | NDArray[np.int64]
) -> NDArray[np.int64]:
    """Of ``count`` frames the nearest to each time, ties to the even; past the last one the last.

    Nothing is averaged: interleaved sequences have values of their own.
    """
    return np.rint(times_s * fps).astype(np.int64).clip(0, count - 1)
