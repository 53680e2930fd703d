"""Transcripts at synthesis: case, unheard words, and life without the fastText file."""

import logging

import numpy as np
import pytest
import torch
from lightning import Trainer

from cospeech.errors import InputFileError
from cospeech.methods.trimodal import Trimodal
from cospeech.methods.trimodal.words import WordVectorFile, encode_words
from cospeech.speech.speech import Speech, Word
from cospeech.speech.vocabulary import UNK, Vocabulary
from cospeech.speech.word_vectors import find_word_vectors
from tests.fabricated.fasttext import write_random_model

FACTS = {
    "words": ["<PAD>", "<SOS>", "<EOS>", "<UNK>", "hello", "world", "again"],
    "speakers": ["ann", "bob"],
    "mean_direction": [0.1 * i for i in range(27)],
    "bone_lengths": [0.26, 0.18, 0.14, 0.22, 0.36, 0.33, 0.22, 0.36, 0.33],
}
VOCABULARY = Vocabulary(FACTS["words"])
UNHEARD = 7  # the first id beyond the vocabulary


def spoken(*texts: str) -> tuple[Word, ...]:
    return tuple(Word(text, 0.5 * i, 0.5 * i + 0.4) for i, text in enumerate(texts))


def said(*texts: str) -> Speech:
    samples = np.random.default_rng(0).standard_normal(48_000)
    return Speech((0.1 * samples).astype(np.float32), spoken(*texts))


@pytest.fixture
def model_file(tmp_path):
    return write_random_model(tmp_path / "crawl.bin", ["</s>", "hello", "world", "again", "Hello"])


def method(**arguments) -> Trimodal:
    torch.manual_seed(0)
    made = Trimodal(FACTS, hidden_size=8, layers=1, style_size=4, mean_style=True, **arguments)
    # Fresh weights give words too small an influence to be told apart in float32.
    torch.nn.init.normal_(made.generator.text_encoder.decoder.weight, 0, 1)
    return made


def trained(model: Trimodal) -> Trimodal:
    """Word vectors are read as they are at the start of a training."""
    model.trainer = Trainer(accelerator="cpu", logger=False, enable_checkpointing=False)
    model.setup("fit")
    return model


def saved(model: Trimodal, path) -> None:
    model.trainer.strategy.connect(model)
    model.trainer.save_checkpoint(path)


def motion(model: Trimodal, *texts: str) -> np.ndarray:
    return model.generate(said(*texts), "bob").positions


def test_case_is_folded_or_kept_as_published(caplog):
    words = spoken("Hello,", "world.")
    folded = encode_words(words, VOCABULARY, None, fold_case=True)
    assert folded.ids.tolist() == [4, 5]
    assert not caplog.records
    published = encode_words(words, VOCABULARY, None, fold_case=False)
    assert published.ids.tolist() == [UNK, 5]
    assert "1 distinct words are not in the vocabulary: Hello; they share" in caplog.text


def test_words_without_letters_are_dropped_as_in_a_corpus():
    encoded = encode_words(spoken("hello", "--", "world"), VOCABULARY, None, fold_case=True)
    assert encoded.ids.tolist() == [4, 5]
    assert encoded.starts.tolist() == [0.0, 1.0]
    assert encoded.ends.tolist() == [0.4, 1.4]
    published = encode_words(spoken("hello", "--"), VOCABULARY, None, fold_case=False)
    assert published.ids.tolist() == [4, UNK]


def test_unheard_words_get_ids_beyond_the_vocabulary_with_their_vectors(model_file, caplog):
    words = spoken("zebra", "hello", "Apple", "zebra")
    with caplog.at_level(logging.INFO):
        encoded = encode_words(words, VOCABULARY, WordVectorFile(model_file, 300), fold_case=True)
    assert encoded.ids.tolist() == [UNHEARD + 1, 4, UNHEARD, UNHEARD + 1]
    _, expected = find_word_vectors(model_file, ["apple", "zebra"])
    np.testing.assert_array_equal(
        encoded.extra_vectors, np.stack([expected["apple"], expected["zebra"]])
    )
    assert [record.levelname for record in caplog.records] == ["INFO"]
    assert "2 distinct words are not in the vocabulary: apple, zebra; 2 have" in caplog.text


def test_a_word_vector_file_is_read_once_per_word(model_file):
    file = WordVectorFile(model_file, 300)
    first = file.find(["zebra", "apple"])
    model_file.unlink()
    again = file.find(["apple"])
    np.testing.assert_array_equal(again["apple"], first["apple"])
    assert file.find(["pear"]) == {}


def test_words_that_a_text_file_lacks_stay_unknown(tmp_path, caplog):
    path = tmp_path / "crawl.vec"
    path.write_text("1 300\nzebra " + " ".join(["0.5"] * 300) + "\n")
    words = spoken("zebra", "apple", "hello")
    encoded = encode_words(words, VOCABULARY, WordVectorFile(path, 300), fold_case=True)
    assert encoded.ids.tolist() == [UNHEARD, UNK, 4]
    assert "1 have vectors in" in caplog.text
    assert "crawl.vec, 1 share the unknown word's" in caplog.text


def test_vectors_of_another_size_are_refused(tmp_path):
    path = write_random_model(tmp_path / "small.bin", ["hello"], dimensions=2)
    with pytest.raises(InputFileError, match="vectors of 2 numbers, the method uses 300"):
        motion(method(word_vectors=str(path)), "zebra")


def test_an_unheard_word_moves_as_if_its_vector_were_in_the_table(model_file):
    """Against a second model whose table holds the word in the place of another."""
    model = trained(method(word_vectors=str(model_file)))
    table = trained(method(word_vectors=str(model_file)))
    with torch.no_grad():
        _, found = find_word_vectors(model_file, ["zebra"])
        table.generator.text_encoder.embedding.weight[6] = torch.from_numpy(found["zebra"])
    np.testing.assert_array_equal(
        motion(model, "hello", "zebra", "world"), motion(table, "hello", "again", "world")
    )
    assert not np.array_equal(
        motion(model, "hello", "zebra", "world"), motion(model, "hello", "giraffe", "world")
    )


def test_published_synthesis_gives_all_unheard_words_the_unknown_one(model_file):
    model = trained(method(word_vectors=str(model_file), subwords=False, fold_case=False))
    np.testing.assert_array_equal(motion(model, "zebra"), motion(model, "giraffe"))
    np.testing.assert_array_equal(motion(model, "zebra"), motion(model, "Hello"))
    folding = trained(method(word_vectors=str(model_file)))
    np.testing.assert_array_equal(motion(folding, "hello"), motion(folding, "Hello"))


def test_the_checkpoint_generates_without_the_file(model_file, tmp_path, caplog):
    model = trained(method(word_vectors=str(model_file)))
    known, unheard = motion(model, "Hello", "world"), motion(model, "Hello", "zebra")
    saved(model, tmp_path / "trimodal.ckpt")
    moved = model_file.rename(tmp_path / "moved.bin")

    loaded = Trimodal.load_from_checkpoint(tmp_path / "trimodal.ckpt", weights_only=True)
    np.testing.assert_array_equal(motion(loaded, "Hello", "world"), known)
    caplog.clear()
    without = motion(loaded, "Hello", "zebra", "giraffe", "zebra")
    assert "2 distinct words are not in the vocabulary: giraffe, zebra; 0 have" in caplog.text
    assert "(no such file now)" in caplog.text
    assert len(caplog.records) == 1
    np.testing.assert_array_equal(without, motion(loaded, "Hello", "giraffe", "zebra", "pear"))

    named = Trimodal.load_from_checkpoint(
        tmp_path / "trimodal.ckpt", weights_only=True, word_vectors=str(moved)
    )
    np.testing.assert_array_equal(motion(named, "Hello", "zebra"), unheard)


def test_unheard_words_leave_the_weights_as_they_were(model_file):
    model = trained(method(word_vectors=str(model_file)))
    before = {key: value.clone() for key, value in model.state_dict().items()}
    motion(model, "zebra", "hello")
    after = model.state_dict()
    assert list(after) == list(before)
    assert all(torch.equal(after[key], value) for key, value in before.items())


def test_no_file_is_read_where_words_are_not_used(tmp_path):
    path = tmp_path / "broken.bin"
    path.write_bytes(b"\x80\x04pickle")
    motion(method(word_vectors=str(path), context="audio"), "zebra")
    motion(method(word_vectors=str(path)), "hello")
    with pytest.raises(InputFileError, match="does not begin with a word count"):
        motion(method(word_vectors=str(path)), "zebra")
