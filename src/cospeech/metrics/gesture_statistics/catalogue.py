"""What is measured, and how its numbers are read."""

from __future__ import annotations

from dataclasses import dataclass

from cospeech.metrics.gesture_statistics import movement


@dataclass(frozen=True)
class Statistic:
    """How a number is read.

    Attributes:
        key: Key in `SystemStatistics.estimates`.
        title: What it is called.
        unit: Unit shown.
        factor: From the SI value to the unit shown.
        meaning: How it is measured, in a sentence.
        to_real: A distance to real motion, whose interval is reflected.
    """

    key: str
    title: str
    unit: str
    factor: float
    meaning: str
    to_real: bool = False


STATISTICS: tuple[Statistic, ...] = (
    Statistic(
        "velocity",
        "wrist velocity",
        "cm/s",
        100.0,
        "|Δx| + |Δy| + |Δz| per second, mean of both wrists, median over windows at each step, mean"
        " over steps",
    ),
    Statistic(
        "velocity_area",
        "area to real's velocity curve",
        "cm",
        100.0,
        "area between the system's curve and real's over the window",
        to_real=True,
    ),
    Statistic(
        "range",
        "wrist range",
        "cm",
        100.0,
        "largest distance of a wrist from its place in the training data's mean pose, mean over"
        " windows",
    ),
    Statistic("range_ratio", "range / real", "", 1.0, "the system's mean range over real's"),
    Statistic(
        "range_gap",
        "distance to real's range",
        "cm",
        100.0,
        "difference of the mean ranges, either way",
        to_real=True,
    ),
    Statistic(
        "range_spread", "spread of ranges", "cm", 100.0, "standard deviation of range over windows"
    ),
    Statistic(
        "held",
        "time held",
        "%",
        100.0,
        f"steps in which both wrists are slower than {100 * movement.HOLD_SPEED:g} cm/s",
    ),
    Statistic(
        "jitter",
        "jitter",
        "%",
        100.0,
        f"share of the wrists' velocity power above {movement.JITTER_FREQUENCY:g} Hz",
    ),
    Statistic("jerk", "wrist jerk", "m/s³", 1.0, "mean size of the third derivative of position"),
    Statistic(
        "diversity",
        "distance between windows",
        "cm",
        100.0,
        "mean over pairs of windows of the root mean square joint distance",
    ),
    Statistic(
        "variety",
        "variety of windows",
        "",
        1.0,
        "share of the pose variance that differs between windows: 0 where all repeat one motion,"
        " whatever its size",
    ),
    Statistic(
        "repeated",
        "repeated windows",
        "%",
        100.0,
        "windows with another closer than half the median nearest distance of real windows",
    ),
    Statistic(
        "bone_variation",
        "bone length variation",
        "%",
        100.0,
        "standard deviation over time by mean length, mean over bones and recordings",
    ),
    Statistic(
        "finger_distance", "finger tips to wrist", "cm", 100.0, "mean distance over finger tips"
    ),
    Statistic(
        "seam",
        "seam jump, long form",
        "times",
        1.0,
        "median step of the joints where windows of a recording meet, over the median step"
        " elsewhere",
    ),
    Statistic(
        "window_jump",
        "jump between windows",
        "times",
        1.0,
        "the same for windows put one after another as the network makes them, with nothing that"
        " joins them",
    ),
    Statistic(
        "window_jump_size",
        "jump between windows",
        "cm",
        100.0,
        "median step of the joints where such windows meet",
    ),
    Statistic(
        "phase_shares",
        "phase shares, JS distance",
        "",
        1.0,
        "Jensen-Shannon distance of the phases' shares of time",
        to_real=True,
    ),
    Statistic(
        "phase_transitions",
        "phase transitions, JS distance",
        "",
        1.0,
        "Jensen-Shannon distance of which phase follows which",
        to_real=True,
    ),
    Statistic(
        "phase_durations",
        "phase durations, JS distance",
        "",
        1.0,
        "Jensen-Shannon distance of how long a phase lasts, mean over phases",
        to_real=True,
    ),
    Statistic(
        "fgd",
        "FGD",
        "",
        1.0,
        "Fréchet gesture distance over whole recordings, in the common evaluation space",
        to_real=True,
    ),
)
"""In the order of the table."""
