"""Motion statistics and errors against those of Gesticulator's published evaluation.

Left out are what its scripts make of unflattened arrays: norms of 3 x 3 blocks of three joints.
"""

import numpy as np
import pytest
import torch

from cospeech.metrics.functional import joint_mae, position_error
from cospeech.metrics.movement import derivative_sizes, histogram
from cospeech.motion.bvh import read_bvh
from cospeech.motion.joint_map import bare_names

POINTS = [
    *("Hips", "Spine", "Spine1", "Spine2", "Spine3", "Neck", "Neck1", "Head"),
    *("RightArm", "RightForeArm", "RightHand", "LeftArm", "LeftForeArm", "LeftHand"),
]
FPS = 20.0
CLIP = "real/trinity/MODEL_OUTPUT_gesticulator_jeremy_howard.bvh"


@pytest.fixture(scope="module")
def published(shared):
    with np.load(shared / "data/parity/gesticulator/expected.npz") as arrays:
        return {name: arrays[name] for name in arrays.files if name.startswith("eval_")}


@pytest.fixture(scope="module")
def positions(shared):
    """Of the demo clip: (520, 14, 3), centimetres from the hips."""
    motion = read_bvh(shared / "data" / CLIP)
    assert motion.fps == FPS
    names = bare_names(motion.skeleton)
    points = 100 * motion.positions[:, [names[point] for point in POINTS]].astype(np.float64)
    return points - points[:, :1]


def test_positions(positions, published):
    np.testing.assert_allclose(positions[:20], published["eval_positions_first_20"], atol=1e-5)


@pytest.mark.parametrize(("name", "order"), [("acceleration", 2), ("jerk", 3)])
def test_derivatives_per_second_and_as_printed_per_frame(positions, published, name, order):
    for fps, entry in ((FPS, "per_joint"), (1, "per_joint_no_fps")):
        per_joint = derivative_sizes(positions, order, fps).mean(axis=0)
        np.testing.assert_allclose(per_joint, published[f"eval_{name}_{entry}"], rtol=1e-5)
    mean = derivative_sizes(positions, order, FPS).mean()
    assert mean == pytest.approx(published[f"eval_{name}_mean"], rel=1e-6)


def test_speeds(positions, published):
    speeds = derivative_sizes(positions, 1, FPS)
    np.testing.assert_allclose(
        speeds.mean(axis=0), published["eval_speed_mean_per_joint"], rtol=1e-5
    )
    assert speeds.mean() == pytest.approx(published["eval_speed_mean"], rel=1e-6)
    hands = speeds[:, [POINTS.index("RightHand"), POINTS.index("LeftHand")]].mean()
    assert hands == pytest.approx(published["eval_speed_hands_mean"], rel=1e-6)


@pytest.mark.parametrize(
    ("order", "fps", "width", "entry"),
    [
        (1, FPS, 1.0, "speed_hist_width_1.0"),
        (1, FPS, 0.5, "speed_hist_width_0.5"),
        (1, 1, 1.0, "speed_hist_no_fps"),
        (2, FPS, 1.0, "acceleration_hist_flat"),
    ],
)
def test_histograms_and_what_the_published_ones_leave_out(
    positions, published, order, fps, width, entry
):
    sizes = derivative_sizes(positions, order, fps)
    *within, beyond = histogram(sizes, width, round(19 / width))
    table = published[f"eval_{entry}"]
    np.testing.assert_array_equal(within, table[:, :14])
    np.testing.assert_array_equal(np.sum(within, axis=1), table[:, 14])
    np.testing.assert_array_equal(beyond, len(sizes) - table[:, :14].sum(axis=0))


def test_a_tenth_of_all_speeds_and_nearly_half_of_the_hands_are_left_out(positions):
    beyond = histogram(derivative_sizes(positions, 1, FPS), 1.0, 19)[-1] / 519
    assert beyond.mean() == pytest.approx(0.10, abs=0.005)
    assert beyond[[10, 13]].mean() == pytest.approx(0.45, abs=0.005)


def test_errors_two_frames_later(positions, published):
    clip = torch.from_numpy(positions)
    made, real = clip[None, 2:], clip[None, :-2]
    for function, entry in ((position_error, "ape"), (joint_mae, "mae")):
        per_joint = [
            function(made[:, :, [j]], real[:, :, [j]], seed_frames=0).item() for j in range(14)
        ]
        expected = published[f"eval_{entry}_vs_two_frames_later"]
        np.testing.assert_allclose(per_joint, expected, rtol=1e-5)
