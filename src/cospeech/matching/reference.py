"""The search as the paper describes it, in loops: slow, and what the fast one is judged by."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cospeech.matching.database import MatchingDatabase
from cospeech.matching.distances import audio_distances, pose_distances

STEP_FRAMES = 8
"""Frames that each search adds (the paper's N): 0.53 s at 15 fps."""

Preselect = Literal["pose", "audio", "pose_only"]
"""By what each sequence's one candidate is found. ``"pose_only"`` ranks by pose alone as well."""


class Match(NamedTuple):
    """Where a search found its window.

    Attributes:
        sequence: Index of the database sequence; -1 where no window was eligible.
        frame: First frame of the window.
        candidates: Sequences that had an eligible window.
    """

    sequence: int
    frame: int
    candidates: int


def search_reference(
    database: MatchingDatabase,
    pose: NDArray[np.float32],
    audio: NDArray[np.float32],
    *,
    k: int = 1,
    step: int = STEP_FRAMES,
    preselect: Preselect = "pose",
    mask: NDArray[np.bool_] | None = None,
    standing_on: tuple[int, int] | None = None,
    goes_on: tuple[int, int] | None = None,
    start_offset: int = 0,
) -> Match:
    """One step of the search (docs/facts/motion_matching.md, section 4, step 2).

    Each sequence offers its eligible window that starts nearest (earliest of equals); candidates
    are ranked by pose and by audio (lower sequence first of equals) and sorted by the sum of ranks,
    then by pose rank.

    Args:
        database: What is searched.
        pose: ``(Dp,)`` normalised pose feature of the frame before.
        audio: ``(Da,)`` normalised audio feature of the first frame wanted.
        k: Which of the sorted candidates, from 1; the last one where there are fewer.
        step: Frames of a window.
        preselect: See `Preselect`.
        mask: ``(M, T)``: a window needs it at its first and its last frame. None: everywhere.
        standing_on: (sequence, frame) the query's pose comes from, which is no candidate. The
            published code tests for a distance of 0 instead.
        goes_on: (sequence, frame): the one window that its sequence offers, if it is eligible; it
            may be the frame stood on.
        start_offset: How far behind the frame that is compared a window begins.

    Returns:
        The window chosen.
    """
    found: list[tuple[int, int, float, float]] = []
    sequences, frames = database.usable.shape
    for sequence in range(sequences):
        eligible = []
        for frame in range(frames - step + 1 - start_offset):
            first = frame + start_offset
            if not database.usable[sequence, frame]:
                continue
            if mask is None or (mask[sequence, first] and mask[sequence, first + step - 1]):
                eligible.append(frame)
        if goes_on is not None and goes_on[0] == sequence and goes_on[1] in eligible:
            eligible = [goes_on[1]]
        else:
            eligible = [frame for frame in eligible if (sequence, frame) != standing_on]
        best: tuple[float, int] | None = None
        for frame in eligible:
            if preselect == "audio":
                distance = _audio(database, audio, sequence, frame)
            else:
                distance = _pose(database, pose, sequence, frame)
            if best is None or distance < best[0]:
                best = distance, frame
        if best is not None:
            by_pose = _pose(database, pose, sequence, best[1])
            by_audio = _audio(database, audio, sequence, best[1])
            found.append((sequence, best[1], by_pose, by_audio))
    if not found:
        return Match(-1, -1, 0)
    pose_ranks = _ranks([by_pose for _, _, by_pose, _ in found])
    audio_ranks = _ranks([by_audio for _, _, _, by_audio in found])
    if preselect == "pose_only":
        audio_ranks = [0] * len(found)
    order = sorted(range(len(found)), key=lambda i: (pose_ranks[i] + audio_ranks[i], pose_ranks[i]))
    chosen = found[order[min(k, len(order)) - 1]]
    return Match(chosen[0], chosen[1], len(found))


def _pose(
    database: MatchingDatabase, query: NDArray[np.float32], sequence: int, frame: int
) -> float:
    rows = database.pose_features[sequence, frame : frame + 1]
    return float(pose_distances(query, rows)[0])


def _audio(
    database: MatchingDatabase, query: NDArray[np.float32], sequence: int, frame: int
) -> float:
    rows = database.audio_features[sequence, frame : frame + 1]
    return float(audio_distances(query, rows)[0])


def _ranks(distances: list[float]) -> list[int]:
    """The place of each in order, from 0; of equals the one that comes first is before."""
    ranks = [0] * len(distances)
    for place, i in enumerate(sorted(range(len(distances)), key=lambda i: distances[i])):
        ranks[i] = place
    return ranks
