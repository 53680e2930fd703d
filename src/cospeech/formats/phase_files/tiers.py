"""What the readers of annotation files hand on, whatever the format."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from cospeech.errors import ContentError

MAX_BYTES = 64 * 2**20
MAX_ENTRIES = 1_000_000
"""Bounds on a file: an hour of densely annotated video is a megabyte."""


@dataclass(frozen=True)
class Entry:
    """One annotation.

    Attributes:
        start_s: s.
        end_s: s.
        text: As written.
        place: Where in the file, for messages.
    """

    start_s: float
    end_s: float
    text: str
    place: str


@dataclass(frozen=True)
class Tier:
    """A track of annotations of one kind.

    Attributes:
        track: Its name in the file.
        attribute: Which of the values of the track's elements this is (ANVIL); empty elsewhere.
        entries: In the file's order.
        problem: Why its times can't be known; empty when they can.
    """

    track: str
    attribute: str = ""
    entries: list[Entry] = field(default_factory=list)
    problem: str = ""

    @property
    def name(self) -> str:
        """How a user names it."""
        return f"{self.track}:{self.attribute}" if self.attribute else self.track


def read_time(text: str | None, place: str) -> float:
    """A number of seconds.

    Raises:
        ContentError: It is absent, no number or not finite.
    """
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ContentError(f"{text!r} is not a time in seconds", place)
    return value
