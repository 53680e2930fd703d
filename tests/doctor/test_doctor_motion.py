"""Planted faults in motion."""

from dataclasses import replace

import numpy as np
import pytest

from cospeech.corpus.recording import Recording
from cospeech.doctor import Check, Severity, examine
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import to_upper_body
from cospeech.speech.speech import Speech
from tests.doctor.planted import (
    ARMS,
    LEGS,
    exchanged,
    the_error,
    the_warning,
    with_positions,
)

FPS = 60


@pytest.fixture
def take(takes) -> Recording:
    return takes[1]


def below(recording: Recording, joint: str) -> list[int]:
    """A joint and everything it carries."""
    skeleton = recording.motion.skeleton
    found = [skeleton.index[joint]]
    for i, parent in enumerate(skeleton.parents):
        if parent in found:
            found.append(i)
    return found


def test_positions_alone_pass(takes):
    for recording in takes:
        assert examine(with_positions(recording, recording.motion.positions)) == []


def test_the_evaluation_joints_alone_pass(takes):
    for recording in takes:
        upper = to_upper_body(recording.motion)
        assert examine(replace(recording, motion=upper)) == []


def test_nan(take):
    positions = take.motion.positions.copy()
    positions[5 * FPS, take.motion.skeleton.index["LeftHand"], 1] = np.nan
    finding = the_error(examine(with_positions(take, positions)), Check.NOT_A_NUMBER, 5.0)
    assert "LeftHand" in finding.problem


def test_frozen_body(take):
    positions = take.motion.positions.copy()
    positions[6 * FPS : 9 * FPS] = positions[6 * FPS]
    finding = the_error(examine(with_positions(take, positions)), Check.FROZEN, 6.0)
    assert "to 8.98 s" in finding.problem or "to 9.0" in finding.problem
    positions = take.motion.positions.copy()
    positions[6 * FPS : 7 * FPS] = positions[6 * FPS]
    the_warning(examine(with_positions(take, positions)), Check.FROZEN, 6.0)


def test_an_arm_whose_rotation_is_frozen(take):
    motion = take.motion
    rotations = motion.rotations_local.copy()
    elbow = motion.skeleton.index["LeftForeArm"]
    rotations[4 * FPS : 9 * FPS, elbow] = rotations[4 * FPS, elbow]
    frozen = replace(take, motion=replace(motion, rotations_local=rotations))
    finding = the_error(examine(frozen), Check.FROZEN, 4.0)
    assert "left arm" in finding.problem


def test_a_hand_that_hangs_in_the_air(take):
    positions = take.motion.positions.copy()
    hand = below(take, "RightHand")
    positions[4 * FPS : 9 * FPS, hand] = positions[4 * FPS, hand]
    finding = the_error(examine(with_positions(take, positions)), Check.FROZEN, 4.0)
    assert "right arm" in finding.problem


def test_an_arm_that_was_never_captured_is_a_warning(take):
    motion = take.motion
    rotations = motion.rotations_local.copy()
    rotations[:, motion.skeleton.index["LeftForeArm"]] = rotations[
        0, motion.skeleton.index["LeftForeArm"]
    ]
    never = replace(take, motion=replace(motion, rotations_local=rotations))
    assert "in the whole recording" in the_warning(examine(never), Check.FROZEN).problem


def test_a_jump(take):
    positions = take.motion.positions.copy()
    hand = below(take, "RightHand")
    positions[7 * FPS : 7 * FPS + 3, hand] += np.float32([0.3, 0.2, 0.3])
    finding = the_error(examine(with_positions(take, positions)), Check.JUMP, 7.0)
    assert "RightHand jumps" in finding.problem
    assert "m/s" in finding.problem


def test_a_small_jump_among_slow_frames_is_a_warning(take):
    slow = take.motion.positions[::4].copy()
    hand = below(take, "RightHand")
    slow[100:, hand] += np.float32([0.25, 0.25, 0.0])
    motion = Motion(take.motion.skeleton, 15.0, slow)
    finding = the_warning(examine(replace(take, motion=motion)), Check.JUMP, 100 / 15)
    assert "RightHand jumps by 0.3" in finding.problem


def test_the_body_jumps_through_the_room(take):
    positions = take.motion.positions.copy()
    positions[7 * FPS :] += np.float32([0.5, 0, 0])
    assert "Hips" in the_error(examine(with_positions(take, positions)), Check.JUMP, 7.0).problem


def test_arms_exchanged_in_the_middle(take):
    positions = exchanged(take, ARMS, slice(5 * FPS, 8 * FPS))
    finding = the_error(examine(with_positions(take, positions)), Check.SIDES, 5.0)
    assert "5.00, 8.00" in finding.problem


@pytest.mark.parametrize("pairs", [ARMS, ARMS + LEGS], ids=["arms", "all"])
def test_left_and_right_exchanged_throughout(take, pairs):
    finding = the_error(examine(with_positions(take, exchanged(take, pairs))), Check.SIDES)
    assert "elbows bend backwards" in finding.problem
    assert ("side of the right hip" in finding.problem) == (pairs == ARMS)


def test_mirrored_data(take):
    mirrored = take.motion.positions * np.float32([-1, 1, 1])
    the_error(examine(with_positions(take, mirrored)), Check.SIDES)
    upper = to_upper_body(take.motion)
    ted = replace(upper, positions=upper.positions * np.float32([-1, 1, 1]))
    finding = the_error(examine(replace(take, motion=ted)), Check.SIDES)
    assert "left shoulder is at -x" in finding.problem
    assert "nose is behind" in finding.problem


def test_a_turned_body_is_no_fault(take):
    x, y, z = np.moveaxis(take.motion.positions, -1, 0)
    assert examine(with_positions(take, np.stack([-x, y, -z], -1))) == []
    assert examine(with_positions(take, np.stack([z, y, -x], -1))) == []


def test_y_down(take):
    finding = the_error(
        examine(with_positions(take, take.motion.positions * np.float32([1, -1, 1]))),
        Check.VERTICAL,
    )
    assert "-y is up" in finding.problem


def test_z_up(take):
    x, y, z = np.moveaxis(take.motion.positions, -1, 0)
    finding = the_error(examine(with_positions(take, np.stack([x, -z, y], -1))), Check.VERTICAL)
    assert "(x, y, z) to (x, z, -y)" in finding.next_step


@pytest.mark.parametrize(
    ("factor", "says"),
    [
        (100, "by 0.01 "), (0.01, "by 100 "), (1000, "by 0.001 "),
        (1 / 2.54, "by 2.54 "), (1 / 5.64444, "by 5.64444 "),
    ],
)  # fmt: skip
def test_wrong_units(take, factor, says):
    finding = the_error(
        examine(with_positions(take, take.motion.positions * np.float32(factor))), Check.UNITS
    )
    assert f"multiply the unit scale {says}" in finding.next_step


def test_pictures_upside_down_or_mirrored():
    joints = ("neck", *(f"{s}_{j}" for s in ("left", "right") for j in ("shoulder", "elbow")))
    skeleton = Skeleton("keypoints", joints, (-1, 0, 1, 0, 3))
    rest = np.array([[0, 0], [60, -5], [70, -80], [-60, -5], [-70, -80]], np.float32)
    noise = np.random.default_rng(0).normal(0, 0.5, (150, 5, 2))

    def recording(positions):
        motion = Motion(skeleton, 15.0, positions.astype(np.float32))
        return Recording("a", "a", Speech(np.zeros(0, np.float32)), motion)

    assert examine(recording(rest + noise)) == []
    the_error(examine(recording((rest + noise) * [1, -1])), Check.VERTICAL)
    the_error(examine(recording((rest + noise) * [-1, 1])), Check.SIDES)
    thrown = rest + noise
    thrown[75, 2] += 300
    (finding,) = examine(recording(thrown))
    assert (finding.check, finding.severity) == (Check.JUMP, Severity.WARNING)
    assert finding.time_s == pytest.approx(5.0, abs=0.1)
