"""The paper's disturbances do what its formulas say."""

import numpy as np
import pytest
import torch

from cospeech.metrics import disturbances
from cospeech.motion.codecs import DirectionVectorCodec
from cospeech.motion.upper_body import UPPER_BODY

BONES = [0.26, 0.18, 0.14, 0.22, 0.36, 0.33, 0.22, 0.36, 0.33]


def poses(count=400, seed=0):
    """Root-relative poses with the published bone table, of mean length 0.2667."""
    directions = torch.randn(count, 34, 9, 3, generator=torch.Generator().manual_seed(seed))
    directions = torch.nn.functional.normalize(directions, dim=-1)
    return DirectionVectorCodec([0.0] * 27, BONES).decode(directions.flatten(-2))


def draw():
    return torch.Generator().manual_seed(9)


def test_scale_is_mean_bone_over_a_fifth():
    assert disturbances.published_scale(poses(5)) == pytest.approx(np.mean(BONES) / 0.2, rel=1e-5)


def test_gaussian_is_constant_over_frames_and_of_variance_zeta():
    change = disturbances.gaussian(poses(), 0.001, 1.5, draw()) - poses()
    torch.testing.assert_close(change, change[:, :1].expand_as(change), atol=1e-6, rtol=0)
    assert change[:, 0].var().item() == pytest.approx(0.001 * 1.5**2, rel=0.05)
    assert change[:, 0, 0].abs().min() > 0


def test_salt_and_pepper_moves_a_tenth_of_the_coordinates_either_way():
    change = disturbances.salt_and_pepper(poses(), 0.1, 1.5, draw()) - poses()
    torch.testing.assert_close(change, change[:, :1].expand_as(change), atol=1e-6, rtol=0)
    values = (change[:, 0] / 0.3).round(decimals=4)
    assert set(values.unique().tolist()) == {-1.0, 0.0, 1.0}
    assert (values == 1).float().mean().item() == pytest.approx(0.05, abs=0.006)
    assert (values == -1).float().mean().item() == pytest.approx(0.05, abs=0.006)


def test_temporal_noise_hits_zeta_successive_frames():
    change = disturbances.temporal(poses(), 5, 1.0, draw()) - poses()
    hit = change.abs().amax((2, 3)) > 1e-5
    assert hit.sum(1).unique().tolist() == [5]
    starts = hit.float().argmax(1)
    assert all(hit[i, start : start + 5].all() for i, start in enumerate(starts.tolist()))
    assert (starts.min().item(), starts.max().item()) == (0, 29)
    assert change[hit].var().item() == pytest.approx(0.003, rel=0.05)
    whole = disturbances.temporal(poses(3), 34, 1.0, draw()) - poses(3)
    assert (whole != 0).float().mean() > 0.99


def test_multiplicative_equals_scaling_principal_components():
    positions = poses(60)
    flat = positions.flatten(2).flatten(0, 1).double().numpy()
    mean = flat.mean(0)
    _, _, axes = np.linalg.svd(flat - mean, full_matrices=False)
    expected = mean + (1.5 * ((flat - mean) @ axes.T)) @ axes
    ours = disturbances.multiplicative(positions, 1.5, positions.mean((0, 1)))
    np.testing.assert_allclose(ours.flatten(2).flatten(0, 1), expected, atol=1e-5)


def test_mismatched_replaces_the_fraction():
    positions = poses(50)
    changed = (disturbances.mismatched(positions, 0.4, draw()) != positions).flatten(1).any(1)
    # A replaced window may draw itself, here once in fifty.
    assert 18 <= int(changed.sum()) <= 20
    known = {window.numpy().tobytes() for window in positions}
    replaced = disturbances.mismatched(positions, 1.0, draw())
    assert {window.numpy().tobytes() for window in replaced} < known


def test_frozen_arms_keep_their_offsets_and_trunk_and_head_move():
    positions = poses(5)
    frozen = disturbances.frozen_arms(positions)
    index = UPPER_BODY.index
    moving = [index[name] for name in ("spine", "neck", "nose", "head", "left_shoulder")]
    assert torch.equal(frozen[:, :, moving], positions[:, :, moving])
    arm = frozen[:, :, index["right_wrist"]] - frozen[:, :, index["right_shoulder"]]
    torch.testing.assert_close(arm, arm[:, :1].expand_as(arm))
    torch.testing.assert_close(frozen[:, 0], positions[:, 0])
