"""What the doctor has to say: findings, and the names of the checks behind them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any


class Severity(StrEnum):
    """How bad a finding is."""

    ERROR = "error"
    """Training on it as it is would be wrong."""
    WARNING = "warning"
    """Worth a look; people do train on such data."""
    NOTE = "note"
    """Good to know, or the reason why a check could not be made."""


class Check(StrEnum):
    """Names of the checks, as they are printed and counted."""

    MISSING = "missing file"
    UNREADABLE = "unreadable"
    ODD = "odd file"
    NOT_A_NUMBER = "not a number"
    LENGTHS = "lengths"
    DRIFT = "drift"
    CLIPPED = "clipped audio"
    SILENT = "silent audio"
    FROZEN = "frozen joints"
    JUMP = "jumping joints"
    SIDES = "left and right"
    VERTICAL = "vertical"
    UNITS = "units"
    TRANSCRIPT = "transcript fit"
    WORD_TIMES = "word times"
    OVERLAP = "split overlap"
    DUPLICATE = "duplicate"


@dataclass(frozen=True)
class Finding:
    """Something wrong with the data.

    Attributes:
        check: Which check found it.
        severity: How bad it is.
        file: The file, or the recording of a store, that it is about.
        problem: What is wrong, in a sentence or two.
        next_step: What its owner can do about it.
        time_s: Where in it, seconds from its start; None where it is about all of it.
    """

    check: Check
    severity: Severity
    file: str
    problem: str
    next_step: str
    time_s: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        return asdict(self)


@dataclass(frozen=True)
class Files:
    """What the parts of a recording are called when something is said about them.

    Attributes:
        motion: The motion's file.
        audio: The audio's.
        words: The transcript's.
    """

    motion: str
    audio: str
    words: str

    @classmethod
    def all_in(cls, name: str) -> Files:
        """Everything is in one place, such as a database or a store."""
        return cls(name, name, name)


def has_errors(findings: Iterable[Finding]) -> bool:
    """Whether any of them is an error."""
    return any(finding.severity is Severity.ERROR for finding in findings)
