"""Gesticulator's network, history and training against the published ones."""

import numpy as np
import pytest
import torch

from cospeech.methods.gesticulator.losses import pose_loss, velocity_loss
from cospeech.methods.gesticulator.networks import AHEAD, PAST, GesticulatorNetwork
from cospeech.methods.gesticulator.published import from_published, our_name
from cospeech.methods.gesticulator.schedule import History, history_of_epoch
from tests.parity import formulas

FRAMES = 40
NETWORKS = {45: "no_pca_45", 12: "pca_12"}
OWN = history_of_epoch(100, "own", PAST, FRAMES)
EPOCHS = (0, 7, 8, 9, 11)


def released(epoch):
    return history_of_epoch(epoch, "released", PAST, FRAMES)


def network_of(size, dtype=torch.float32):
    network = GesticulatorNetwork(837, size, dropout=0, conditioning_dropout=0)
    network.load_state_dict(from_published(formulas.gesticulator_weights(NETWORKS[size])))
    return network.to(dtype)


class Clips:
    """The published batch, and what the network makes of it."""

    def __init__(self, size, dtype=torch.float32):
        inputs = formulas.gesticulator_inputs(size)
        self.speech, self.poses, mean = (values.to(dtype) for values in inputs)
        self.start = mean.expand(4, 3, -1)
        self.truth = self.poses[:, PAST : PAST + FRAMES]

    def roll(self, network, history: History):
        said = network.encode(self.speech[:, : PAST + FRAMES + AHEAD])
        known = self.poses[:, PAST - 2 : PAST + FRAMES]
        return network.roll(said, self.start, known, history.is_reset, history.is_conditioned)


@pytest.mark.parametrize("size", NETWORKS)
@pytest.mark.parametrize(
    ("entry", "history"),
    [
        ("no_conditioning", released(0)),
        ("teacher_forcing", released(9)),
        ("autoregressive", OWN),
        ("freq8", released(7)),
        ("freq4", released(8)),
    ],
)
def test_poses_are_the_published_ones(size, entry, history):
    with torch.no_grad():
        poses = Clips(size).roll(network_of(size), history)
    published = formulas.expected("gesticulator")[f"out{size}_{entry}"]
    np.testing.assert_allclose(poses, published, atol=1e-5, rtol=0)


@pytest.mark.parametrize("size", NETWORKS)
def test_five_steps_give_the_published_losses_gradients_and_network(size):
    expected = formulas.expected("gesticulator")
    network, clips = network_of(size, torch.float64), Clips(size, torch.float64)
    with torch.no_grad():
        found = velocity_loss(clips.roll(network, OWN), clips.truth)
    assert found.item() == pytest.approx(expected[f"validation_loss{size}"], rel=1e-6)
    published = list(formulas.gesticulator_weights(NETWORKS[size]))
    optimizer = torch.optim.Adam(network.parameters(), 1e-4)
    for step, epoch in enumerate(EPOCHS):
        poses = clips.roll(network, released(epoch))
        pose = pose_loss(poses, clips.truth)
        velocity = 0.6 * velocity_loss(poses, clips.truth)
        across = velocity_loss(poses, clips.truth, "batch")
        optimizer.zero_grad()
        (pose + velocity).backward()
        losses = [loss.item() for loss in (pose, velocity, pose + velocity, across)]
        np.testing.assert_allclose(
            losses, expected[f"training_losses{size}"][step], rtol=1e-6, atol=0
        )
        gradients = dict(network.named_parameters())
        norms = [
            np.nan
            if name is None or gradients[name].grad is None
            else gradients[name].grad.norm().item()
            for name in map(our_name, published)
        ]
        np.testing.assert_allclose(norms, expected[f"training_grad_norms{size}"][step], rtol=1e-4)
        optimizer.step()
    with torch.no_grad():
        poses = clips.roll(network, OWN)
    after = expected[f"after_training{size}_autoregressive"]
    np.testing.assert_allclose(poses, after, atol=1e-5, rtol=0)


def test_what_a_pose_is_conditioned_on_is_the_published_history():
    """Of a network that puts out numbers that say whose pose it is."""
    expected = formulas.expected("gesticulator")
    truth = 1000 + torch.arange(PAST - 2, PAST + FRAMES).float()[None, :, None]
    for epoch, slots in zip(expected["history_epochs"], expected["history"], strict=True):
        seen = []

        class Telling(GesticulatorNetwork):
            def pose(self, said, history, seen=seen):
                seen.append(history[0, :, 0].tolist())
                return torch.full((1, 1), 2000.0 + PAST + len(seen) - 1)

        # In the first epochs nothing is looked at; the published table was made as if it were.
        resets = released(epoch).is_reset if epoch else torch.arange(PAST, 50) % 16 < 2
        Telling(4, 1).roll(torch.zeros(1, FRAMES, 256), torch.zeros(1, 3, 1), truth, resets)
        np.testing.assert_array_equal(seen, slots)


def test_the_papers_schedule_goes_from_recorded_poses_to_its_own():
    own = [(~history_of_epoch(e, "paper", 0, 32).is_reset).sum().item() for e in range(7, 14)]
    assert own == [0, 4, 8, 16, 32, 32, 32]
    assert not history_of_epoch(6, "paper", 0, 32).is_conditioned
    assert history_of_epoch(8, "paper", 10, 40).is_reset.nonzero()[:8, 0].tolist() == [
        *range(6),
        8,
        9,
    ]
