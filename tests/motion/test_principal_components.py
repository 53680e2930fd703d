"""Principal components of rotations: against SciPy's singular values, and back."""

import numpy as np
import pytest
import torch

from cospeech.corpus.synthetic.skeleton import SKELETON
from cospeech.motion.codecs import ExponentialMapCodec, PrincipalComponentCodec

JOINTS = ("LeftArm", "RightArm", "Spine")


def rotations(frames=300, seed=0):
    """Smooth turns by less than pi of every joint; three degrees of freedom move them all."""
    rng = np.random.default_rng(seed)
    times = np.linspace(0, 9, frames)[:, None]
    causes = np.sin(times * np.array([1.0, 2.3, 3.1])) * np.array([1.0, 0.5, 0.2])
    vectors = (causes @ rng.normal(size=(3, len(SKELETON) * 3)) * 0.5).reshape(frames, -1, 3)
    vectors += 0.01 * rng.normal(size=vectors.shape)
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
    halves = [vectors / angle * np.sin(angle / 2), np.cos(angle / 2)]
    return torch.from_numpy(np.concatenate(halves, axis=-1).astype(np.float32))


def fitted(components, moved):
    codec = PrincipalComponentCodec(ExponentialMapCodec(SKELETON, JOINTS), components)
    codec.fit(moved)
    return codec


def test_components_are_those_of_a_singular_value_decomposition():
    moved = rotations()
    codec = fitted(4, moved)
    values = codec.features.encode(moved).double().numpy()
    centred = values - values.mean(axis=0)
    _, sizes, directions = np.linalg.svd(centred, full_matrices=False)
    scores = codec.encode(moved).numpy()
    assert scores.shape == (300, 4) == (300, codec.size)
    np.testing.assert_allclose(np.abs(scores), np.abs(centred @ directions[:4].T), atol=1e-5)
    kept = (sizes[:4] ** 2).sum() / (sizes**2).sum()
    assert codec.variance_kept.item() == pytest.approx(kept, rel=1e-5)
    assert 0.95 < kept < 1


def test_the_largest_number_of_a_direction_is_positive():
    """Or the same motion might be fitted into components of another sign after a stop."""
    directions = fitted(9, rotations()).directions
    largest = directions.gather(1, directions.abs().argmax(dim=1, keepdim=True))
    assert (largest > 0).all()
    mirrored = rotations()
    mirrored[..., :3] *= -1  # every score changes its sign, and no direction
    torch.testing.assert_close(
        fitted(3, mirrored).directions, fitted(3, rotations()).directions, atol=1e-5, rtol=0
    )


def test_all_components_lose_nothing_and_few_lose_what_they_leave_out():
    moved = rotations()
    whole, few = fitted(9, moved), fitted(3, moved)
    made = whole.motion(whole.encode(moved), 20.0)
    expected = whole.features.motion(whole.features.encode(moved), 20.0)
    np.testing.assert_allclose(made.positions, expected.positions, atol=1e-5)
    assert whole.variance_kept.item() == pytest.approx(1)
    away = np.abs(few.motion(few.encode(moved), 20.0).positions - expected.positions).max()
    assert 1e-3 < away < 0.05


def test_a_frame_is_the_same_to_the_bit_however_many_there_are():
    moved = rotations(frames=40)
    codec = PrincipalComponentCodec(ExponentialMapCodec(SKELETON, SKELETON.joints[:15]), 12)
    codec.fit(moved)
    scores = codec.encode(moved)
    whole = codec.motion(scores, 20.0).positions
    for frames in (1, 2, 3, 5, 17):
        pieces = [codec.motion(piece, 20.0).positions for piece in scores.split(frames)]
        np.testing.assert_array_equal(np.concatenate(pieces), whole)
    assert len(codec.motion(scores[:0], 20.0)) == 0


def test_a_state_is_enough_and_a_new_one_can_be_tried_out():
    moved = rotations()
    codec, other = (
        fitted(3, moved),
        PrincipalComponentCodec(ExponentialMapCodec(SKELETON, JOINTS), 3),
    )
    np.testing.assert_array_equal(other.encode(moved), other.features.encode(moved)[:, :3].numpy())
    other.load_state_dict(codec.state_dict())
    torch.testing.assert_close(other.encode(moved), codec.encode(moved), atol=0, rtol=0)


def test_motion_that_does_not_move_keeps_all_of_nothing():
    still = rotations()[:1].expand(20, -1, -1)
    codec = fitted(2, still)
    assert codec.variance_kept == 1
    np.testing.assert_allclose(codec.encode(still), 0, atol=1e-6)


@pytest.mark.parametrize("count", [0, 10])
def test_more_components_than_features_are_refused(count):
    with pytest.raises(ValueError, match="9 features have 1 to 9 components"):
        PrincipalComponentCodec(ExponentialMapCodec(SKELETON, JOINTS), count)
