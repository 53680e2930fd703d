"""Whole clips by motion matching, window after window.

See docs/facts/motion_matching.md, section 4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.errors import CospeechError
from cospeech.matching.reference import Match
from cospeech.matching.search import MatchingSearch, Query

_DRAWS = 64
"""Tries to draw a first pose among all frames before those that may be used are listed."""


@dataclass(frozen=True, eq=False)
class Clip:
    """Speech to gesture to.

    Attributes:
        audio: ``(F, Da)`` from `MatchingDatabase.audio_queries`.
        masks: Which frames may be used: None for all, one ``(M, T)`` mask for the whole clip, or
            one (or None) per step. A window needs it at its first and its last frame.
        k: Which candidate is taken at every step, from 1.
        closed: Sequences that aren't used, e.g. those around the clip's own recording.
        from_mean_pose: Begin with what is nearest to the mean pose, not with what is nearest to a
            random frame.
    """

    audio: NDArray[np.float32]
    masks: NDArray[np.bool_] | Sequence[NDArray[np.bool_] | None] | None = None
    k: int = 1
    closed: Sequence[int] | NDArray[np.int64] = ()
    from_mean_pose: bool = False

    def mask(self, step: int) -> NDArray[np.bool_] | None:
        """The mask of a step."""
        if self.masks is None or isinstance(self.masks, np.ndarray):
            return self.masks
        return self.masks[step]


@dataclass(frozen=True, eq=False)
class Matched:
    """Motion put together from a database, and where it comes from.

    Attributes:
        poses: ``(F, J, 3)``: the database's poses, one window after the other, unblended.
        sequences: ``(steps,)`` where each window comes from.
        frames: ``(steps,)`` the first frame that was taken.
    """

    poses: NDArray[np.float32]
    sequences: NDArray[np.int64]
    frames: NDArray[np.int64]


def match(
    search: MatchingSearch,
    clip: Clip,
    generator: torch.Generator | None = None,
    natural_continuation: bool = False,
) -> Matched:
    """Motion for one clip; see `match_together`."""
    return match_together(search, [clip], generator, natural_continuation)[0]


def match_together(
    search: MatchingSearch,
    clips: Sequence[Clip],
    generator: torch.Generator | None = None,
    natural_continuation: bool = False,
) -> list[Matched]:
    """Motion for several clips, a step of all of them at a time: less time for each.

    A clip whose length is no multiple of the step gets a last window that is cut short.

    Args:
        search: The database, and how it is searched.
        clips: What is spoken.
        generator: Draws each clip's first pose.
        natural_continuation: The sequence that a window came from offers the window that goes on
            from there, where it has one, instead of the nearest. The published search doesn't
            favour it.

    Raises:
        CospeechError: A step of a clip has no eligible window, or no frame that it may begin from.
    """
    step = search.step
    walks = [
        Walk(
            search,
            clip.k,
            clip.closed,
            clip.from_mean_pose,
            natural_continuation,
            generator,
            clip.mask(0) if len(clip.audio) else None,
        )
        for clip in clips
    ]
    most = max((-(-len(clip.audio) // step) for clip in clips), default=0)
    for number in range(most):
        going = [i for i, clip in enumerate(clips) if number * step < len(clip.audio)]
        queries = [
            walks[i].query(clips[i].audio[number * step], clips[i].mask(number)) for i in going
        ]
        for i, query, found in zip(going, queries, search.answer(queries), strict=True):
            walks[i].take(query, found)
    return [
        _put_together(search, clip, walk.taken) for clip, walk in zip(clips, walks, strict=True)
    ]


class Walk:
    """A way through a database, a step at a time.

    Args:
        search: The database, and how it is searched.
        k: Which candidate is taken, from 1.
        closed: Sequences that aren't used.
        from_mean_pose: Begin near the mean pose, not near a random frame.
        natural_continuation: See `match_together`.
        generator: Draws the first pose.
        mask: Which frames the first step may use; None for all.

    Attributes:
        taken: Sequence and first frame of each window.

    Raises:
        CospeechError: There is no frame that it may begin from.
    """

    def __init__(
        self,
        search: MatchingSearch,
        k: int = 1,
        closed: Sequence[int] | NDArray[np.int64] = (),
        from_mean_pose: bool = False,
        natural_continuation: bool = False,
        generator: torch.Generator | None = None,
        mask: NDArray[np.bool_] | None = None,
    ) -> None:
        self.taken: list[tuple[int, int]] = []
        self._search, self._k, self._closed = search, k, closed
        self._natural_continuation = natural_continuation
        self._standing = None if from_mean_pose else _first_pose(search, mask, closed, generator)

    def query(self, audio: NDArray[np.float32], mask: NDArray[np.bool_] | None = None) -> Query:
        """What the next step looks for.

        Args:
            audio: ``(Da,)`` feature of the step's first frame.
            mask: Which frames may be used; None for all.
        """
        standing, offset = self._standing, self._search.start_offset
        goes_on = None
        if self._natural_continuation and standing is not None and self.taken:
            goes_on = standing[0], standing[1] + 1 - offset
        return Query(
            _pose_feature(self._search, standing),
            audio,
            self._k,
            mask,
            # The window that would begin with the frame shown last.
            None if standing is None else (standing[0], standing[1] - offset),
            self._closed,
            goes_on,
        )

    def take(self, query: Query, found: Match) -> tuple[int, int]:
        """Go on to the window that was found, and return its sequence and first frame.

        Raises:
            CospeechError: No window may be used.
        """
        search = self._search
        if found.sequence < 0 and query.standing_on is not None:
            # The window that it stands on is all that its controls leave.
            found = search(query._replace(standing_on=None))
        if found.sequence < 0:
            number = len(self.taken)
            raise CospeechError(
                f"no window of the database may be used at step {number}"
                f" ({number * search.step / search.database.spec.fps:.2f} s)",
                "loosen that step's controls",
            )
        first = found.frame + search.start_offset
        self.taken.append((found.sequence, first))
        self._standing = found.sequence, first + search.step - 1
        return self.taken[-1]


def _first_pose(
    search: MatchingSearch,
    mask: NDArray[np.bool_] | None,
    closed: Sequence[int] | NDArray[np.int64],
    generator: torch.Generator | None,
) -> tuple[int, int]:
    """A random frame that a walk may begin from."""
    usable = search.database.usable
    open_sequences = np.ones(len(usable), dtype=np.bool_)
    open_sequences[np.asarray(closed, dtype=np.int64)] = False
    for _ in range(_DRAWS):
        place = int(torch.randint(usable.size, (), generator=generator))
        sequence, frame = divmod(place, usable.shape[1])
        held = mask is None or mask[sequence, frame]
        if held and usable[sequence, frame] and open_sequences[sequence]:
            return sequence, frame
    # So few are open that drawing doesn't find them: the windows themselves are listed.
    windows = search.eligible(mask) & open_sequences[:, None]
    places = np.flatnonzero(windows)
    if len(places) == 0:
        raise CospeechError(
            "no frame of the database may be the first pose", "loosen the first step's controls"
        )
    drawn = int(torch.randint(len(places), (), generator=generator))
    sequence, frame = divmod(int(places[drawn]), windows.shape[1])
    return sequence, frame + search.start_offset


def _pose_feature(search: MatchingSearch, standing: tuple[int, int] | None) -> NDArray[np.float32]:
    features = search.database.pose_features
    if standing is None:
        return np.zeros(features.shape[2], dtype=np.float32)
    return features[standing]


def _put_together(search: MatchingSearch, clip: Clip, taken: Sequence[tuple[int, int]]) -> Matched:
    sequences, frames = np.array(taken, dtype=np.int64).reshape(-1, 2).T
    within = frames[:, None] + np.arange(search.step)
    poses = search.database.poses[sequences[:, None], within]
    poses = poses.reshape(-1, *poses.shape[2:])[: len(clip.audio)]
    return Matched(poses, sequences, frames)
