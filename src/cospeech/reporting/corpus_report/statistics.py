"""The numbers of the corpus report, computed recording by recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.motion.motion import Motion
from cospeech.motion.phases import PHASES
from cospeech.motion.upper_body import EVALUATION_FPS
from cospeech.progress import progress_bar
from cospeech.reporting.corpus_report.streaming import SPEED_EDGES, StreamingHistogram, evenly
from cospeech.reporting.corpus_report.totals import (
    MEASURES,
    WRISTS,
    CorpusStatistics,
    HandSpace,
    JointTotals,
    SpeakerTotals,
    SplitTotals,
)
from cospeech.reporting.joint_names import wrists
from cospeech.speech.speech import SAMPLE_RATE

WINDOW_FRAMES, WINDOW_STRIDE = 34, 10
"""The evaluation windows, in frames of 15 a second; counted where no window list is published."""

MOST_FRAMES = 3000
"""Frames per recording that joint speeds and bone lengths use, evenly spaced."""

MOST_BLOCKS = 300
"""Blocks of a tenth of a second per recording that the audio level uses, evenly spaced."""

STILL_SPEED = 0.01
"""Metres per second; a wrist that is slower stands still."""

_BLOCK = SAMPLE_RATE // 10
_FULL_SCALE = 32767
_QUIETEST_DB = -120.0


def corpus_statistics(store: Store) -> CorpusStatistics:
    """Go through a store once, recording by recording; memory does not grow with the corpus.

    Args:
        store: The prepared corpus.
    """
    return _Collector(store).collect()


def window_starts(store: Store, span: Span) -> NDArray[np.int64]:
    """First frames of the windows of a span, at 15 fps: the published ones, or the fixed grid."""
    grid = store.window_grid
    if grid is None:
        return np.arange(span.start, span.stop - WINDOW_FRAMES + 1, WINDOW_STRIDE)
    starts = store.read(span.recording, "windows")[:, 0]
    return starts[(starts >= span.start) & (starts + grid["frames"] <= span.stop)]


class _Collector:
    """The state of one pass over a store."""

    def __init__(self, store: Store) -> None:
        count = len(store.recordings)
        self.store = store
        self.measures = {name: np.full(count, np.nan) for name in MEASURES}
        self.speakers = [""] * count
        self.has_words = np.zeros(count, dtype=bool)
        self.word_totals = np.zeros(count, dtype=np.int64)
        self.wrist_sums, self.wrist_pairs = np.zeros((count, 2)), np.zeros(count)
        self.split_words = dict.fromkeys(store.splits, 0)
        self.spans: list[list[tuple[str, Span]]] = [[] for _ in range(count)]
        for name, spans in store.splits.items():
            for span in spans:
                self.spans[span.recording].append((name, span))
        self.joints = [
            JointTotals(StreamingHistogram(SPEED_EDGES, len(skeleton)))
            for skeleton in store.skeletons
        ]
        self.wrists = StreamingHistogram(SPEED_EDGES, 2)
        self.word_seconds = StreamingHistogram(np.linspace(0, 3, 301))
        self.levels = StreamingHistogram(np.linspace(-96, 0, 193))
        self.phase_frames = np.zeros(len(PHASES), dtype=np.int64)
        self.phase_recordings = 0
        self.word_counts = np.zeros(len(store.vocabulary), dtype=np.int64)
        self.hands = HandSpace() if store.has_upper_body else None

    def collect(self) -> CorpusStatistics:
        store = self.store
        bar = progress_bar(store.recordings, len(self.speakers), f"statistics of {store.name}")
        for i, recording in enumerate(bar):
            motion = store.motion(i)
            self.speakers[i], self.has_words[i] = recording.speaker, recording.has_words
            self.measures["seconds"][i] = motion.duration
            self._add_joints(i, motion, self.joints[recording.skeleton])
            self._add_wrists(i, motion)
            if recording.has_audio:
                self._add_audio(i, motion.duration)
            if recording.has_words:
                self._add_words(i, motion.duration)
            phases = store.phases(i)
            if phases is not None:
                self.phase_recordings += 1
                self.phase_frames += np.bincount(phases, minlength=len(PHASES))[: len(PHASES)]
        splits = [self._split(name, spans) for name, spans in store.splits.items()]
        return CorpusStatistics(
            measures=self.measures,
            splits=splits,
            total=self._total(sum(split.windows for split in splits)),
            speakers=list(self._speaker_totals()),
            joints=self.joints,
            wrists=self.wrists,
            word_seconds=self.word_seconds,
            levels=self.levels,
            phase_frames=self.phase_frames,
            phase_recordings=self.phase_recordings,
            word_counts=self.word_counts,
            hands=self.hands,
        )

    def _add_joints(self, i: int, motion: Motion, totals: JointTotals) -> None:
        step, starts = _pairs(motion, MOST_FRAMES)
        here = motion.positions[starts].astype(np.float64)
        if len(starts):
            there = motion.positions[starts + step]
            totals.speeds.add(np.linalg.norm(there - here, axis=-1) * (motion.fps / step))
        else:
            here = motion.positions[:1].astype(np.float64)
        if len(here):
            parents = np.array(motion.skeleton.parents)
            parents = np.where(parents < 0, np.arange(len(parents)), parents)
            lengths = np.linalg.norm(here - here[:, parents], axis=-1)
            self.measures["bone_variation"][i] = totals.add(lengths)

    def _add_wrists(self, i: int, motion: Motion) -> None:
        if self.hands is not None:
            upper = self.store.upper_body(i)
            self.hands.add(upper)
            tracks, fps, step = upper[:, WRISTS].astype(np.float64), EVALUATION_FPS, 1
            starts = np.arange(len(upper) - 1)
        else:
            joints = wrists(motion.skeleton)
            if len(joints) < 2:
                return
            tracks = motion.positions[:, [joints["left"], joints["right"]]].astype(np.float64)
            fps = motion.fps
            step, starts = _pairs(motion, len(motion))
        if not len(starts):
            return
        speeds = np.linalg.norm(tracks[starts + step] - tracks[starts], axis=-1) * (fps / step)
        self.wrists.add(speeds)
        self.wrist_sums[i], self.wrist_pairs[i] = speeds.sum(axis=0), len(speeds)
        self.measures["left_wrist"][i], self.measures["right_wrist"][i] = speeds.mean(axis=0)
        if self.store.dimensions == 3:
            self.measures["still"][i] = (speeds < STILL_SPEED).all(axis=1).mean()

    def _add_audio(self, i: int, seconds: float) -> None:
        samples = np.asarray(self.store.read(i, "audio"))[:, 0]
        self.measures["excess_audio"][i] = len(samples) / SAMPLE_RATE - seconds
        whole = len(samples) // _BLOCK
        if not whole:
            return
        blocks = samples[: whole * _BLOCK].reshape(whole, _BLOCK)[evenly(whole, MOST_BLOCKS)]
        scaled = blocks.astype(np.float32) * np.float32(1 / _FULL_SCALE)
        power = np.einsum("ij,ij->i", scaled, scaled).astype(np.float64) / _BLOCK
        self.levels.add(decibels(power)[:, None])
        self.measures["level"][i] = decibels(power.mean())
        self.measures["clipped"][i] = np.count_nonzero(np.abs(blocks) >= _FULL_SCALE) / blocks.size

    def _add_words(self, i: int, seconds: float) -> None:
        words = self.store.words(i)
        self.word_totals[i] = len(words)
        self.measures["words_per_minute"][i] = len(words) / (seconds / 60 or np.nan)
        if not len(words):
            return
        self.word_seconds.add((words[:, 1] - words[:, 0])[:, None])
        self.word_counts += np.bincount(
            words[:, 2].astype(np.int64), minlength=len(self.word_counts)
        )
        frames = words[:, 0] * EVALUATION_FPS
        for name, span in self.spans[i]:
            inside = (frames >= span.start - 1e-6) & (frames < span.stop - 1e-6)
            self.split_words[name] += int(inside.sum())

    def _split(self, name: str, spans: Sequence[Span]) -> SplitTotals:
        hours = [(span.stop - span.start) / EVALUATION_FPS / 3600 for span in spans]
        members = {span.recording for span in spans}
        return SplitTotals(
            name,
            recordings=len(members),
            speakers=len({self.speakers[i] for i in members}),
            hours=sum(hours),
            transcribed_hours=sum(
                h for h, span in zip(hours, spans, strict=True) if self.has_words[span.recording]
            ),
            words=self.split_words[name],
            windows=sum(len(window_starts(self.store, span)) for span in spans),
        )

    def _total(self, windows: int) -> SplitTotals:
        seconds = self.measures["seconds"]
        return SplitTotals(
            "all",
            recordings=len(seconds),
            speakers=len(set(self.speakers)),
            hours=float(seconds.sum() / 3600),
            transcribed_hours=float(seconds[self.has_words].sum() / 3600),
            words=int(self.word_totals.sum()),
            windows=windows,
        )

    def _speaker_totals(self) -> Iterator[SpeakerTotals]:
        members: dict[str, list[int]] = {}
        for i, speaker in enumerate(self.speakers):
            members.setdefault(speaker, []).append(i)
        seconds = self.measures["seconds"]
        for name in sorted(members, key=lambda name: (-seconds[members[name]].sum(), name)):
            own = np.array(members[name])
            pairs = self.wrist_pairs[own].sum() or np.nan
            left, right = self.wrist_sums[own].sum(axis=0) / pairs
            transcribed = seconds[own[self.has_words[own]]].sum() / 60
            found = {split for i in own for split, _ in self.spans[i]}
            yield SpeakerTotals(
                name,
                splits=tuple(split for split in self.store.splits if split in found),
                recordings=len(own),
                minutes=float(seconds[own].sum() / 60),
                words_per_minute=float(self.word_totals[own].sum() / (transcribed or np.nan)),
                wrist_speeds=(float(left), float(right)),
            )


def _pairs(motion: Motion, most: int) -> tuple[int, NDArray[np.int64]]:
    """Frames from one look to the next, about 1/15 s, and the first frames of the pairs."""
    step = max(1, round(motion.fps / EVALUATION_FPS))
    count = max(0, (len(motion) - 1) // step)
    return step, evenly(count, most) * step


def decibels(power: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Mean squares relative to full scale as dBFS, -120 at the least."""
    return np.maximum(10 * np.log10(np.maximum(power, 1e-30)), _QUIETEST_DB)
