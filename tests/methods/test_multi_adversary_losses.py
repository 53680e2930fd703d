"""The objective losses by hand."""

import pytest
import torch

from cospeech.methods.multi_adversary.losses import (
    continuity_loss,
    finger_loss,
    finger_offsets,
)


def test_continuity_is_the_jump_from_window_to_window_of_one_run():
    poses = torch.zeros(4, 3, 2)
    poses[0, -1] = torch.tensor([1.0, 2.0])
    poses[1, 0] = torch.tensor([4.0, 6.0])  # 3 and 4 away
    poses[1, -1] = torch.tensor([100.0, 0.0])  # the next window belongs to another run
    poses[3, 0] = torch.tensor([0.0, 2.0])  # 2 away from zero
    # two windows of two dimensions have a window before them; four windows in all
    assert float(continuity_loss(poses, 2)) == pytest.approx((9 + 16 + 4) / (4 * 2))


def test_motion_inside_a_window_and_a_runs_first_window_cost_nothing():
    poses = torch.randn(3, 50, 6)
    assert float(continuity_loss(poses, 1)) == 0
    line = torch.arange(20.0).reshape(1, 20, 1)
    steady = torch.cat([line, line + 19]).reshape(2, 20, 1)
    assert float(continuity_loss(steady, 2)) == 0


def test_a_broken_run_is_refused():
    with pytest.raises(ValueError, match="5 windows are not runs of 2"):
        continuity_loss(torch.zeros(5, 3, 2), 2)


def test_finger_distance_by_hand():
    real = torch.tensor([[[0.0, 0, 0], [0.1, 0, 0], [0.0, 0.2, 0]]])  # wrist and two tips
    generated = real + torch.tensor([1.0, 1, 1])  # the whole hand moved: offsets stay
    tips = [(1, 0), (2, 0)]
    deviation = torch.full((2, 3), 0.01)
    same = finger_loss(finger_offsets(generated, tips), finger_offsets(real, tips), deviation)
    assert float(same) == pytest.approx(0, abs=1e-6)
    generated[0, 1, 0] += 0.03  # one of six numbers, three deviations away
    moved = finger_loss(finger_offsets(generated, tips), finger_offsets(real, tips), deviation)
    assert float(moved) == pytest.approx(9 / 6, rel=1e-4)
