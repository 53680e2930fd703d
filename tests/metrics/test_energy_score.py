"""The energy score by hand, and that only the true distribution has none."""

import pytest
import torch

from cospeech.metrics.energy_score import energy_score, motion_distance


def at(*places):
    """Motions of one window, two frames and one joint, at places on a line in metres."""
    motions = torch.zeros(len(places), 1, 2, 1, 3)
    motions[..., 0] = torch.tensor(places, dtype=torch.float32)[:, None, None, None]
    return motions


def test_distance_is_the_root_mean_square_over_frames_and_joints():
    first, second = torch.zeros(2, 2, 3), torch.zeros(2, 2, 3)
    second[0, 0] = torch.tensor([3.0, 4.0, 0.0])  # one of four is 5 away
    second[1, 1] = torch.tensor([0.0, 0.0, 1.0])
    assert motion_distance(first, second).item() == pytest.approx(((25 + 1) / 4) ** 0.5)


def test_by_hand():
    # |X - Y|: 1, 3, 1, 1, of X 0 and 2, of Y 1 and 3; |X - X'| 2; |Y - Y'| 2
    assert energy_score(at(0, 2), at(1, 3)).item() == pytest.approx(6 / 4 - 1 - 1)
    # One motion is made again; one true motion leaves its spread out.
    assert energy_score(at(2), at(1, 3)).item() == pytest.approx(1 - 0 - 1)
    assert energy_score(at(0, 2), at(3)).item() == pytest.approx(2 - 1)
    assert energy_score(at(2), at(3)).item() == pytest.approx(1)


def test_windows_are_scored_by_themselves():
    made, real = torch.cat([at(0, 2), at(2, 5)], 1), torch.cat([at(1, 3), at(2, 2)], 1)
    alone = [energy_score(made[:, i : i + 1], real[:, i : i + 1]) for i in range(2)]
    torch.testing.assert_close(energy_score(made, real), torch.cat(alone))


def drawn(generator, scale=1.0, shift=0.0, motions=5, windows=4000):
    moves = torch.randn(motions, windows, 1, 2, 3, generator=generator)
    return scale * moves + shift


def test_only_the_true_distribution_has_none():
    generator = torch.Generator().manual_seed(0)
    real = drawn(generator)
    scores = {
        "true": energy_score(drawn(generator), real),
        "wide": energy_score(drawn(generator, scale=1.4), real),
        "narrow": energy_score(drawn(generator, scale=0.7), real),
        "shifted": energy_score(drawn(generator, shift=0.3), real),
        "mean": energy_score(torch.zeros(1, 4000, 1, 2, 3), real),
        "one of them again": energy_score(
            drawn(generator, motions=1).expand(5, -1, -1, -1, -1), real
        ),
    }
    error = {name: (each.std() / len(each) ** 0.5).item() for name, each in scores.items()}
    mean = {name: each.mean().item() for name, each in scores.items()}
    assert abs(mean.pop("true")) < 4 * error.pop("true")
    for name, value in mean.items():
        assert value > 8 * error[name], name
    assert mean["mean"] > mean["narrow"]
