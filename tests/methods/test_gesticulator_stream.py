"""What a stream of Gesticulator's waits for: words of their own, or sentences."""

import math

import numpy as np
import pytest
import torch

from cospeech.corpus.features.field import SpeechField
from cospeech.corpus.features.spoken_words import SpokenWordsStream, spoken_words
from cospeech.corpus.features.streaming import open_rows
from cospeech.corpus.synthetic.body import SKELETON
from cospeech.methods.gesticulator import Gesticulator
from cospeech.speech.speech import SAMPLE_RATE, Speech, Word
from cospeech.speech.text.vectors import StaticVectors

FPS = 20.0
SAID = "so it grew like mad. and eh then nothing came! we all sat down likes"
TEXTS = SAID.split()
STARTS = 0.31 + 0.43 * np.arange(len(TEXTS))
WORDS = tuple(Word(text, s, s + 0.36) for text, s in zip(TEXTS, STARTS.tolist(), strict=True))
SECONDS = 8.0


class OfSentences:
    """A vector is of its word and of the whole list that the word is given in."""

    version, dimensions = "of sentences", 4

    def __init__(self):
        self.read = []

    def vectors(self, words):
        texts = [word.text for word in words]
        self.read.append(" ".join(texts))
        seed = list(self.read[-1].encode())
        return np.random.default_rng(seed).random((len(texts), 4)).astype(np.float32)


class OfWords(OfSentences):
    reads = "word"

    def vectors(self, words):
        of = [np.random.default_rng(list(w.text.strip(".!").encode())).random(4) for w in words]
        return np.array(of, dtype=np.float32).reshape(-1, 4)


def sound(seconds=SECONDS):
    times_s = np.arange(round(seconds * SAMPLE_RATE)) / SAMPLE_RATE
    return (0.3 * np.sin(2 * np.pi * 180 * times_s) * (np.sin(4 * times_s) > 0)).astype(np.float32)


def in_pieces(waveform, words, size):
    for begin in range(0, len(waveform), size):
        end = begin + size
        yield waveform[begin:end], [w for w in words if begin <= w.start * SAMPLE_RATE < end]


def every_row(provider, published, words=WORDS, size=1600):
    stream, rows, counts = SpokenWordsStream(provider, published, FPS), [], []
    for samples, begun in in_pieces(sound(), words, size):
        rows.append(stream.hear(samples, begun))
        counts.append(sum(map(len, rows)))
    return np.concatenate([*rows, stream.finish()]), counts


@pytest.mark.parametrize("size", [137, 1600, 9000, 200_000])
@pytest.mark.parametrize("published", [False, True])
@pytest.mark.parametrize("provider", [OfSentences, OfWords])
def test_rows_heard_piece_by_piece_are_those_of_the_whole(provider, published, size):
    whole = spoken_words(provider(), published).of_speech(Speech(sound(), WORDS), FPS)
    assert len(np.unique(whole[:, :4], axis=0)) >= len(TEXTS) - 2
    np.testing.assert_array_equal(every_row(provider(), published, size=size)[0], whole)


@pytest.mark.parametrize("published", [False, True])
def test_a_language_model_reads_each_sentence_once_and_no_filler(published):
    provider = OfSentences()
    every_row(provider, published)
    last = "we all sat down." if published else "we all sat down likes."
    # "mad." and the fillers' own pseudo-sentence, read where the first of them comes
    sentences = ["so it grew mad.", "and then nothing came!", last]
    assert [read for read in provider.read if read != "eh ah like kind of"] == sentences
    assert provider.read.count("eh ah like kind of") == 1


@pytest.mark.parametrize("published", [False, True])
def test_rows_wait_for_the_end_of_a_sentence_or_for_a_word(published):
    _, by_sentence = every_row(OfSentences(), published)
    _, by_word = every_row(OfWords(), published)
    heard = 2 * (np.arange(len(by_word)) + 1)  # rows, after each tenth of a second
    delay = round(SpokenWordsStream(OfWords(), published, FPS).delay_s * FPS)
    assert (heard - by_word <= delay).all()
    assert SpokenWordsStream(OfSentences(), published, FPS).delay_s == math.inf
    # Silence comes at once; then nothing until the last word of the sentence has begun.
    first, ends = int(STARTS[0] * 10) if published else STARTS[0] * 10, STARTS[4] * 10
    for tenth, rows in enumerate(by_sentence, start=1):
        if tenth < ends:
            assert rows == min(int(2 * first), 2 * tenth)
    second_sentence = int(STARTS[5] * 20) // 2 * 2
    assert second_sentence in by_sentence
    assert by_sentence[-1] < by_word[-1]


@pytest.fixture(scope="module")
def corpus():
    return {"skeleton": SKELETON.to_dict(), "speakers": ["ada"], "words": []}


@pytest.fixture
def vector_file(tmp_path):
    path, rng = tmp_path / "tiny.vec", np.random.default_rng(0)
    texts = sorted({text.strip(".!") for text in TEXTS} | {"eh", "ah", "like", "kind", "of", "x"})
    lines = [f"{len(texts)} 4", *(f"{t} {' '.join(map(str, rng.random(4)))}" for t in texts)]
    path.write_text("\n".join(lines) + "\n")
    return path


def speaking(corpus, provider, published=True, **settings):
    """A Gesticulator whose text comes from a provider."""
    torch.manual_seed(0)
    method = Gesticulator(
        corpus, text="static", published_timing=published, initialisation="he", **settings
    )
    fields = [*method.fields[:-1], spoken_words(provider, published)]
    method.fields = tuple(fields)
    return method.eval()


def changed(method, words):
    before, after = (method.generate(Speech(sound(), given)).positions for given in (WORDS, words))
    return np.flatnonzero((before != after).any(axis=(1, 2)))


def with_word(number, text):
    return (
        *WORDS[:number],
        Word(text, WORDS[number].start, WORDS[number].end),
        *WORDS[number + 1 :],
    )


@pytest.mark.parametrize("published", [False, True])
def test_a_frame_depends_on_the_sentences_that_it_looks_at_and_on_no_other(
    corpus, vector_file, published
):
    method = speaking(corpus, OfSentences(), published, word_vectors=str(vector_file))
    begins = [int(STARTS[word] * 10) * 2 for word in (0, 5, 10)]
    for word, sentence in ((4, 0), (9, 1), (12, 2)):
        found = changed(method, with_word(word, "rather" + TEXTS[word][-1:]))
        # From 19 frames before the sentence's first word on, and from nowhere earlier.
        assert max(0, begins[sentence] - 19) <= found[0] <= max(0, begins[sentence] - 18)


def test_with_static_vectors_a_frame_depends_on_words_up_to_the_declared_look_ahead(
    corpus, vector_file
):
    for published, words_s in ((False, 1.0), (True, 1.05)):
        method = speaking(
            corpus, StaticVectors(vector_file), published, word_vectors=str(vector_file)
        )
        stream = method.open()
        assert stream.words_look_ahead_s == pytest.approx(words_s)
        assert stream.delay_s == pytest.approx(max(words_s, stream.look_ahead_s))
        for word in (5, 8, 12):
            earliest_s = changed(method, with_word(word, "x"))[0] / FPS
            ahead_s = WORDS[word].start - earliest_s
            assert words_s - 0.1 < ahead_s <= words_s


def test_sentences_are_spoken_before_the_speech_ends(corpus, vector_file):
    provider = OfSentences()
    method = speaking(corpus, provider, word_vectors=str(vector_file))
    whole = method.generate(Speech(sound(), WORDS)).positions
    stream, motions, counts = method.open(), [], []
    for samples, begun in in_pieces(sound(), WORDS, 1600):
        motion = stream.push(samples, begun)
        motions += [] if motion is None else [motion.positions]
        counts.append(sum(map(len, motions)))
    assert math.isinf(stream.delay_s)
    # When the first sentence's last word is there, the frames that look at no later one.
    assert counts[int(STARTS[4] * 10) + 10] == int(STARTS[5] * 10) * 2 - 19
    assert counts[-1] == int(STARTS[10] * 10) * 2 - 19
    positions = np.concatenate([*motions, stream.finish().positions])
    np.testing.assert_array_equal(positions, whole)


def test_components_of_poses_are_the_same_however_the_sound_is_cut(corpus):
    torch.manual_seed(0)
    method = Gesticulator(corpus, text="none", initialisation="he", pca=12).eval()
    method.codec.directions.copy_(torch.linalg.qr(torch.randn(45, 12)).Q.T)
    whole = method.generate(Speech(sound(3.0))).positions
    stream = method.open()
    motions = [stream.push(piece) for piece in np.split(sound(3.0), 30)]
    positions = [motion.positions for motion in [*motions, stream.finish()] if motion is not None]
    assert len(positions) > 10
    np.testing.assert_array_equal(np.concatenate(positions), whole)


@pytest.mark.parametrize("published", [False, True])
def test_a_blank_text_is_silence_and_holds_nothing_back(published):
    blank = [Word("", 6.2, 6.5), Word(" \t", 7.0, 7.4)]
    rows, counts = every_row(OfSentences(), published, [*WORDS[:10], *blank])
    expected, expected_counts = every_row(OfSentences(), published, WORDS[:10])
    np.testing.assert_array_equal(rows, expected)
    assert counts == expected_counts
    assert counts[-1] == len(rows)


def test_a_sentence_that_does_not_end_is_told_of_once_a_stream(caplog):
    second = np.zeros(SAMPLE_RATE, np.float32)

    def warned(provider, texts):
        caplog.clear()
        stream = SpokenWordsStream(provider, True, FPS)
        for number in range(40):
            text = texts[number % len(texts)]
            stream.hear(second, [Word(text, number + 0.5, number + 0.9)])
        stream.finish()
        return [record.getMessage() for record in caplog.records]

    (message,) = warned(OfSentences(), ["so", "it"])
    assert "began at 0.5 s" in message
    assert "model.text=static" in message
    assert not warned(OfWords(), ["so", "it"])
    assert not warned(OfSentences(), ["so", "it", "grew."])
    # A whole speech in one push waits for nothing that finish wouldn't bring.
    caplog.clear()
    words = [Word("so", number + 0.5, number + 0.9) for number in range(40)]
    SpokenWordsStream(OfSentences(), True, FPS).hear(np.tile(second, 40), words)
    assert not caplog.records


def test_before_and_after_the_speech_there_is_silence_not_zeros(corpus, vector_file):
    method = speaking(corpus, OfWords(), word_vectors=str(vector_file))
    said, quiet = Speech(sound(2.0), WORDS[:4]), method.silence.clone()
    rows = [field.of_speech(said, FPS) for field in method.fields]
    padded = torch.cat(
        [quiet.expand(10, -1), torch.from_numpy(np.concatenate(rows, axis=1)), quiet.expand(19, -1)]
    )
    with torch.no_grad():
        encoded = method.network.encode(padded[None])
        poses = method.network.roll(encoded, method.mean_pose.expand(1, 3, -1))[0]
    expected = method.codec.motion(poses, FPS)
    spoken = method.generate(said)
    np.testing.assert_allclose(spoken.positions, expected.positions, atol=1e-5)
    method.silence.zero_()
    assert np.abs(method.generate(said).positions - expected.positions).max() > 1e-3


def test_a_field_that_needs_all_of_the_sound_is_waited_for():
    def compute(speech, fps, frames):
        return np.full((frames, 1), len(speech.waveform), dtype=np.float32)

    field = SpeechField(name="length", reads="sound", unit="samples", compute=compute)
    rows = open_rows(field, FPS)
    assert rows.look_ahead_s == rows.delay_s == math.inf
    assert [len(rows.hear(piece)) for piece in np.split(sound(1.0), 4)] == [0] * 4
    np.testing.assert_array_equal(rows.finish(), np.full((20, 1), 16_000))


def test_no_sound_has_no_frames(corpus, vector_file):
    method = speaking(corpus, OfWords(), word_vectors=str(vector_file))
    assert len(method.open().finish()) == 0
    assert len(method.generate(Speech(np.zeros(0, np.float32)))) == 0
