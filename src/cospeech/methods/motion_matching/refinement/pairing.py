"""Making what the refinement learns from: motion matched to windows that have motion of their own.

Every overlapping window of the training split is searched with its own sound (section 3.3;
docs/facts/motion_matching.md, section 6).
"""

from __future__ import annotations

import hashlib
import json
import logging
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.errors import CospeechError, InputFileError
from cospeech.matching.database import MatchingDatabase
from cospeech.matching.features import stack_taps
from cospeech.matching.matching import Clip, Matched, match_together
from cospeech.matching.search import MatchingSearch
from cospeech.matching.tracks import Track
from cospeech.methods.motion_matching.refinement.pairs import (
    Pairs,
    PairSettings,
    open_pairs,
    write_pairs,
)
from cospeech.progress import progress_bar

logger = logging.getLogger(__name__)

VERSION = 2
FIRST_SHARE = 0.5
"""Share of training windows that take the best candidate (section 3.3)."""
LARGEST_K = 15
"""The others take one of the second to this one."""
MEASURED_WINDOWS = 1000
"""Windows searched a second time, with nothing closed, to see how often they find themselves."""

_CHUNK = 512


def make_pairs(
    tracks: Sequence[Track],
    search: MatchingSearch,
    settings: PairSettings,
    seed: int,
    folder: Path | str,
    speakers: Sequence[str] | None = None,
    chunk: int = _CHUNK,
) -> Pairs:
    """Match motion to every window of some tracks, or open what was matched before.

    The result depends on the seed, not on the chunk. A killed run leaves nothing behind that looks
    like pairs, and damaged ones are made again. A window to which everything is closed is left out.

    Args:
        tracks: Of one split, at the database's rate.
        search: The database, and how it is searched.
        settings: Which windows, and how.
        seed: Draws which candidate each window takes, and its first pose.
        folder: Where pairs are kept, each set in a folder of its own.
        speakers: Who speaks on each track, to whose motion its windows are kept; somebody who isn't
            in the database gets one drawn speaker's. None: everybody gets everybody's.
        chunk: Windows that are searched together.

    Raises:
        CospeechError: No track is as long as a window, or everything is closed to every window.
    """
    made_by = _made_by(tracks, search, settings, seed, speakers)
    digest = hashlib.sha256(json.dumps(made_by, sort_keys=True).encode()).hexdigest()
    place = Path(folder) / digest[:12]
    if place.is_dir():
        try:
            return open_pairs(place, made_by, settings)
        except InputFileError as error:
            logger.warning("%s: %s; the pairs are made again", error.path, error.problem)
            shutil.rmtree(place)
    matching = _Matching(tracks, search, settings, seed, speakers, chunk)
    write_pairs(place, made_by, matching.pairs)
    return open_pairs(place, made_by, settings)


class _Matching:
    """The search for all windows."""

    def __init__(
        self,
        tracks: Sequence[Track],
        search: MatchingSearch,
        settings: PairSettings,
        seed: int,
        speakers: Sequence[str] | None,
        chunk: int,
    ) -> None:
        self.tracks, self.search, self.settings = tracks, search, settings
        self.seed, self.chunk = seed, chunk
        self.windows = cut_windows(tracks, settings)
        draws = np.random.default_rng([seed, 0])
        first = draws.random(len(self.windows)) < FIRST_SHARE
        others = draws.integers(2, LARGEST_K + 1, len(self.windows))
        self.ks = np.where(first, 1, others).astype(np.int32)
        if settings.k is not None:
            self.ks[:] = settings.k
        self._searchable: NDArray[np.bool_] = np.logical_or.reduce(search.eligible(), axis=1)
        draws = np.random.default_rng([seed, 2])
        self._others = [_others(search.database, name, draws) for name in speakers or ()]

    def pairs(self) -> Pairs:
        kept = self._with_a_choice()
        pointers = self._pointers(kept, "matching motion to windows", True, self.seed)
        own_hits = None
        if self.settings.closed_frames is not None:
            own_hits = self._own_hits(kept)
            logger.info(
                "%d pairs; with nothing closed, %.1f %% of the matches would be within %s frames"
                " of their own window",
                len(kept),
                100 * own_hits,
                self.settings.closed_frames,
            )
        return Pairs(self.settings, self.windows[kept], self.ks[kept], pointers, own_hits)

    def _with_a_choice(self) -> NDArray[np.int64]:
        """The windows to which not everything is closed."""
        open_to = [
            bool((self._searchable & ~self._shut(window, True)).any())
            for window in range(len(self.windows))
        ]
        if not any(open_to):
            raise CospeechError(
                "a window's own recording is all that the database holds for it",
                "use more or longer recordings, model.same_speaker=false, or"
                " model.exclude_own=false",
            )
        if left_out := open_to.count(False):
            logger.warning(
                "%d of %d windows are left out: their own recording is all that the database holds"
                " for them (more recordings, model.same_speaker=false or model.exclude_own=false"
                " would help)",
                left_out,
                len(open_to),
            )
        return np.flatnonzero(np.array(open_to))

    def _own_hits(self, windows: NDArray[np.int64]) -> float:
        draws = np.random.default_rng([self.seed, 1])
        count = min(MEASURED_WINDOWS, len(windows))
        sample = np.sort(draws.choice(windows, count, replace=False))
        found = self._pointers(sample, "the same with nothing closed", False, self.seed + 1)
        own = [
            np.isin(pointers[:, 0], self._own(window))
            for window, pointers in zip(sample, found, strict=True)
        ]
        return float(np.mean(own))

    def _pointers(
        self, windows: NDArray[np.int64], title: str, closing: bool, seed: int
    ) -> NDArray[np.int32]:
        matched = progress_bar(self._matched(windows, closing, seed), len(windows), title)
        pointers = [np.stack([found.sequences, found.frames], axis=1) for found in matched]
        return np.stack(pointers).astype(np.int32)

    def _matched(self, windows: NDArray[np.int64], closing: bool, seed: int) -> Iterator[Matched]:
        # One generator for all: a window's draw depends on its place, not on the chunk.
        generator = torch.Generator().manual_seed(seed)
        for first in range(0, len(windows), self.chunk):
            clips = [self._clip(window, closing) for window in windows[first : first + self.chunk]]
            yield from match_together(
                self.search, clips, generator, self.settings.natural_continuation
            )

    def _clip(self, window: int, closing: bool) -> Clip:
        track, first = self.windows[window]
        return Clip(
            heard(self.tracks[track], int(first), self.settings.frames, self.search.database),
            k=int(self.ks[window]),
            closed=np.flatnonzero(self._shut(window, closing)).tolist(),
            from_mean_pose=self.settings.from_mean_pose,
        )

    def _shut(self, window: int, closing: bool) -> NDArray[np.bool_]:
        """``(M,)``: the sequences of other speakers and, with ``closing``, a window's own."""
        shut = np.zeros(len(self._searchable), dtype=np.bool_)
        if self._others:
            shut |= self._others[self.windows[window][0]]
        if closing and self.settings.closed_frames is not None:
            shut[self._own(window)] = True
        return shut

    def _own(self, window: int) -> NDArray[np.int64]:
        """The sequences around a window in its own recording."""
        track, first = self.windows[window]
        spec = self.search.database.spec
        return neighbours(
            self.search.database,
            self.tracks[track].span.recording,
            self.tracks[track].start_s + first / spec.fps,
            self.settings.frames,
            self.settings.closed_frames or 0,
        )


def _others(
    database: MatchingDatabase, speaker: str, draws: np.random.Generator
) -> NDArray[np.bool_]:
    """``(M,)`` the sequences of other speakers; who isn't in the database borrows a body."""
    names = database.speaker_names
    drawn = names[int(draws.integers(len(names)))]
    return ~database.spoken_by(speaker if speaker in names else drawn)


def cut_windows(tracks: Sequence[Track], settings: PairSettings) -> NDArray[np.int32]:
    """``(P, 2)``: track and first frame of every window; none crosses the end of a track.

    Raises:
        CospeechError: No track is as long as a window.
    """
    last = [len(track.poses) - settings.frames for track in tracks]
    windows = [(i, f) for i, stop in enumerate(last) for f in range(0, stop + 1, settings.stride)]
    if not windows:
        raise CospeechError(
            f"no recording is as long as a window of {settings.frames} frames",
            "use longer recordings, or raise the split's share",
        )
    return np.array(windows, dtype=np.int32)


def heard(track: Track, first: int, frames: int, database: MatchingDatabase) -> NDArray[np.float32]:
    """Normalised audio features of a window, as a synthesis has them.

    With ``spec.true_future`` a window hears what comes after it, like a window in the middle of a
    speech; at the track's end the last frame stays. Otherwise there are zeros, as published.

    Args:
        track: Where it is.
        first: Its first frame.
        frames: Its length.
        database: Which features, and their normalisation.

    Returns:
        ``(frames, Da)``.
    """
    spec = database.spec
    ahead = spec.reach(spec.audio_taps) if spec.true_future else 0
    channels = track.audio[first : first + frames + ahead]
    channels = np.pad(channels, ((0, frames + ahead - len(channels)), (0, 0)), mode="edge")
    features = stack_taps(channels, spec.audio_taps, spec.tap_spacing)[:frames]
    return database.audio_normalisation(features)


def neighbours(
    database: MatchingDatabase, recording: int, start_s: float, frames: int, reach: int
) -> NDArray[np.int64]:
    """Sequences of a recording that have a frame at most ``reach`` frames away from a window.

    Args:
        database: Where they are.
        recording: The window's.
        start_s: Of its first frame, s.
        frames: Its length.
        reach: Frames from its ends; 0 for the sequences that it overlaps.

    Returns:
        Their indices.
    """
    fps, length = database.spec.fps, database.usable.shape[1]
    away = (database.starts_s - start_s) * fps
    # Half a frame apart is the rounding of times, not a frame in between.
    near = (-reach - length + 0.5 < away) & (away < frames + reach - 0.5)
    return np.flatnonzero(np.logical_and(near, database.recordings == recording))


def _made_by(
    tracks: Sequence[Track],
    search: MatchingSearch,
    settings: PairSettings,
    seed: int,
    speakers: Sequence[str] | None,
) -> dict[str, Any]:
    return {
        "version": VERSION,
        "settings": asdict(settings),
        "seed": seed,
        "speakers": None if speakers is None else list(speakers),
        "database": search.database.hash,
        "search": [search.step, search.preselect, search.start_offset],
        "tracks": [[t.span.recording, round(t.start_s, 6), len(t.poses)] for t in tracks],
    }
