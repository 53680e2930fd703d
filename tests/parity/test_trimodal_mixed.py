"""The trimodal networks, their training and the pose auto-encoder against the published ones."""

from dataclasses import dataclass

import numpy as np
import pytest
import torch
from torch import nn

from cospeech.corpus.batch import GestureBatch
from cospeech.methods.trimodal import import_published, import_published_discriminator
from cospeech.methods.trimodal.networks import ConvDiscriminator, Generator
from cospeech.metrics import encoder
from cospeech.metrics.encoder import PoseAutoencoder
from tests.parity import formulas
from tests.parity.formulas import SPEAKERS, WORDS, fill, inputs
from tests.scripted_trimodal import WEIGHTS, Scripted, facts, train

NETWORKS = {
    "generator_both": lambda: Generator(WORDS, SPEAKERS),
    "generator_audio": lambda: Generator(WORDS, SPEAKERS, context="audio"),
    "generator_text": lambda: Generator(WORDS, SPEAKERS, context="text"),
    "discriminator": ConvDiscriminator,
    "fgd_autoencoder": PoseAutoencoder,
}
GENERATORS = tuple(name for name in NETWORKS if name.startswith("generator"))


def published(entry: str) -> np.ndarray:
    return formulas.expected("trimodal_mixed")[entry]


def assert_published(entry: str, ours: torch.Tensor, atol: float = 5e-6) -> None:
    np.testing.assert_allclose(ours.detach().numpy(), published(entry), atol=atol, rtol=0)


def arguments() -> tuple[torch.Tensor, ...]:
    x = inputs()
    return x["seed_poses"], x["words"], x["audio"], x["speakers"]


def published_state(network: str) -> dict[str, torch.Tensor]:
    """A state dict as a published checkpoint holds it."""
    shapes = formulas.published_shapes("trimodal_mixed", network)
    state = fill({name: torch.zeros(shape) for name, shape in shapes.items()})
    for name in list(state):
        # `net.0` and `net.4` are the same tensors as `conv1` and `conv2` in a real network.
        for alias, own in (("net.0", "conv1"), ("net.4", "conv2")):
            if alias in name:
                state[name.replace(alias, own)] = state[name]
    return state


@pytest.mark.parametrize("network", NETWORKS)
def test_tensors_are_the_published_ones_in_order(network):
    ours = {name: tuple(t.shape) for name, t in NETWORKS[network]().state_dict().items()}
    assert list(ours.items()) == list(formulas.published_shapes("trimodal_mixed", network).items())


@pytest.mark.parametrize("network", GENERATORS)
@torch.no_grad()
def test_generator_output_is_the_published_one(network):
    output = fill(NETWORKS[network]()).eval()(*arguments())
    assert_published(f"{network}_out", output.poses)
    assert_published(f"{network}_mu", output.mu)
    assert_published(f"{network}_logvar", output.logvar)


@torch.no_grad()
def test_encoder_features_are_the_published_ones():
    generator = fill(Generator(WORDS, SPEAKERS)).eval()
    x = inputs()
    assert_published("audio_features", generator.audio_encoder(x["audio"]))
    assert_published("text_features", generator.text_encoder(x["words"]))


@torch.no_grad()
def test_a_published_checkpoint_gives_the_published_output():
    generator = import_published(published_state("generator_both"))
    assert not generator.training
    assert_published("generator_both_out", generator(*arguments()).poses)
    discriminator = import_published_discriminator(published_state("discriminator"))
    assert_published("discriminator_out", discriminator(inputs()["poses"]))


@torch.no_grad()
def test_features_and_reconstruction_are_the_published_ones():
    frozen = encoder.import_published(fill(PoseAutoencoder()).state_dict())
    poses = inputs()["poses"]
    assert_published("fgd_features", frozen(poses))
    assert_published("fgd_reconstruction", frozen.network(poses))


@torch.no_grad()
def test_weights_and_inputs_of_another_v_are_noticed():
    """Neither alone would pass for the other: outputs move by far more than the tolerance."""
    other = formulas.V + 1
    for weights, poses in ((formulas.V, other), (other, formulas.V)):
        discriminator = fill(ConvDiscriminator(), weights).eval()
        output = discriminator(inputs(poses)["poses"]).numpy()
        assert np.abs(output - published("discriminator_out")).max() > 1e-2


class FeatureCodec(nn.Module):
    """The poses are features that no skeleton has; they pass through as they are."""

    def encode(self, positions: torch.Tensor) -> torch.Tensor:
        return positions


@dataclass(frozen=True)
class Trained:
    """Five iterations in one precision, and how far its rounding may take them."""

    method: Scripted
    losses_rtol: float
    poses_atol: float


@pytest.fixture(
    scope="module",
    params=[
        pytest.param((torch.float32, 2e-5, 5e-4), id="float32"),
        pytest.param((torch.float64, 1e-9, 1e-5), id="float64", marks=pytest.mark.slow),
    ],
)
def trained(request):
    dtype, losses_rtol, poses_atol = request.param
    method = Scripted(corpus=facts(WORDS, SPEAKERS), dropout=0.0, embedding_dropout=0.0)
    method.codec = FeatureCodec()
    fill(method.generator)
    fill(method.adversary.discriminator)
    x = inputs()
    batch = GestureBatch(
        window_ids=torch.arange(formulas.BATCH),
        positions=x["poses"].to(dtype),
        audio=x["audio"].to(dtype),
        words=x["words"],
        speakers=x["speakers"],
    )
    usual = torch.get_default_dtype()
    torch.set_default_dtype(dtype)
    try:
        train(method.to(dtype), batch, steps=5)
    finally:
        torch.set_default_dtype(usual)
    return Trained(method.float().train(), losses_rtol, poses_atol)


def test_five_iterations_give_the_published_losses(trained):
    published_losses = published("training_losses")
    for step, row in zip(trained.method.steps, published_losses, strict=True):
        for (name, weight), value in zip(WEIGHTS.items(), row, strict=True):
            if not np.isnan(value):  # what the published code doesn't compute may be logged
                ours = weight * step[f"train/{name}"]
                assert ours == pytest.approx(value, rel=trained.losses_rtol, abs=0)


@torch.no_grad()
def test_the_networks_after_training_are_the_published_ones(trained):
    generator, adversary = trained.method.generator, trained.method.adversary
    poses = generator(*arguments()).poses
    assert_published("generator_after_training_out", poses, trained.poses_atol)
    scores = adversary.discriminator(inputs()["poses"])
    assert_published("discriminator_after_training_out", scores, 5e-6)
