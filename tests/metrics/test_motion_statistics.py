"""How strongly motion is moved, as columns: against motion whose derivatives are known."""

import pytest
import torch

from cospeech.evaluation import Catalogue
from cospeech.metrics.evaluation_windows import EvaluationWindows
from cospeech.metrics.motion_statistics import Acceleration, Jerk, Speed
from cospeech.metrics.position_error import AveragePositionError, RootMeanSquareError
from cospeech.motion.upper_body import MOVING_JOINTS, UPPER_BODY


def windows(positions):
    return EvaluationWindows(positions, torch.zeros(len(positions), 32))


def thrown(count=3):
    """Joint j falls in window w by x = (w + 1) j t² / 2 metres; the root stays."""
    times = torch.arange(34, dtype=torch.float64) / 15
    positions = torch.zeros(count, 34, 10, 3, dtype=torch.float64)
    strength = torch.arange(1, count + 1)[:, None, None] * torch.arange(10)
    positions[..., 1] = -strength * times[:, None].square() / 2
    return windows(positions)


@pytest.mark.parametrize(
    ("metric", "expected", "unit"),
    [
        # joints 1 to 9: 5 in the mean; windows 1 to 3: 2; the speed at half steps: 33 / 30 s
        (Speed(), 10 * 33 / 30, "m/s"),
        (Acceleration(), 10, "m/s²"),
        (Jerk(), 0, "m/s³"),
        (Speed("frame"), 10 * 33 / 30 / 15, "m/frame"),
        (Acceleration("frame"), 10 / 225, "m/frame²"),
        (Jerk("frame"), 0, "m/frame³"),
    ],
)
def test_a_fall_of_nine_joints(metric, expected, unit):
    fall = thrown()
    for indices in (torch.tensor([0]), torch.tensor([1, 2])):
        metric.update(fall[indices], windows(torch.zeros(0, 34, 10, 3)))
    assert metric.compute().item() == pytest.approx(expected, abs=1e-9)
    (column,) = Catalogue({"x": metric}).described()
    assert column == {"key": "x", "title": f"{metric.title}, {unit}", "better": None}


def test_jerk_of_a_cubic():
    positions = torch.zeros(1, 34, 10, 3, dtype=torch.float64)
    positions[0, :, 5, 2] = (torch.arange(34.0).double() / 15) ** 3
    for per, expected in (("second", 6 / 9), ("frame", 6 / 9 / 15**3)):
        metric = Jerk(per)
        metric.update(windows(positions), windows(positions))
        assert metric.compute().item() == pytest.approx(expected, rel=1e-6)


def test_the_root_does_not_count_and_everything_else_does():
    assert [UPPER_BODY.joints[j] for j in MOVING_JOINTS] == list(UPPER_BODY.joints[1:])


def test_there_are_two_units_of_time():
    with pytest.raises(ValueError, match="neither second nor frame"):
        Acceleration("minute")


def test_errors_are_means_over_windows_of_any_batches():
    real, made = windows(torch.zeros(3, 34, 10, 3)), windows(torch.zeros(3, 34, 10, 3))
    made.positions[1, 4:, :, 0] = 0.3
    made.positions[2, 4:19, :, 1] = 0.4  # half of the frames that count
    made.positions[:, :, 0] = 7  # the root, which no motion has elsewhere
    for metric, expected in (
        (AveragePositionError(), (0.3 + 0.2) / 3),
        (RootMeanSquareError(), (0.3 + 0.4 * 0.5**0.5) / 3),
        (AveragePositionError(seed_frames=0), (0.3 * 30 + 0.4 * 15) / 34 / 3),
    ):
        for indices in (torch.tensor([2]), torch.tensor([0, 1])):
            metric.update(made[indices], real[indices])
        assert metric.compute().item() == pytest.approx(expected, rel=1e-6)
