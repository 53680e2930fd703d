"""The trimodal networks: sizes, receptive fields, and what each input reaches."""

import numpy as np
import pytest
import torch

from cospeech.methods.trimodal.encoders import AudioEncoder, TextEncoder, WeightNormConv1d
from cospeech.methods.trimodal.networks import ConvDiscriminator, Generator, Posterior


def count(module: torch.nn.Module) -> int:
    return sum(parameter.numel() for parameter in module.parameters())


def small_generator(**arguments) -> Generator:
    torch.manual_seed(0)
    sizes = {"word_size": 6, "style_size": 4, "hidden_size": 8, "layers": 2} | arguments
    return Generator(12, 3, **sizes).eval()


def small_inputs() -> tuple[torch.Tensor, ...]:
    torch.manual_seed(1)
    seeds = torch.zeros(2, 34, 28)
    seeds[:, :4] = torch.randn(2, 4, 28)
    words = torch.randint(12, (2, 34))
    return seeds, words, torch.randn(2, 36_267), torch.tensor([1, 2])


def test_parameter_counts_are_the_measured_ones():
    generator = Generator(50, 5)
    words = count(generator.text_encoder.embedding)
    speakers = count(generator.speaker_embedding[0])
    assert count(generator.audio_encoder) == 69_728
    assert count(generator.text_encoder) - words == 1_454_432
    assert count(generator) - words - speakers == 7_183_003
    assert count(ConvDiscriminator()) == 253_950


def test_text_features_see_31_frames_up_to_their_own():
    torch.manual_seed(0)
    encoder = TextEncoder(9, 6, width=8, blocks=4, dropout=0.0, embedding_dropout=0.0).eval()
    words = torch.randint(9, (1, 34))
    for frame, visible in ((33, range(3, 34)), (10, range(11))):
        seen = set()
        for changed in range(34):
            other = words.clone()
            other[0, changed] = (other[0, changed] + 1) % 9
            with torch.no_grad():
                difference = (encoder(other) - encoder(words))[0, frame].abs().max()
            if difference > 0:
                seen.add(changed)
        assert seen == set(visible)


def test_audio_features_see_3025_samples_every_1080():
    encoder = AudioEncoder().eval()
    audio = torch.randn(1, 36_267, requires_grad=True)
    for frame in (5, 20):
        gradient = torch.autograd.grad(encoder(audio)[0, frame].sum(), audio)[0][0]
        seen = gradient.nonzero().flatten()
        assert seen[0] == 1080 * frame - 1600
        assert seen[-1] == 1080 * frame + 1424
        assert seen[-1] - seen[0] + 1 == 3025


@pytest.mark.parametrize(
    ("samples", "frames"), [(35_464, 33), (35_465, 34), (36_266, 34), (36_544, 34), (36_545, 35)]
)
def test_audio_lengths_that_give_34_frames(samples, frames):
    with torch.no_grad():
        assert AudioEncoder().eval()(torch.zeros(1, samples)).shape == (1, frames, 32)


def test_weight_norm_by_hand():
    layer = WeightNormConv1d(1, 1, kernel=2, dilation=2)
    with torch.no_grad():
        layer.weight_v.copy_(torch.tensor([[[3.0, 4.0]]]))
        layer.weight_g.fill_(10.0)
        layer.bias.fill_(1.0)
    # weight = 10 * (3, 4) / 5 = (6, 8): y_t = 6 x_{t-2} + 8 x_t + 1
    y = layer(torch.tensor([[[1.0, 0.0, 2.0, 1.0]]]))
    assert y.flatten().tolist() == pytest.approx([9.0, 1.0, 23.0, 9.0])


def test_weight_norm_starts_as_torch_initialises_a_convolution():
    torch.manual_seed(0)
    layer = WeightNormConv1d(300, 300, kernel=2, dilation=1)
    torch.testing.assert_close(
        layer.weight_g.flatten(), layer.weight_v.detach().flatten(1).norm(dim=1)
    )
    assert layer.weight_v.std().item() == pytest.approx(0.0236, abs=2e-4)


def test_noise_scales_with_the_standard_deviation():
    posterior = Posterior(torch.tensor([[1.0, 2.0]]), torch.tensor([[0.0, np.log(4.0)]]))
    assert posterior.sample(None).tolist() == [[1.0, 2.0]]
    assert posterior.sample(torch.tensor([[1.0, -1.0]]))[0].tolist() == pytest.approx([2.0, 0.0])


def test_the_same_noise_gives_the_same_poses_and_other_noise_others():
    generator, x = small_generator(), small_inputs()
    noise = torch.randn(2, 4)
    first = generator(*x, style_noise=noise).poses
    assert torch.equal(first, generator(*x, style_noise=noise).poses)
    assert not torch.equal(first, generator(*x, style_noise=-noise).poses)


@pytest.mark.parametrize(
    ("context", "style", "size"),
    [
        ("both", "speaker", 108),
        ("both", "none", 92),
        ("audio", "speaker", 76),
        ("text", "random", 76),
        ("text", "none", 60),
    ],
)
def test_recurrent_input_sizes(context, style, size):
    assert Generator(9, 2, context=context, style=style).gru.input_size == size


def test_random_style_is_the_noise_itself():
    generator, x = small_generator(style="random"), small_inputs()
    noise = torch.randn(2, 4)
    output = generator(*x, style_noise=noise)
    assert torch.equal(output.z, noise)
    assert output.mu is None
    assert torch.equal(generator(*x).z, torch.zeros(2, 4))


def test_without_style_the_speaker_changes_nothing():
    generator, x = small_generator(style="none"), small_inputs()
    output = generator(*x)
    assert output.z is None
    assert torch.equal(output.poses, generator(*x[:3], torch.tensor([3, 3])).poses)


@pytest.mark.parametrize(
    ("context", "changes"), [("audio", (False, True)), ("text", (True, False))]
)
def test_one_modality_ignores_the_other(context, changes):
    generator, (seeds, words, audio, speakers) = small_generator(context=context), small_inputs()
    poses = generator(seeds, words, audio, speakers).poses
    other_words = generator(seeds, (words + 1) % 12, audio, speakers).poses
    other_audio = generator(seeds, words, -audio, speakers).poses
    assert (not torch.equal(poses, other_words), not torch.equal(poses, other_audio)) == changes


def test_published_heads_are_affine_and_corrected_ones_are_not():
    a, b = torch.randn(5, 8), torch.randn(5, 8)
    for corrected in (False, True):
        head = small_generator(corrected_activations=corrected).out
        middle = (head(a) + head(b)) / 2
        assert torch.allclose(head((a + b) / 2), middle, atol=1e-6) is not corrected
        names = set(small_generator(corrected_activations=corrected).state_dict())
        assert names == set(small_generator().state_dict())
    assert isinstance(ConvDiscriminator(corrected_activations=True).pre_conv[2], torch.nn.LeakyReLU)


def test_one_pass_counted_three_times_moves_the_statistics_like_three_passes():
    torch.manual_seed(0)
    audio = torch.randn(2, 36_267)
    once, thrice = AudioEncoder(), AudioEncoder()
    thrice.load_state_dict(once.state_dict())
    once.count_passes(3)
    once(audio)
    for _ in range(3):
        thrice(audio)
    for ours, theirs in zip(once.buffers(), thrice.buffers(), strict=True):
        if ours.is_floating_point():
            torch.testing.assert_close(ours, theirs)
