"""What the study asks for: the paper's six controls, and one that changes over time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from cospeech.matching.control import Controls


@dataclass(frozen=True)
class TestedControl:
    """A control that pushes one quantity one way (table 2).

    Attributes:
        name: As in the paper's table.
        quantity: What is controlled, a key of `cospeech.matching.control.QUANTITIES`.
        percent: Percentile of the database that is the threshold.
        way: 1 where the quantity shall be above it, -1 where below.
        published: Threshold, then mean and deviation of k-NN and of k-NN + cGAN in the paper, on
            another corpus (one speaker, seated); metres and metres per second.
    """

    name: str
    quantity: str
    percent: float
    way: Literal[1, -1]
    published: tuple[float, ...]

    @property
    def where(self) -> str:
        """The criterion."""
        return f"{self.quantity} {'>=' if self.way > 0 else '<='} p{self.percent:g}"

    def controls(self) -> Controls:
        """The criterion for all of the speech."""
        return Controls.from_dict(self.where)


TESTED_CONTROLS: tuple[TestedControl, ...] = (
    TestedControl("wrist high", "left_wrist_height", 85, 1, (0.222, 0.256, 0.034, 0.234, 0.042)),
    TestedControl("wrist low", "left_wrist_height", 15, -1, (0.097, 0.085, 0.021, 0.091, 0.029)),
    TestedControl("wrist fast", "left_wrist_speed", 85, 1, (0.191, 0.228, 0.120, 0.175, 0.103)),
    TestedControl("wrist slow", "left_wrist_speed", 15, -1, (0.030, 0.059, 0.038, 0.054, 0.041)),
    TestedControl("asymmetric", "asymmetry", 85, 1, (0.100, 0.122, 0.030, 0.104, 0.039)),
    TestedControl("symmetric", "asymmetry", 15, -1, (0.0, 0.010, 0.012, 0.021, 0.020)),
)
"""Table 2. Percentiles as the paper's section 4.1.1."""

QUANTITIES: tuple[str, ...] = tuple(dict.fromkeys(tested.quantity for tested in TESTED_CONTROLS))
"""What is measured of every motion."""

CHANGING_PERCENTS = (25, 75)
"""Two criteria at 15 % each would leave next to nothing: quartiles."""

SLOW_AND_LOW, FAST_AND_HIGH = (
    f"left_wrist_speed {sign} p{percent} and left_wrist_height {sign} p{percent}"
    for sign, percent in zip(("<=", ">="), CHANGING_PERCENTS, strict=True)
)
CHANGING_QUANTITIES = ("left_wrist_height", "left_wrist_speed")


def changing(seconds: float) -> Controls:
    """Slow and low in the first half of the speech, fast and high in the second (section 4.1.2)."""
    middle_s = seconds / 2
    return Controls.from_dict(
        [{"to_s": middle_s, "where": SLOW_AND_LOW}, {"from_s": middle_s, "where": FAST_AND_HIGH}]
    )
