"""Fields of a speech that is heard piece by piece, at a cost that doesn't grow with its length."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.field import SpeechField, nearest
from cospeech.errors import CospeechError
from cospeech.speech.speech import SAMPLE_RATE, Speech, Word, covering_frames


class RowStream(Protocol):
    """The rows of `SpeechField.of_speech`, to the bit, as a speech is heard.

    Attributes:
        look_ahead_s: A row looks at no sound that is later than its frame by more, s: ``math.inf``
            where it looks at all of it, ``-math.inf`` where it looks at none.
        words_look_ahead_s: The same of the beginnings of words.
        delay_s: After t seconds of sound the rows before ``t - delay_s`` have been put out.
    """

    look_ahead_s: float
    words_look_ahead_s: float
    delay_s: float

    def hear(
        self, samples: NDArray[np.float32], words: Sequence[Word] | None = None
    ) -> NDArray[np.float32]:
        """The next rows ``(F, width)`` of the method's frames that further speech completes."""

    def finish(self) -> NDArray[np.float32]:
        """The rows that are left up to the end of the sound."""


def open_rows(field: SpeechField, fps: float) -> RowStream:
    """Begin the rows of a field; what can't be computed piece by piece all comes at the end."""
    if field.opens is not None:
        return field.opens(fps)
    return WholeField(field, fps) if field.context is None else FieldStream(field, fps)


class WholeField:
    """A field that depends on all of a speech: its rows come at the end. See `RowStream`.

    Args:
        field: The field.
        fps: The method's frames per second.
    """

    def __init__(self, field: SpeechField, fps: float) -> None:
        self.look_ahead_s = -math.inf if field.reads == "words" else math.inf
        self.words_look_ahead_s = math.inf if field.reads == "words" else -math.inf
        self.delay_s = math.inf
        self._field, self._fps = field, fps
        self._sound, self._words = [np.zeros(0, dtype=np.float32)], list[Word]()

    def hear(
        self, samples: NDArray[np.float32], words: Sequence[Word] | None = None
    ) -> NDArray[np.float32]:
        """No rows."""
        self._sound.append(samples)
        self._words += words or ()
        return np.zeros((0, self._field.width or 0), dtype=np.float32)

    def finish(self) -> NDArray[np.float32]:
        """All rows."""
        speech = Speech(np.concatenate(self._sound), tuple(self._words))
        frames = covering_frames(len(speech.waveform), self._fps)
        return self._field.of_speech(speech, self._fps, frames)


class FieldStream:
    """The rows of `SpeechField.of_speech`, to the bit, as soon as what they look at was heard.

    Every row is computed once, and only the sound that later rows look at is held.

    Args:
        field: A field of sound with a context.
        fps: The method's frames per second.

    Attributes:
        samples: Heard so far.
        look_ahead_s: See `RowStream`, like the next two.
        words_look_ahead_s: No word is looked at.
        delay_s: As far as it looks ahead.

    Raises:
        CospeechError: A value of the field depends on all of the sound.
    """

    words_look_ahead_s = -math.inf

    def __init__(self, field: SpeechField, fps: float) -> None:
        if field.context is None:
            raise CospeechError(
                f"{field.name} can't be computed piece by piece: it needs all of the sound",
                "wait for it (open_rows, or cospeech.methods.streams.WholeUtterance), or choose"
                " another field",
            )
        self.samples = 0
        self._field, self._fps, self._context = field, fps, field.context
        self._rate = field.fps or fps
        self._hop = field.placed.hop if field.placed else SAMPLE_RATE / Fraction(self._rate)
        # So many rows on, a row begins at a sample where a part of the sound may begin.
        self._period = 1 if field.placed else self._hop.denominator
        self._sound, self._sound_from = np.zeros(0, dtype=np.float32), 0
        self._first_sample = 0
        self._rows = np.zeros((0, field.width or 0), dtype=np.float32)
        self._rows_from = self._put_out = 0
        # A row begins at a whole sample, up to half a one late, and may be half a row away.
        is_on_a_row = field.fps is None or (field.fps / fps).is_integer()
        nearest_s = 0.0 if is_on_a_row else 0.5 / self._rate
        rows_s = self._context.rows_after / self._rate
        self.look_ahead_s = rows_s + nearest_s + (self._context.samples + 1) / SAMPLE_RATE
        self.delay_s = self.look_ahead_s

    def hear(
        self, samples: NDArray[np.float32], words: Sequence[Word] | None = None
    ) -> NDArray[np.float32]:
        """The next rows ``(F, width)`` of the method's frames that further sound completes."""
        self.samples += len(samples)
        self._sound = np.concatenate([self._sound, samples])
        done = complete = self._rows_from + len(self._rows)
        while self._begins(complete + self._context.rows_after) <= self.samples:
            complete += 1
        if complete > done:
            self._compute(complete, self._context.rows_after)
            first = max(0, complete - self._context.rows_before)
            self._drop(first // self._period * self._period)
        frames = self._put_out
        while self._row_of(frames) < complete:
            frames += 1
        return self._until(frames)

    def finish(self) -> NDArray[np.float32]:
        """The rows that are left up to the end of the sound."""
        frames = covering_frames(self.samples, self._fps)
        if frames > self._put_out and len(self._sound):
            self._compute(None if self._field.fps else frames, 0)
        return self._until(frames)

    def _drop(self, first: int) -> None:
        """Let go of the sound before a row."""
        sample = round(first * self._hop)
        if self._field.placed:
            sample = int(first * self._hop) // self._field.placed.multiple
            sample *= self._field.placed.multiple
        self._sound = self._sound[sample - self._first_sample :]
        self._sound_from, self._first_sample = first, sample

    def _begins(self, row: int) -> int:
        return round(row * self._hop) + self._context.samples

    def _row_of(self, frame: int) -> int:
        return round(frame / self._fps * self._rate) if self._field.fps else frame

    def _compute(self, stop: int | None, extra: int) -> None:
        """Add the rows up to one; the extra ones after it aren't whole, and aren't kept."""
        wanted = 0 if stop is None else stop + extra - self._sound_from
        if self._field.placed:
            values = self._field.placed.compute(self._sound, self._first_sample)
        else:
            values = self._field.compute(Speech(self._sound), self._rate, wanted)
        done = self._rows_from + len(self._rows)
        new = values[done - self._sound_from : None if stop is None else stop - self._sound_from]
        self._rows = np.concatenate([self._rows, new])

    def _until(self, frames: int) -> NDArray[np.float32]:
        """The rows of the method's frames up to one."""
        times_s = np.arange(self._put_out, frames) / self._fps
        last = self._rows_from + len(self._rows)
        due = self._rows[nearest(times_s, self._rate, last) - self._rows_from]
        self._put_out = max(frames, self._put_out)
        gone = max(0, min(self._row_of(self._put_out), last - 1) - self._rows_from)
        self._rows, self._rows_from = self._rows[gone:], self._rows_from + gone
        return due
