"""Criteria on a database, and on motion that was made from it."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from cospeech.errors import ConfigError
from cospeech.matching.control.expressions import Criterion, Mask, Number
from cospeech.matching.control.quantities import Values, measure
from cospeech.matching.control.words import WordPattern
from cospeech.matching.database import MatchingDatabase
from cospeech.matching.reference import STEP_FRAMES

MASKS_KEPT = 64
_SEQUENCES_AT_ONCE = 512


Closed = Sequence[int] | NDArray[np.integer] | None
"""Sequences of a database that aren't used."""


def database_mask(
    criterion: Criterion,
    database: MatchingDatabase,
    step: int = STEP_FRAMES,
    closed: Closed = None,
) -> Mask:
    """Where a criterion holds in a database; asked again, the same array.

    A search needs a mask at a window's first and last frame. Few words are as long as a window, so
    ``word(...)`` holds up to ``step - 1`` frames before and after the word: then the windows over
    which the word is spoken, in whole or in part, are those that pass (beside windows between two
    such words less than two steps apart).

    Args:
        criterion: What is asked.
        database: Of what.
        step: Frames of a window.
        closed: Sequences that don't count in percentiles.

    Returns:
        ``(M, T)``, not to be written to.

    Raises:
        ConfigError: The database lacks the joints, transcripts or phases.
    """
    frames = DatabaseFrames(database, step, closed)

    def ask() -> Mask:
        mask = criterion(frames)
        mask.flags.writeable = False
        return mask

    return _known(database).mask((criterion.text, step, frames.key), ask)


@dataclass(eq=False)
class _Known:
    """What was computed of one database before."""

    quantities: dict[str, Values] = field(default_factory=dict)
    percentiles: dict[tuple[str, float, bytes], np.float64] = field(default_factory=dict)
    masks: OrderedDict[object, Mask] = field(default_factory=OrderedDict)

    def mask(self, key: object, ask: Callable[[], Mask]) -> Mask:
        """The mask of a key, made on the first request; the least recent ones are forgotten."""
        found = self.masks.pop(key, None)
        self.masks[key] = ask() if found is None else found
        while len(self.masks) > MASKS_KEPT:
            self.masks.popitem(last=False)
        return self.masks[key]


_KNOWN: WeakKeyDictionary[MatchingDatabase, _Known] = WeakKeyDictionary()


def _known(database: MatchingDatabase) -> _Known:
    return _KNOWN.setdefault(database, _Known())


def common_mask(masks: Sequence[Mask], database: MatchingDatabase) -> Mask:
    """Where all masks of `database_mask` hold; asked again, the same array."""
    if len(masks) == 1:
        return masks[0]
    # The masks stay referenced by the answer's key, so an identity is never another mask's.
    key = tuple(_ByIdentity(mask) for mask in masks)
    return _known(database).mask(key, lambda: np.logical_and.reduce(masks))


@dataclass(frozen=True, eq=False)
class _ByIdentity:
    mask: Mask

    def __hash__(self) -> int:
        return id(self.mask)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _ByIdentity) and other.mask is self.mask


class DatabaseFrames:
    """The frames of a database.

    Args:
        database: The database.
        step: Frames of a window.
        closed: Sequences that don't count in percentiles: those that the search won't use.

    Attributes:
        key: Equal for the same closed sequences.
    """

    def __init__(
        self, database: MatchingDatabase, step: int = STEP_FRAMES, closed: Closed = None
    ) -> None:
        self.database, self.step = database, step
        self._known = _known(database)
        self._open = np.ones(len(database), dtype=np.bool_)
        if closed is not None:
            self._open[np.asarray(closed, dtype=np.int64)] = False
        self.key = np.packbits(self._open).tobytes()

    def quantity(self, name: str) -> Values:
        """A quantity of every frame, ``(M, T)``; the whole database is read once per quantity."""
        database, found = self.database, self._known.quantities
        if name not in found:
            poses, fps = database.poses, database.spec.fps
            parts = [
                measure(name, poses[first : first + _SEQUENCES_AT_ONCE], database.pose_roles, fps)
                for first in range(0, len(poses), _SEQUENCES_AT_ONCE)
            ]
            found[name] = np.concatenate(parts)
        return found[name]

    def quantity_percentile(self, name: str, percent: float) -> np.float64:
        """What ``pNN`` means beside a quantity."""
        return self.percentile(lambda frames: frames.quantity(name), name, percent)

    def percentile(self, of: Number, key: str, percent: float) -> np.float64:
        """A percentile over the frames on which windows of open sequences may start."""
        found, place = self._known.percentiles, (key, percent, self.key)
        if place not in found:
            everywhere = np.broadcast_to(np.asarray(of(self)), self.database.usable.shape)
            values = everywhere[self.database.usable & self._open[:, None]]
            values = values[np.isfinite(values)]
            empty = len(values) == 0
            found[place] = np.float64(np.nan if empty else np.percentile(values, percent))
        return found[place]

    def phases(self) -> NDArray[np.int8]:
        """``(M, T)``."""
        phases = self.database.phases
        if not (phases >= 0).any():
            raise ConfigError(
                "the criterion asks for gesture phases, and the database's corpus has none",
                "use a corpus with annotated phases, or control quantities or words",
            )
        return phases

    def spoken(self, pattern: WordPattern) -> Mask:
        """``(M, T)``, as `database_mask` says."""
        words = self.database.words
        if len(words.ids) == 0:
            raise ConfigError(
                f"the criterion asks for words ({pattern.text}), and the database's corpus has no"
                " transcripts",
                "use a corpus with transcripts, or control quantities",
            )
        meant = np.zeros(len(words.vocabulary), dtype=np.bool_)
        meant[pattern.among(words.vocabulary)] = True
        chosen = np.flatnonzero(meant[words.ids])
        fps, around = self.database.spec.fps, self.step - 1
        return _marked(
            self.database,
            np.asarray(words.recordings)[chosen],
            np.floor(np.asarray(words.starts_s)[chosen] * fps + 1e-6) / fps - around / fps,
            np.ceil(np.asarray(words.ends_s)[chosen] * fps - 1e-6) / fps + around / fps,
        )

    def everywhere(self, value: np.bool_) -> Mask:
        """``(M, T)``."""
        return np.full(self.database.usable.shape, value)


def _marked(
    database: MatchingDatabase,
    recordings: NDArray[np.int32],
    starts_s: NDArray[np.float64],
    stops_s: NDArray[np.float64],
) -> Mask:
    """``(M, T)``: frames whose time lies in a stretch of their recording, the stop left out."""
    count, frames = database.usable.shape
    fps = database.spec.fps
    order = np.lexsort((database.starts_s, database.recordings))
    first_s = np.asarray(database.starts_s)[order]
    of = np.asarray(database.recordings)[order]
    # +1 where a stretch begins and -1 where it ends: a running sum counts the stretches.
    edges = np.zeros((count, frames + 1), dtype=np.int32)
    for recording in np.unique(recordings):
        low, high = np.searchsorted(of, [recording, recording + 1])
        mine = recordings == recording
        starts, stops = starts_s[mine], stops_s[mine]
        begins = first_s[low:high]
        at = np.searchsorted(begins, starts - frames / fps, "right")
        last = np.searchsorted(begins, stops, "left")
        while (going := at < last).any():
            sequences, offsets = order[low:high][at[going]], begins[at[going]]
            inside = [
                np.clip(np.ceil((edge[going] - offsets) * fps - 1e-3), 0, frames).astype(np.int64)
                for edge in (starts, stops)
            ]
            np.add.at(edges, (sequences, inside[0]), 1)
            np.add.at(edges, (sequences, inside[1]), -1)
            at = at + 1
    return edges[:, :frames].cumsum(axis=1) > 0
