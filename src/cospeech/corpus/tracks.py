"""Spans of a corpus as tables of frames at any rate: ``{field: (T, C)}``.

A motion at 60 fps gives three interleaved sequences of 20 fps, one at 100 fps five: every frame can
be used, and none is interpolated where the rates are multiples (Ferstl et al. 2020, section 3).

**Nothing of another split is seen.** Fields of speech are computed of each span by itself, on
exactly the sound that the span is (`Store.speech`), the same that a method is given to speak to.
So a frame has the same values, to the bit, in training and in speaking, and no sound of a
neighbouring span changes them, not even by its loudness. Motion and its labels end with the span.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.features.field import FrameField, MotionField, SpeechField, nearest
from cospeech.corpus.features.keeping import Stretch, kept_rows
from cospeech.corpus.features.span_motion import SpanMotion
from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.errors import CospeechError
from cospeech.motion.upper_body import EVALUATION_FPS
from cospeech.progress import progress_bar
from cospeech.speech.speech import SAMPLE_RATE


@dataclass(frozen=True, eq=False)
class _Column:
    """One field of all sequences.

    Attributes:
        values: ``(N, ...)`` rows of one sequence, or of one span, after another.
        first_rows: ``(S,)`` the first row of each sequence, or of its span.
        counts: ``(S,)`` how many rows there are from it on.
        fps: Rate of the rows of a field with a rate of its own; None for the method's.
    """

    values: NDArray[Any]
    first_rows: NDArray[np.int64]
    counts: NDArray[np.int64]
    fps: float | None = None


class Tracks:
    """Some spans as S sequences of frames, in the order of the spans.

    Args:
        store: The corpus.
        spans: The stretches; of a field of sound, of recordings that have sound.
        fps: The method's frames per second.
        fields: What the tables hold. With a field of motion, or every interleave, frames are
            those of the motion; else they begin with the span.
        every_interleave: Take all sequences of a span, or only the first.
        title: What the spans are, for progress bars.

    Raises:
        CospeechError: Skeletons that lack a field's joints, or have different ones.

    Attributes:
        recordings: ``(S,)`` the sequences' recordings.
        frames: ``(S,)`` their lengths.
        span_of: ``(S,)`` which span each is of.
        starts: ``(S,)`` where that begins, in evaluation frames.
        stops: ``(S,)`` where it ends.
    """

    def __init__(
        self,
        store: Store,
        spans: Sequence[Span],
        fps: float,
        fields: Iterable[FrameField],
        every_interleave: bool = False,
        title: str = "sequences",
    ) -> None:
        self.store, self.spans, self.fps = store, spans, fps
        fields = list(fields)
        of_motion = [field for field in fields if isinstance(field, MotionField)]
        table = np.array([(s.recording, s.start, s.stop) for s in spans], dtype=np.int64)
        self._spans = table.reshape(-1, 3)
        self._columns: dict[str, _Column] = {}
        if of_motion or every_interleave:
            self._take_motion(of_motion, every_interleave, f"{title} at {fps:g} fps")
        else:
            self._take_spans()
        self.recordings, self.starts, self.stops = self._spans[self.span_of].T
        # Of a span's first frame from its beginning, s: 0 but where the motion's rate is odd.
        self._leads_s = np.zeros(len(self.frames))
        if of_motion or every_interleave:
            self._leads_s = self._bases_s - self.starts / EVALUATION_FPS
        for field in fields:
            if isinstance(field, SpeechField):
                self._columns[field.name] = self._speech_column(field, f"{title}: {field.name}")

    def __len__(self) -> int:
        return len(self.frames)

    def times_s(
        self, sequences: NDArray[np.int64], frames: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """Times of frames of sequences in their recordings, s; shapes as they broadcast."""
        seconds = self._seconds(sequences, frames, self._origins)
        times_s: NDArray[np.float64] = self._bases_s[sequences] + seconds
        return times_s

    def gather(
        self, name: str, sequences: NDArray[np.int64], frames: NDArray[np.int64]
    ) -> NDArray[Any]:
        """Values of a field at frames of sequences; beyond a sequence's ends its first or last.

        Args:
            name: Of the field.
            sequences: ``(B,)``.
            frames: ``(B, F)``.

        Returns:
            ``(B, F, ...)``.
        """
        column, of = self._columns[name], sequences[:, None]
        frames = frames.clip(0, self.frames[of] - 1)
        if column.fps is not None:
            seconds = self._leads_s[of] + self._seconds(of, frames, np.zeros(len(self)))
            frames = nearest(seconds, column.fps, column.counts[of])
        return column.values[column.first_rows[of] + frames]

    def values(self, name: str, sequence: int) -> NDArray[Any]:
        """``(T, ...)`` a field of one sequence."""
        frames = np.arange(self.frames[sequence])
        return self.gather(name, np.array([sequence]), frames[None])[0]

    def table(self, sequence: int) -> Mapping[str, NDArray[Any]]:
        """All fields of one sequence."""
        return {name: self.values(name, sequence) for name in self._columns}

    def _seconds(
        self, sequences: NDArray[np.int64], frames: NDArray[np.int64], origins: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        multiples = self._multiples[sequences]
        steps = origins[sequences] + self._interleaves[sequences] + frames * multiples
        seconds: NDArray[np.float64] = steps / (multiples * self.fps)
        return seconds

    def _take_spans(self) -> None:
        """One sequence per span, which begins where the span does."""
        _, starts, stops = self._spans.T
        self.span_of = np.arange(len(self.spans))
        last = np.floor((stops - starts - 1) * self.fps / EVALUATION_FPS + 1e-6).astype(np.int64)
        self.frames = np.where(stops > starts, last + 1, 0)
        self._bases_s = np.zeros(len(starts))
        self._origins = (starts * self.fps / EVALUATION_FPS).astype(np.float64)
        self._multiples = np.ones(len(starts), dtype=np.int64)
        self._interleaves = np.zeros(len(starts), dtype=np.int64)

    def _take_motion(self, fields: Sequence[MotionField], every: bool, title: str) -> None:
        """The sequences of the recordings' own frames."""
        for field in fields:
            self._require_same_joints(field)
        blocks: dict[str, list[NDArray[Any]]] = {field.name: [] for field in fields}
        rows = list[tuple[int, int, int, int, float]]()
        for number, span in enumerate(progress_bar(self.spans, len(self.spans), title)):
            motion = SpanMotion(self.store, span, self.fps)
            base_s = motion.first / motion.motion.fps
            together = {field.name: field.of_motion(motion) for field in fields}
            for interleave in range(motion.multiple if every else 1):
                chosen = slice(interleave, None, motion.multiple)
                count = len(range(motion.frames)[chosen])
                rows.append((number, interleave, motion.multiple, count, base_s))
                for name, values in together.items():
                    blocks[name].append(values[chosen])
        columns = np.array(rows, dtype=np.float64).reshape(-1, 5).T
        self.span_of, self._interleaves, self._multiples, self.frames = columns[:4].astype(np.int64)
        self._bases_s, self._origins = columns[4], np.zeros(len(rows))
        first_rows = np.cumsum(self.frames) - self.frames
        for name, parts in blocks.items():
            if parts:
                self._columns[name] = _Column(np.concatenate(parts), first_rows, self.frames)

    def _require_same_joints(self, field: MotionField) -> None:
        if field.roles is None:
            return
        used = {self.store.recordings[recording].skeleton for recording in set(self._spans[:, 0])}
        first, *others = (field.roles(self.store.skeletons[i]) for i in [0, *sorted(used - {0})])
        if different := {role for roles in others for role in set(roles) ^ set(first)}:
            raise CospeechError(
                f"{self.store.name}: its recordings have different joints"
                f" ({', '.join(sorted(different))})",
                "prepare those with and without fingers as two corpora",
            )

    def _speech_column(self, field: SpeechField, title: str) -> _Column:
        if field.fps is not None:
            stretches = [Stretch(span) for span in self.spans]
            values, counts = kept_rows(self.store, field, self.fps, stretches, title)
            first_rows = np.cumsum(counts) - counts
            of = self.span_of
            return _Column(values, first_rows[of], counts[of], field.fps)
        leads_s = self._leads_s + self._interleaves / (self._multiples * self.fps)
        samples = np.rint(leads_s * SAMPLE_RATE).astype(np.int64).clip(min=0)
        each = zip(self.span_of.tolist(), samples.tolist(), self.frames.tolist(), strict=True)
        stretches = [Stretch(self.spans[span], sample, count) for span, sample, count in each]
        values, counts = kept_rows(self.store, field, self.fps, stretches, title)
        return _Column(values, np.cumsum(counts) - counts, counts)
