"""Windows of the gesturing joints at a method's own rate, in runs of consecutive windows.

The embedded corpus at 60 fps gives three interleaved sequences of 20 fps, a corpus at 100 fps five:
every frame is used and none interpolated (Ferstl et al. 2020, section 3). Nothing crosses from one
interleave to another, or the edge of a split.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.splits import Span
from cospeech.corpus.store import EVALUATION_FPS, Store
from cospeech.corpus.windows import WindowSpec
from cospeech.errors import ConfigError, CospeechError
from cospeech.motion.gesture_joints import gesture_joints
from cospeech.motion.interleaves import at_a_multiple
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.velocities import BodyJoints, body_positions
from cospeech.progress import progress_bar
from cospeech.speech.feature_sets.opensmile import nearest_frames, opensmile_features

UNLABELLED = -1
"""The phase of a step that nobody annotated."""


@dataclass(frozen=True, eq=False)
class _Sequence:
    """One interleave of one span."""

    recording: int
    times_s: NDArray[np.float64]
    joints: NDArray[np.float32]
    acoustics: NDArray[np.float32]
    phases: NDArray[np.int8]


class StepWindows:
    """Runs of consecutive windows of one split; an item is a run.

    Fields served: ``joints``, ``acoustics``, ``phases``, ``speakers``, and ``positions``, which are
    the upper body over the same time at the evaluation rate.

    Args:
        store: The corpus.
        split: ``"train"``, ``"val"`` or ``"test"``.
        spec: Window geometry; ``spec.run`` consecutive windows make an item.
        needs: `GestureBatch` fields to fill.
        every_interleave: Use all interleaves (training), or only the first (judging).
        select: Other joints than the gesturing ones, by the recording's skeleton.
        spans: Other stretches than the split's.
        unlabelled: Where phases are needed, keep recordings without, whose steps are
            `UNLABELLED`; the training part needs one with phases.

    Raises:
        ConfigError: A field that the corpus can't fill.
        CospeechError: Skeletons with different gesturing joints, or no stretch as long as a run.
    """

    def __init__(
        self,
        store: Store,
        split: str,
        spec: WindowSpec,
        needs: frozenset[str],
        every_interleave: bool,
        select: Callable[[Skeleton], BodyJoints] | None = None,
        spans: Sequence[Span] | None = None,
        unlabelled: bool = False,
    ) -> None:
        self.store, self.split, self.spec, self.needs = store, split, spec, needs
        self._select = select
        spans = store.splits[split] if spans is None else spans
        if "acoustics" in needs:
            spans = store.spans_with_sound(spans, f"{split} windows")
        if "phases" in needs and (split == "train" or not unlabelled):
            annotated = _with_phases(store, split, spans)
            spans = spans if unlabelled else annotated
        every = progress_bar(spans, len(spans), f"{split} sequences at {spec.fps:g} fps")
        sequences = [
            sequence for span in every for sequence in self._sequences(span, every_interleave)
        ]
        length = spec.frames * spec.run
        first, starts = 0, list[int]()
        for sequence in sequences:
            count = len(sequence.times_s)
            starts += range(first, first + count - length + 1, spec.stride)
            first += count
        if not starts:
            raise CospeechError(
                f"{store.name}: no {split} recording is as long as {spec.run} windows in a row"
                f" ({length / spec.fps:g} s)",
                "use longer recordings, raise the split's share, or shorten runs (model.run=1)",
            )
        self.starts: NDArray[np.int64] = np.array(starts, dtype=np.int64)
        self.joints = np.concatenate([sequence.joints for sequence in sequences])
        self.acoustics = np.concatenate([sequence.acoustics for sequence in sequences])
        self.phases = np.concatenate([sequence.phases for sequence in sequences])
        self.times_s = np.concatenate([sequence.times_s for sequence in sequences])
        self.recordings = np.concatenate(
            [np.full(len(sequence.times_s), sequence.recording) for sequence in sequences]
        )

    def __len__(self) -> int:
        return len(self.starts)

    def describe(self, window: int) -> dict[str, Any]:
        """Recording and start time of a window (window w is in run ``w // spec.run``)."""
        run, place = divmod(window, self.spec.run)
        row = self.starts[run] + place * self.spec.frames
        return {
            "window": int(window),
            "recording": self.store.recordings[int(self.recordings[row])].id,
            "start_s": float(self.times_s[row]),
        }

    def batch(self, indices: Sequence[int] | NDArray[np.int64]) -> GestureBatch:
        """The runs at ``indices``, their windows one after another."""
        spec = self.spec
        indices = np.asarray(indices)
        windows = self.starts[indices][:, None] + np.arange(spec.run) * spec.frames
        rows = windows.reshape(-1, 1) + np.arange(spec.frames)
        fields = {
            "window_ids": torch.from_numpy(
                (indices[:, None] * spec.run + np.arange(spec.run)).reshape(-1)
            )
        }
        if "joints" in self.needs:
            fields["joints"] = torch.from_numpy(self.joints[rows])
        if "acoustics" in self.needs:
            fields["acoustics"] = torch.from_numpy(self.acoustics[rows])
        if "phases" in self.needs:
            fields["phases"] = torch.from_numpy(self.phases[rows].astype(np.int64))
        recordings = self.recordings[rows[:, 0]]
        if "speakers" in self.needs:
            ids = [self.store.speaker_id(int(recording)) for recording in recordings]
            fields["speakers"] = torch.tensor(ids, dtype=torch.int64)
        if "positions" in self.needs:
            starts = self.times_s[rows[:, 0]]
            frames = evaluation_frames(spec)
            positions = np.stack(
                [
                    upper_body_from(self.store, int(recording), start, frames)
                    for recording, start in zip(recordings, starts, strict=True)
                ]
            )
            fields["positions"] = torch.from_numpy(positions)
        return GestureBatch(**fields)

    def _sequences(self, span: Span, every_interleave: bool) -> Iterator[_Sequence]:
        store = self.store
        motion = store.motion(span.recording)
        first = math.ceil(span.start / EVALUATION_FPS * motion.fps - 1e-6)
        whole = span.stop >= store.recordings[span.recording].frames
        stop = len(motion)
        if not whole:
            stop = min(stop, math.ceil(span.stop / EVALUATION_FPS * motion.fps - 1e-6))
        joints = self._joints_of(span.recording)
        positions = body_positions(motion.slice(first, stop), joints)
        positions, count = at_a_multiple(positions, motion.fps, self.spec.fps)
        times = first / motion.fps + np.arange(len(positions)) / (count * self.spec.fps)
        acoustics = np.zeros((len(positions), 0), dtype=np.float32)
        if "acoustics" in self.needs:
            acoustics = acoustics_at(store, span.recording, times)
        phases = np.full(len(positions), UNLABELLED, dtype=np.int8)
        labels = store.phases(span.recording) if "phases" in self.needs else None
        if labels is not None:
            phases = labels[np.rint(times * motion.fps).astype(np.int64).clip(max=len(labels) - 1)]
        for interleave in range(count if every_interleave else 1):
            chosen = slice(interleave, None, count)
            yield _Sequence(
                span.recording,
                times[chosen],
                positions[chosen],
                acoustics[chosen],
                phases[chosen],
            )

    def _joints_of(self, recording: int) -> BodyJoints:
        index = self.store.recordings[recording].skeleton
        if self._select is not None:
            return self._select(self.store.skeletons[index])
        joints, first = (gesture_joints(self.store.skeletons[i]) for i in (index, 0))
        if joints.roles != first.roles:
            different = sorted(set(joints.roles) ^ set(first.roles))
            raise CospeechError(
                f"{self.store.name}: its recordings have different gesturing joints"
                f" ({', '.join(different)})",
                "prepare those with and without fingers as two corpora",
            )
        return joints.body


def split_windows(
    store: Store,
    split: str,
    spec: WindowSpec,
    needs: frozenset[str],
    *,
    select: Callable[[Skeleton], BodyJoints] | None = None,
    spans: Sequence[Span] | None = None,
    unlabelled: bool = False,
) -> StepWindows:
    """The windows of a split: for training in runs, of every interleave; else one by one.

    Args and errors are those of `StepWindows`; windows for judging lie side by side.
    """
    training = split == "train"
    if not training:
        spec = replace(spec, run=1, stride=spec.frames)
    return StepWindows(store, split, spec, needs, training, select, spans, unlabelled)


def evaluation_frames(spec: WindowSpec) -> int:
    """Frames at the evaluation rate that a window covers."""
    return math.floor((spec.frames - 1) / spec.fps * EVALUATION_FPS + 1e-6) + 1


def acoustics_at(store: Store, recording: int, times_s: NDArray[np.float64]) -> NDArray[np.float32]:
    """The 26 MFCC and the pitch of the 100 fps frame that begins nearest to each time, ``(T, 27)``.

    Nothing is averaged: interleaved sequences have features of their own.
    """
    samples = store.read(recording, "audio")[:, 0]
    return nearest_frames(opensmile_features(samples * np.float32(1 / 32767)), times_s)


def _with_phases(store: Store, split: str, spans: Sequence[Span]) -> list[Span]:
    has_phases = store.recordings.columns["has_phases"]
    annotated = [span for span in spans if has_phases[span.recording]]
    if spans and not annotated:
        raise ConfigError(
            f"{store.name}: no {split} recording has gesture phases",
            "use a corpus with annotated phases (data=synthetic, data=uci_phases); or, for"
            " model=multi_adversary, give a classifier that was trained on one:"
            " model.classifier=FILE, the phase_classifier.pt in the folder of a run of"
            " model=phase_classifier",
        )
    return annotated


def upper_body_from(
    store: Store, recording: int, start_s: float, frames: int
) -> NDArray[np.float32]:
    """The upper body from any time on; between two stored frames by linear interpolation."""
    place = start_s * EVALUATION_FPS
    first = math.floor(place + 1e-6)
    weight = np.float32(max(0.0, place - first))
    upper: NDArray[np.float32] = np.array(store.upper_body(recording, first, first + frames + 1))
    upper = np.concatenate([upper, upper[-1:].repeat(max(0, frames + 1 - len(upper)), axis=0)])
    if weight < 1e-6:
        return upper[:frames]
    between: NDArray[np.float32] = upper[:frames] + (upper[1:] - upper[:-1]) * weight
    return between
