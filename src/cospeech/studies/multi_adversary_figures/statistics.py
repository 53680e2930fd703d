"""What is measured, how its numbers are read, and what the paper says of them."""

from __future__ import annotations

from dataclasses import dataclass

from cospeech.metrics import movement

_FACTORS = {"cm": 100.0, "cm/s": 100.0, "%": 100.0}


@dataclass(frozen=True)
class Statistic:
    """How a number is read.

    Attributes:
        key: Key in `SystemStatistics.numbers`.
        title: What it is called.
        unit: Unit shown.
        meaning: How it is measured, in a sentence.
        paper: What the paper's figures and text say of it; it prints no numbers.
        to_real: A distance to real motion, whose interval is reflected.
    """

    key: str
    title: str
    unit: str
    meaning: str
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


STATISTICS: tuple[Statistic, ...] = (
    Statistic(
        "velocity",
        "wrist velocity",
        "cm/s",
        "|Δx| + |Δy| + |Δz| per second, mean of both wrists, median over windows at each step, mean"
        " over steps",
        "no minibatch > real ≈ full ≈ no motion ≫ no displacement ≈ MSE only",
    ),
    Statistic(
        "velocity_area",
        "area to real's velocity curve",
        "cm",
        "area between the system's curve and real's over the window",
        "full and no motion nearest",
        to_real=True,
    ),
    Statistic(
        "range",
        "wrist range",
        "cm",
        "largest distance of a wrist from its place in the training data's mean pose, mean over"
        " windows",
        "real > full > no displacement and MSE only; no motion below real",
    ),
    Statistic("range_ratio", "range / real", "", "the system's mean range over real's"),
    Statistic(
        "range_gap",
        "distance to real's range",
        "cm",
        "difference of the mean ranges, either way",
        "full nearest",
        to_real=True,
    ),
    Statistic(
        "range_spread",
        "spread of ranges",
        "cm",
        "standard deviation of range over windows",
        "no minibatch almost none; no displacement and MSE only as real",
    ),
    Statistic(
        "held",
        "time held",
        "%",
        f"steps in which both wrists are slower than {100 * movement.HOLD_SPEED:g} cm/s",
        "no clear holds without phase",
    ),
    Statistic(
        "jitter",
        "jitter",
        "%",
        f"share of the wrists' velocity power above {movement.JITTER_FREQUENCY:g} Hz",
        "without phase and displacement most",
    ),
    Statistic("jerk", "wrist jerk", "m/s³", "mean size of the third derivative of position"),
    Statistic(
        "diversity",
        "distance between windows",
        "cm",
        "mean over pairs of windows of the root mean square joint distance",
        "no displacement and MSE only damped",
    ),
    Statistic(
        "variety",
        "variety of windows",
        "",
        "share of the pose variance that differs between windows: 0 where all repeat one motion,"
        " whatever its size",
        "no minibatch repeats",
    ),
    Statistic(
        "repeated",
        "repeated windows",
        "%",
        "windows with another closer than half the median nearest distance of real windows",
        "no minibatch repeats",
    ),
    Statistic(
        "bone_variation",
        "bone length variation",
        "%",
        "standard deviation over time by mean length, mean over bones and recordings",
        "no motion leaves the skeleton",
    ),
    Statistic(
        "finger_distance",
        "finger tips to wrist",
        "cm",
        "mean distance over finger tips",
        "too far without the finger penalty",
    ),
    Statistic(
        "seam",
        "seam jump, long form",
        "times",
        "median step of the joints where windows of a recording meet, over the median step"
        " elsewhere",
    ),
    Statistic(
        "window_jump",
        "jump between windows",
        "times",
        "the same for windows put one after another as the network makes them, with nothing that"
        " joins them",
    ),
    Statistic(
        "window_jump_size",
        "jump between windows",
        "cm",
        "median step of the joints where such windows meet",
        "larger without the continuity penalty",
    ),
    Statistic(
        "phase_shares",
        "phase shares, JS distance",
        "",
        "Jensen-Shannon distance of the phases' shares of time",
        "further without phase",
        to_real=True,
    ),
    Statistic(
        "phase_transitions",
        "phase transitions, JS distance",
        "",
        "Jensen-Shannon distance of which phase follows which",
        "further without phase",
        to_real=True,
    ),
    Statistic(
        "phase_durations",
        "phase durations, JS distance",
        "",
        "Jensen-Shannon distance of how long a phase lasts, mean over phases",
        to_real=True,
    ),
    Statistic(
        "fgd",
        "FGD",
        "",
        "Fréchet gesture distance over whole recordings, in the common evaluation space",
        to_real=True,
    ),
)
"""In the order of the table."""
