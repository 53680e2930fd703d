"""The fixed windows of a store that methods train and are judged on: any fields at any rate."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.features import FIELDS, fields_of, refuse_lacking
from cospeech.corpus.features.field import (
    FieldSource,
    FrameField,
    Places,
    SpeechField,
    WindowField,
)
from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.corpus.tracks import Tracks
from cospeech.corpus.validation_pieces import Pieces, spans_by_pieces
from cospeech.errors import CospeechError
from cospeech.motion.upper_body import EVALUATION_FPS
from cospeech.speech.speech import SAMPLE_RATE


@dataclass(frozen=True)
class WindowSpec:
    """The windows a method works on.

    Attributes:
        fps: Frames per second.
        frames: Frames per window.
        seed_frames: Leading frames given to the method.
        stride: Frames from one window's start to the next (of runs: from one run's to the next).
        run: Consecutive windows that stay together in a batch.
        past: Frames of speech before a window that come with it; before a sequence its first.
        ahead: Frames of speech after a window that come with it; after a sequence its last.
        interleaved: Train on every sequence that the motion's own rate holds, and judge on the
            first, in windows side by side.
        judged_frames: Frames per window of validation and test, which lie side by side; None:
            as in training.
        own_fields: Fields of speech in the place of the catalogue's of the same name, such as the
            word vectors of another language model.
        unlabelled: Where phases are needed, keep recordings without; training needs one with.
        pieces: Validate on random pieces of the training and validation recordings, and train on
            what is left; None: by the split.
    """

    fps: float
    frames: int
    seed_frames: int
    stride: int
    run: int = 1
    past: int = 0
    ahead: int = 0
    interleaved: bool = False
    judged_frames: int | None = None
    own_fields: tuple[SpeechField, ...] = ()
    unlabelled: bool = False
    pieces: Pieces | None = None

    @property
    def audio_samples(self) -> int:
        """Samples of 16 kHz audio that go with one window."""
        return round(self.frames / self.fps * SAMPLE_RATE)

    def of_split(self, split: str) -> WindowSpec:
        """The windows of one split: interleaved and of the length of `frames` in training alone."""
        if split == "train" or not (self.interleaved or self.judged_frames):
            return self
        frames = self.judged_frames or self.frames
        return replace(
            self, frames=frames, run=1, stride=frames, interleaved=False, judged_frames=None
        )


class ServesWindows(Protocol):
    """The fixed windows of one split.

    Attributes:
        store: The corpus.
        split: ``"train"``, ``"val"`` or ``"test"``.
        spec: Window geometry.
        tracks: The sequences that the windows are of.
        sequences: ``(windows,)`` the sequence of each window.
        starts_s: ``(windows,)`` the time of its first frame in the recording, s.
    """

    store: Store
    split: str
    spec: WindowSpec
    tracks: Tracks
    sequences: NDArray[np.int64]
    starts_s: NDArray[np.float64]

    def __len__(self) -> int:
        """How many items there are."""

    def batch(self, indices: Sequence[int] | NDArray[np.int64]) -> GestureBatch:
        """The items at ``indices`` as one batch."""

    def describe(self, window: int) -> dict[str, Any]:
        """Recording and start time of a window."""


class WindowDataset:
    """The fixed list of windows of one split; a window never leaves its span.

    An item is a run of ``spec.run`` consecutive windows of one sequence (`Tracks`); window w is in
    run ``w // spec.run``. Where a recording has a published list of windows and the asked-for ones
    fit its grid, they are those of the list. A recording without a transcript has the padding word
    everywhere.

    Args:
        store: The corpus.
        split: ``"train"``, ``"val"`` or ``"test"``.
        spec: Window geometry.
        needs: Names of fields to fill, of `FIELDS`.
        tracks: The split's sequences with the fields that are tables of frames, where they are at
            hand; None reads them.
        places: ``(n, 2)`` sequence and first frame of every window, in the place of all that fit.

    Raises:
        ConfigError: A field that doesn't exist or that the corpus can't fill.
        CospeechError: No span of the split is as long as a run.
    """

    def __init__(
        self,
        store: Store,
        split: str,
        spec: WindowSpec,
        needs: frozenset[str],
        tracks: Tracks | None = None,
        places: NDArray[np.int64] | None = None,
    ) -> None:
        self.store, self.split, self.spec, self.needs = store, split, spec, needs
        own = {field.name: field for field in spec.own_fields}
        fields = [own.get(field.name, field) for field in fields_of(needs)]
        refuse_lacking("the method", needs, store.name, _lacks(store))
        of_frames = [field for field in fields if isinstance(field, FrameField)]
        if tracks is None:
            title = f"{split} sequences"
            spans = self._spans()
            tracks = Tracks(store, spans, spec.fps, of_frames, spec.interleaved, title)
        self.tracks = tracks
        listed = None
        if places is None:
            places, listed = _windows(tracks, spec)
        if not len(places):
            raise CospeechError(*_too_short(tracks, split, spec))
        self.sequences: NDArray[np.int64] = places[:, 0].repeat(spec.run)
        """``(windows,)`` the sequence of each window."""
        within_run = np.arange(spec.run) * spec.frames
        self.firsts: NDArray[np.int64] = (places[:, 1, None] + within_run).reshape(-1)
        """``(windows,)`` its first frame in the sequence."""
        self.recordings: NDArray[np.int64] = tracks.recordings[self.sequences]
        """``(windows,)`` its recording."""
        self.starts_s: NDArray[np.float64] = tracks.times_s(self.sequences, self.firsts)
        """``(windows,)`` the time of its first frame in the recording, s."""
        samples = np.rint(self.starts_s * SAMPLE_RATE).astype(np.int64)
        self.samples: NDArray[np.int64] = samples
        """``(windows,)`` its first sample of sound."""
        if listed is not None:
            self.samples = np.where(listed >= 0, listed, samples)
        stops = tracks.stops[self.sequences]
        where = Places(self.recordings, self.starts_s, self.samples, stops, spec.frames, spec.fps)
        self._of_windows = {
            field.name: field.reader(store, where)
            for field in fields
            if isinstance(field, WindowField)
        }
        self._of_frames = {
            field.name: np.arange(-spec.past, spec.frames + spec.ahead)
            if isinstance(field, SpeechField)
            else np.arange(spec.frames)
            for field in of_frames
        }

    def __len__(self) -> int:
        return len(self.firsts) // self.spec.run

    def describe(self, window: int) -> dict[str, Any]:
        """Recording and start time of a window, for reports."""
        return {
            "window": int(window),
            "recording": self.store.recordings[int(self.recordings[window])].id,
            "start_s": float(self.starts_s[window]),
        }

    def batch(self, indices: Sequence[int] | NDArray[np.int64]) -> GestureBatch:
        """The items at ``indices`` as one batch, the windows of a run one after another."""
        run = self.spec.run
        windows = np.asarray(indices, dtype=np.int64)
        if run > 1:
            windows = (windows[:, None] * run + np.arange(run)).reshape(-1)
        values = {name: gather(windows) for name, gather in self._of_windows.items()}
        for name, within in self._of_frames.items():
            frames = self.firsts[windows][:, None] + within
            found = self.tracks.gather(name, self.sequences[windows], frames)
            values[name] = np.ascontiguousarray(found, dtype=FIELDS[name].dtype)
        fields = {name: torch.from_numpy(value) for name, value in values.items()}
        return GestureBatch(torch.from_numpy(windows), **fields)

    def every_frame(self, name: str) -> NDArray[Any]:
        """``(N, ...)`` a field at all frames of the split, in windows or not."""
        return np.concatenate([self.tracks.values(name, i) for i in range(len(self.tracks))])

    def _spans(self) -> list[Span]:
        store, split, spec, needs = self.store, self.split, self.spec, self.needs
        reads = {field.reads for field in fields_of(needs)}
        spans = store.splits[split]
        if spec.pieces is not None and split != "test":
            spans = spans_by_pieces(store, split, spec.pieces, with_sound="sound" in reads)
        if not spec.unlabelled:
            return spans_having(store, split, spans, reads)
        spans = spans_having(store, split, spans, reads - {"phases"})
        if split == "train":
            spans_having(store, split, spans, reads & {"phases"})  # of one recording at least
        return spans


def spans_having(
    store: Store, split: str, spans: Sequence[Span], reads: Collection[FieldSource]
) -> list[Span]:
    """The spans of recordings that have what fields are made from.

    Args:
        store: The corpus.
        split: The split that the spans are of.
        spans: Which stretches.
        reads: What the fields are made from (`cospeech.corpus.features`).

    Raises:
        ConfigError: There are spans, and none has it.
    """
    if "sound" in reads:
        spans = store.spans_with_sound(spans, f"{split} windows")
    annotations: tuple[FieldSource, ...] = ("rotations", "phases")
    for what in annotations:
        if what in reads:
            column = store.recordings.columns[f"has_{what}"]
            having = [span for span in spans if column[span.recording]]
            if spans and not having:
                refuse_lacking("what is asked for", [what], f"{store.name} ({split})", [what])
            spans = having
    return list(spans)


def _lacks(store: Store) -> set[FieldSource]:
    lacks = set[FieldSource]()
    if not store.has_upper_body:
        lacks.add("upper body")
    if store.dimensions != 3:
        lacks.add("motion")
    if not any(store.recordings.columns["has_words"]):
        lacks.add("words")
    return lacks | {"search"}


def _too_short(tracks: Tracks, split: str, spec: WindowSpec) -> tuple[str, str]:
    lengths = tracks.frames / spec.fps
    told = f"{len(lengths)}, the longest of {lengths.max():.2f} s" if len(lengths) else "none"
    seconds = spec.frames * spec.run / spec.fps
    what = f"a window of {spec.frames} frames ({seconds:.2f} s)"
    shorter = ""
    if spec.run > 1:
        what, shorter = (
            f"{spec.run} windows in a row ({seconds:g} s)",
            "; shorten runs (model.run=1)",
        )
    return (
        f"{tracks.store.name}: no {split} recording holds {what}; there are {told}",
        "add longer recordings; raise data.val_share and data.test_share where that is a"
        f" small part; or, with a handful of long takes, data.split=time_blocks{shorter}",
    )


def _windows(
    tracks: Tracks, spec: WindowSpec
) -> tuple[NDArray[np.int64], NDArray[np.int64] | None]:
    """Sequence and first frame of every item; the first samples that lists give, or -1."""
    store, grid, length = tracks.store, tracks.store.window_grid, spec.frames * spec.run
    fitting = np.maximum((tracks.frames - length) // spec.stride + 1, 0)
    if grid is None or not (
        grid["fps"] == spec.fps == EVALUATION_FPS
        and grid["stride"] == spec.stride
        and length <= grid["frames"]
    ):
        return _grown(fitting, spec.stride), None
    # A recording without a list, in a corpus where others have one, gives every window.
    listed = store.row_counts["windows"][tracks.recordings]
    places = _grown(np.where(listed > 0, listed, fitting), 1)
    sequence, number = places.T
    of_list = listed[sequence] > 0
    rows = store.first_rows["windows"][tracks.recordings[sequence]] + number
    frames, samples = number * spec.stride, np.full(len(number), -1)
    starts = tracks.starts[sequence][of_list]
    frames[of_list], samples[of_list] = store.stream("windows")[rows[of_list]].T
    frames[of_list] -= starts
    inside = (frames >= 0) & (frames + length <= tracks.frames[sequence])
    return np.stack([sequence, frames], axis=1)[inside], samples[inside]


def _grown(counts: NDArray[np.int64], step: int) -> NDArray[np.int64]:
    """``(sum, 2)``: each index as often as its count says, with 0, ``step``, ``2 step`` ..."""
    index = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.stack([index, number * step], axis=1)
