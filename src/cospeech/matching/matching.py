"""Whole clips by motion matching, window after window (spec A.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from cospeech.errors import CospeechError
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
    database, step = search.database, search.step
    taken: list[list[tuple[int, int]]] = [[] for _ in clips]
    poses = [_first_pose(search, clip, generator) for clip in clips]
    most = max((-(-len(clip.audio) // step) for clip in clips), default=0)
    for number in range(most):
        going = [i for i, clip in enumerate(clips) if number * step < len(clip.audio)]
        queries = []
        for i in going:
            clip, standing = clips[i], poses[i]
            goes_on = None
            if natural_continuation and standing is not None and number:
                goes_on = standing[0], standing[1] + 1 - search.start_offset
            queries.append(
                Query(
                    _pose_feature(search, standing),
                    clip.audio[number * step],
                    clip.k,
                    clip.mask(number),
                    # The window that would begin with the frame shown last.
                    None if standing is None else (standing[0], standing[1] - search.start_offset),
                    clip.closed,
                    goes_on,
                )
            )
        for i, query, found in zip(going, queries, search.answer(queries), strict=True):
            if found.sequence < 0 and query.standing_on is not None:
                # The window that it stands on is all that its controls leave.
                found = search(query._replace(standing_on=None))
            if found.sequence < 0:
                raise CospeechError(
                    f"no window of the database may be used at step {number}"
                    f" ({number * step / database.spec.fps:.2f} s)",
                    "loosen that step's controls",
                )
            first = found.frame + search.start_offset
            taken[i].append((found.sequence, first))
            poses[i] = found.sequence, first + step - 1
    return [_put_together(search, clip, rows) for clip, rows in zip(clips, taken, strict=True)]


def _first_pose(
    search: MatchingSearch, clip: Clip, generator: torch.Generator | None
) -> tuple[int, int] | None:
    """The frame that a clip begins from; None for the mean pose."""
    if clip.from_mean_pose:
        return None
    usable = search.database.usable
    mask = clip.mask(0) if len(clip.audio) else None
    open_sequences = np.ones(len(usable), dtype=np.bool_)
    open_sequences[np.asarray(clip.closed, dtype=np.int64)] = False
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
