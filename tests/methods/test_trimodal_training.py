"""What each step of the trimodal training may move, and what its loss is made of."""

import pytest
import torch

from cospeech.corpus.batch import GestureBatch
from cospeech.errors import ConfigError, InputFileError
from tests.scripted_trimodal import WEIGHTS, Scripted, facts, train


def small(**arguments) -> Scripted:
    torch.manual_seed(0)
    sizes = {"hidden_size": 8, "layers": 1, "style_size": 4}
    return Scripted(corpus=facts(20, 3), **sizes, **arguments)


def small_batch() -> GestureBatch:
    torch.manual_seed(1)
    return GestureBatch(
        window_ids=torch.arange(4),
        positions=torch.randn(4, 34, 10, 3),
        audio=torch.randn(4, 36_267),
        words=torch.randint(20, (4, 34)),
        speakers=torch.tensor([1, 2, 3, 1]),
    )


def moved(method: Scripted, epoch: int) -> set[str]:
    """Which networks one step at ``epoch`` moved."""
    before = {name: p.detach().clone() for name, p in method.named_parameters()}
    method.epochs = (epoch,)
    train(method, small_batch(), steps=1)
    return {
        name.split(".")[0]
        for name, parameter in method.named_parameters()
        if not torch.equal(before[name], parameter)
    }


def test_each_step_moves_its_own_network():
    assert moved(small(), epoch=10) == {"generator"}
    assert moved(small(), epoch=11) == {"generator", "adversary"}
    assert moved(small(learning_rate=0.0), epoch=11) == {"adversary"}
    assert moved(small(discriminator_learning_rate=0.0), epoch=11) == {"generator"}


def test_discriminator_gradients_are_those_of_its_own_loss_alone():
    method = small(adversarial_weight=1e6, discriminator_learning_rate=0.0, learning_rate=0.0)
    method.epochs = (11,)
    train(method, small_batch(), steps=1)
    gradients = [p.grad.clone() for p in method.adversary.parameters()]
    without = small(adversarial_weight=0.0, discriminator_learning_rate=0.0, learning_rate=0.0)
    without.epochs = (11,)
    train(without, small_batch(), steps=1)
    for ours, reference in zip(gradients, without.adversary.parameters(), strict=True):
        torch.testing.assert_close(ours, reference.grad)


def test_warm_up_logs_the_adversarial_loss_without_training_the_discriminator():
    method = small()
    method.epochs = (10, 11)
    train(method, small_batch(), steps=2)
    assert "train/discriminator" not in method.steps[0]
    assert method.steps[0]["train/adversarial"] > 0
    assert "train/discriminator" in method.steps[1]


def test_warm_up_moves_the_discriminators_running_statistics():
    method = small()
    moved(method, epoch=0)
    assert method.adversary.discriminator.pre_conv[1].num_batches_tracked == 1


@pytest.mark.parametrize("epoch", [0, 11])
@pytest.mark.parametrize(
    ("arguments", "terms"),
    [
        ({}, {"huber", "kld", "diversity", "adversarial"}),
        ({"diversity_weight": 0.0}, {"huber", "adversarial"}),
        ({"kld_weight": 0.0}, {"huber", "diversity", "adversarial"}),
        ({"adversarial_weight": 0.0}, {"huber", "kld", "diversity"}),
        ({"style": "random"}, {"huber", "diversity", "adversarial"}),
        ({"style": "none"}, {"huber", "adversarial"}),
    ],
)
def test_the_loss_is_the_sum_of_the_terms_that_are_on(arguments, terms, epoch):
    method = small(**arguments)
    method.epochs = (epoch,)
    train(method, small_batch(), steps=1)
    log = method.steps[0]
    if epoch < 11:
        terms = terms - {"adversarial"}
    total = sum(WEIGHTS[name] * log[f"train/{name}"] for name in terms)
    assert log["train/loss"] == pytest.approx(total, rel=1e-5)


def test_a_loss_with_weight_0_is_still_logged():
    method = small(diversity_weight=0.0, adversarial_weight=0.0, kld_weight=0.0)
    assert moved(method, epoch=11) == {"generator", "adversary"}
    assert {f"train/{name}" for name in WEIGHTS} < set(method.steps[0])
    assert method.steps[0]["train/diversity"] != 0


def test_the_second_style_shares_everything_but_the_style():
    method = small(dropout=0.0, embedding_dropout=0.0)
    method._permutation = torch.arange
    method.epochs = (0,)
    train(method, small_batch(), steps=1)
    # Same speakers, no noise, no dropout: the second decoding is the first one again.
    assert method.steps[0]["train/diversity"] == 0


def test_word_embedding_settings():
    assert small().generator.text_encoder.embedding.weight.std().item() == pytest.approx(
        300**-0.5, rel=0.05
    )
    scratch = small(word_embedding="scratch").generator.text_encoder.embedding.weight
    assert scratch.std().item() == pytest.approx(1.0, rel=0.05)
    frozen = small(word_embedding="frozen")
    before = frozen.generator.text_encoder.embedding.weight.clone()
    assert moved(frozen, epoch=0) == {"generator"}
    assert torch.equal(before, frozen.generator.text_encoder.embedding.weight)


def test_word_vectors_are_read_when_training_starts(tmp_path):
    path = tmp_path / "tiny.vec"
    path.write_text("1 300\nword0 " + " ".join(["0.5"] * 300) + "\n")
    method = small(word_vectors=str(path), word_embedding="frozen")
    assert not method.generator.text_encoder.embedding.weight[4].eq(0.5).any()
    train(method, small_batch(), steps=1)
    assert method.generator.text_encoder.embedding.weight[4].eq(0.5).all()


def test_frozen_random_vectors_are_pointed_out(caplog):
    with caplog.at_level("WARNING"):
        train(small(word_embedding="frozen"), small_batch(), steps=1)
    assert "random vectors stay random" in caplog.text


def test_word_vectors_of_another_size_are_refused(tmp_path):
    path = tmp_path / "tiny.vec"
    path.write_text("1 2\nword0 0.5 0.5\n")
    with pytest.raises(InputFileError, match="vectors of 2 numbers, the method uses 300"):
        train(small(word_vectors=str(path)), small_batch(), steps=1)


@pytest.mark.parametrize("arguments", [{"context": "video"}, {"style": "x"}])
def test_unknown_choices_are_refused(arguments):
    with pytest.raises(ConfigError, match="is not one of"):
        small(**arguments)


def test_vectors_for_an_embedding_from_scratch_are_refused():
    with pytest.raises(ConfigError, match="starts from no vectors"):
        small(word_embedding="scratch", word_vectors="crawl.bin")


@pytest.mark.slow
def test_it_learns_four_windows_by_heart():
    method = small(learning_rate=5e-3, dropout=0.0, embedding_dropout=0.0)
    method.epochs = (0,)
    batch = small_batch()
    smooth = torch.cumsum(0.05 * torch.randn(4, 34, 10, 3), dim=1) + torch.randn(4, 1, 10, 3)
    train(method, batch.having(positions=smooth), steps=150)
    first, last = method.steps[0]["train/huber"], method.steps[-1]["train/huber"]
    assert last < first / 4
