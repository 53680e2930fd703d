"""What is measured of a system, and what the paper says of it: `paper.yaml`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files

import yaml

from cospeech.studies.multi_adversary_figures.measured import REAL

PAPER_SYSTEMS = (REAL, "full", "no_motion", "no_minibatch", "no_displacement", "mse_only")
"""The systems of figure 11, the complete model first; others follow them."""

_FACTORS = {"cm": 100.0, "cm/s": 100.0, "%": 100.0}


@dataclass(frozen=True)
class Statistic:
    """How a number is read.

    Attributes:
        title: What it is called.
        meaning: How it is measured, in a sentence.
        unit: Unit shown.
        paper: What the paper's figures and text say of it; it prints no numbers.
        to_real: A distance to real motion, whose interval is reflected.
    """

    title: str
    meaning: str
    unit: str = ""
    paper: str = ""
    to_real: bool = False

    @property
    def factor(self) -> float:
        """From the SI value to the unit shown."""
        return _FACTORS.get(self.unit, 1.0)

    @property
    def heading(self) -> str:
        """Title with its unit."""
        return f"{self.title}, {self.unit}" if self.unit else self.title


@dataclass(frozen=True)
class Under:
    """A number of each of some systems is under that of each of others, or under a multiple of it.

    Attributes:
        statistic: Key of the statistic.
        smaller: Names of the systems.
        larger: Names of the others.
        factor: Of the larger side.
    """

    statistic: str
    smaller: Sequence[str]
    larger: Sequence[str]
    factor: float = 1.0


@dataclass(frozen=True)
class Finding:
    """A statement of the paper and the comparisons that all have to hold.

    Attributes:
        section: Of the paper.
        claim: In words.
        comparisons: What it says of systems.
    """

    section: str
    claim: str
    comparisons: tuple[Under, ...]


_TEXT = (files("cospeech.studies.multi_adversary_figures") / "paper.yaml").read_text("utf-8")
_PAPER = yaml.safe_load(_TEXT)

STATISTICS = {key: Statistic(**values) for key, values in _PAPER["statistics"].items()}
"""By their key in `SystemStatistics.numbers`, in the order of the table."""

FINDINGS = tuple(
    Finding(found["section"], found["claim"], tuple(Under(**each) for each in found["comparisons"]))
    for found in _PAPER["findings"]
)
"""In the paper's words as far as they can be measured."""
