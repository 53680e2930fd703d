"""Sampling and long-form synthesis: lengths, chunks, stitching, styles, errors."""

import logging
import math

import numpy as np
import pytest
import torch
from lightning import Trainer

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.windows import WindowSpec
from cospeech.errors import CospeechError
from cospeech.methods.trimodal import Trimodal
from cospeech.methods.trimodal.chunks import blend, chunk_audio, chunk_words, spread_words
from cospeech.methods.trimodal.words import encode_words, joined_words
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.speech.speech import Speech, Word, covering_frames
from cospeech.speech.vocabulary import Vocabulary, evenly_placed_words

WINDOW = WindowSpec(fps=15.0, frames=34, seed_frames=4, stride=10)
FACTS = {
    "words": ["<PAD>", "<SOS>", "<EOS>", "<UNK>", "hello", "world", "again"],
    "speakers": ["ann", "bob", "cy"],
    "mean_direction": [0.1 * i for i in range(27)],
    "bone_lengths": [0.26, 0.18, 0.14, 0.22, 0.36, 0.33, 0.22, 0.36, 0.33],
}
WORDS = (Word("hello", 0.1, 0.4), Word("world", 1.0, 1.5), Word("again", 2.1, 2.3))


def method(**arguments) -> Trimodal:
    torch.manual_seed(0)
    made = Trimodal(corpus=FACTS, hidden_size=8, layers=1, style_size=4, **arguments)
    # Fresh weights give styles too small an influence to be told apart in float32.
    if arguments.get("style", "speaker") == "speaker":
        torch.nn.init.normal_(made.generator.speaker_mu.weight, 0, 2)
    return made


def noise_speech(seconds: float, words: tuple[Word, ...] | None = WORDS) -> Speech:
    samples = np.random.default_rng(0).standard_normal(round(seconds * 16_000))
    return Speech((0.1 * samples).astype(np.float32), words)


def cut(words: tuple[Word, ...], count: int, timed: bool = True) -> torch.Tensor:
    """Word ids of chunks, looked up as published, a word at a time."""
    vocabulary = Vocabulary(FACTS["words"])
    parts = [encode_words([word], vocabulary, None, fold_case=False) for word in words]
    joined = joined_words(parts, len(vocabulary))
    return torch.stack([chunk_words(joined, i, WINDOW, timed=timed) for i in range(count)])


def sounds(speech: Speech, count: int) -> torch.Tensor:
    """``(count, 36266)``: the sound of the first chunks, which start every 2 s."""
    return torch.stack([chunk_audio(speech.waveform[i * 32_000 :], WINDOW) for i in range(count)])


def seeded(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


@pytest.mark.parametrize(
    ("samples", "chunks"),
    [
        (0, 1),
        (36_266, 1),
        # one sample more than 34 frames needs a second chunk
        (36_267, 2),
        (68_266, 2),
        (68_267, 3),
        # a minute: ceil((60 - 2.2667) / 2) + 1
        (960_000, 30),
    ],
)
def test_chunk_count(samples, chunks):
    model = method(context="text", mean_style=True)
    made = []
    decode = model.generator.decode
    model.generator.decode = lambda *given: made.append(given) or decode(*given)
    motion = model.generate(Speech(np.zeros(samples, dtype=np.float32)))
    assert len(made) == chunks
    assert 34 + 30 * (chunks - 1) >= len(motion)


@pytest.mark.parametrize("samples", [0, 1, 1066, 1067, 15_999, 16_000, 16_001, 48_000, 9_600_000])
def test_covering_frames_is_the_exact_ceiling(samples):
    assert covering_frames(samples, 15.0) == -(-samples * 15 // 16_000)


def test_the_sound_of_a_chunk_ends_in_zeros():
    chunk = chunk_audio(np.arange(1.0, 6_001.0, dtype=np.float32), WINDOW)
    assert chunk.shape == (36_266,)
    assert float(chunk[5_999]) == 6000.0
    assert chunk[6_000:].eq(0).all()


def test_words_fall_on_the_onset_frames_of_each_chunk():
    rows = cut(WORDS, 2)
    # 0.1 s -> 1, 1.0 s -> 15, 2.1 s -> 31; the second chunk starts at 2 s: 0.1 s -> 1
    assert {i: int(w) for i, w in enumerate(rows[0]) if w} == {1: 4, 15: 5, 31: 6}
    assert {i: int(w) for i, w in enumerate(rows[1]) if w} == {1: 6}


def test_a_word_that_began_before_the_chunk_lands_on_its_first_frame():
    word = (Word("world", 1.9, 2.2),)
    rows = cut(word, 2)
    assert rows[0, 28] == 5
    assert rows[1, 0] == 5


def test_words_without_timing_are_spread_evenly():
    rows = cut(WORDS, 1, timed=False)
    # floor(34 / 4) = 8
    assert {i: int(w) for i, w in enumerate(rows[0]) if w} == {8: 4, 16: 5, 24: 6}


def test_spreading_a_batch_agrees_with_the_even_placement_of_its_words():
    torch.manual_seed(0)
    rows = torch.randint(1, 50, (40, 34)) * (torch.rand(40, 34) < torch.rand(40, 1))
    rows[0] = 0
    for row, spread in zip(rows, spread_words(rows), strict=True):
        if row.count_nonzero() < 34:
            np.testing.assert_array_equal(spread, evenly_placed_words(row[row != 0], 34))


def test_blending_weights_by_hand():
    overlap = blend(torch.tensor([[1.0], [2.0], [3.0], [4.0]]), torch.full((4, 1), 20.0))
    # .8*1+.2*20, .6*2+.4*20, .4*3+.6*20, .2*4+.8*20
    assert overlap.flatten().tolist() == pytest.approx([4.8, 9.2, 13.2, 16.8])


@pytest.mark.parametrize("seconds", [0.0, 0.01, 1.0, 34 / 15, 2.3, 5.03, 12.345])
def test_the_motion_covers_the_audio_exactly(seconds):
    speech = noise_speech(seconds)
    motion = method().generate(speech)
    assert len(motion) == math.ceil(len(speech.waveform) * 15 / 16_000)
    assert motion.fps == 15
    assert motion.skeleton.joints == UPPER_BODY.joints
    assert motion.positions.dtype == np.float32
    assert np.isfinite(motion.positions).all()


def test_the_same_seed_gives_the_same_motion():
    model, speech = method(), noise_speech(5)
    first = model.generate(speech, generator=seeded(3)).positions
    np.testing.assert_array_equal(first, model.generate(speech, generator=seeded(3)).positions)
    assert not np.array_equal(first, model.generate(speech, generator=seeded(4)).positions)
    default = model.generate(speech).positions
    np.testing.assert_array_equal(default, model.generate(speech, generator=seeded(0)).positions)


def test_generate_leaves_the_training_mode_as_it_was():
    model = method()
    model.train()
    model.generate(noise_speech(1))
    assert model.generator.training


def test_synthesis_is_the_chunk_by_chunk_recipe():
    model, speech = method(mean_style=True), noise_speech(5)
    motion = model.generate(speech, speaker="bob")
    network = model.generator.eval()
    words = cut(WORDS, 3)
    audio = sounds(speech, 3)
    seeds, chunks = torch.zeros(1, 34, 28), []
    with torch.no_grad():
        for chunk in range(3):
            poses = network(
                seeds, words[chunk : chunk + 1], audio[chunk : chunk + 1], torch.tensor([2])
            ).poses
            chunks.append(poses[0])
            seeds = torch.zeros(1, 34, 28)
            seeds[:, :4, :27], seeds[:, :4, 27] = poses[:, 30:], 1
        first, second, third = chunks
        features = torch.cat(
            [
                first[:30],
                blend(first[30:], second[:4]),
                second[4:30],
                blend(second[30:], third[:4]),
                third[4:],
            ]
        )[:75]
        expected = model.codec.decode(features)
    np.testing.assert_allclose(motion.positions, expected.numpy(), atol=1e-5)


def test_the_seed_motions_last_frames_are_continued():
    model, speech = method(mean_style=True), noise_speech(1)
    rng = np.random.default_rng(1)
    positions = rng.standard_normal((9, 10, 3)).astype(np.float32)
    seeded_motion = model.generate(speech, "ann", Motion(UPPER_BODY, 15.0, positions))
    tail = model.generate(speech, "ann", Motion(UPPER_BODY, 15.0, positions[-4:]))
    np.testing.assert_array_equal(seeded_motion.positions, tail.positions)
    assert not np.array_equal(seeded_motion.positions, model.generate(speech, "ann").positions)


@pytest.mark.parametrize(
    ("frames", "fps", "bad", "message"),
    [
        (3, 15.0, False, "has 3 frames, 4 are needed"),
        (8, 30.0, False, "runs at 30 fps, the method at 15"),
        (8, 15.0, True, "NaN or infinity"),
    ],
)
def test_unusable_seed_motions_are_refused(frames, fps, bad, message):
    positions = np.zeros((frames, 10, 3), dtype=np.float32)
    positions[-1, 2, 1] = np.nan if bad else 0
    with pytest.raises(CospeechError, match=message):
        method().generate(noise_speech(1), seed_motion=Motion(UPPER_BODY, fps, positions))


def test_mixes_at_the_ends_are_the_speakers_and_between_lie_between():
    model, speech = method(), noise_speech(3)
    ann = model.generate(speech, "ann", generator=seeded(1)).positions
    mix = {"speaker_mix": {"ann": 1.0, "bob": 0.0}}
    np.testing.assert_allclose(
        ann, model.generate(speech, controls=mix, generator=seeded(1)).positions, atol=1e-6
    )
    mu = model.style_vectors()
    between = {"style": (0.3 * mu[0] + 0.7 * mu[1]).tolist()}
    model = method(mean_style=True)
    np.testing.assert_allclose(
        model.generate(speech, controls=between).positions,
        model.generate(speech, controls={"speaker_mix": {"ann": 3, "bob": 7}}).positions,
        atol=1e-6,
    )


def test_style_vectors_are_the_speakers_means():
    model = method(mean_style=True)
    vectors = model.style_vectors()
    assert vectors.shape == (3, 4)
    speech = noise_speech(1)
    np.testing.assert_allclose(
        model.generate(speech, "cy").positions,
        model.generate(speech, controls={"style": vectors[2].tolist()}).positions,
        atol=1e-6,
    )


@pytest.mark.parametrize(
    ("speaker", "controls", "message"),
    [
        ("dan", None, "no training speaker 'dan' among 3\n  -> choose one of: ann, bob, cy"),
        (None, {"speed": 2}, "no control 'speed'; the trimodal method knows style, speaker_mix"),
        (None, {"style": [1.0, 2.0]}, "needs 4 finite numbers"),
        (None, {"style": [1.0, 2.0, 3.0, math.nan]}, "needs 4 finite numbers"),
        (None, {"style": "wild"}, "not a list of numbers"),
        (None, {"speaker_mix": {"dan": 1}}, "no training speaker 'dan'"),
        (None, {"speaker_mix": {"ann": 0}}, "sum to 0"),
        (None, {"speaker_mix": ["ann"]}, "maps speaker names to numbers"),
        ("ann", {"style": [0.0] * 4}, "style and speaker exclude each other"),
    ],
)
def test_impossible_wishes_are_refused(speaker, controls, message):
    with pytest.raises(CospeechError) as caught:
        method().generate(noise_speech(1), speaker=speaker, controls=controls)
    assert message in str(caught.value)


def test_models_without_speakers_say_so():
    for style in ("random", "none"):
        model = method(style=style)
        assert len(model.generate(noise_speech(1), speaker="ann")) == 15
        with pytest.raises(CospeechError, match=f"knows no speakers .style={style}"):
            model.generate(noise_speech(1), controls={"speaker_mix": {"ann": 1}})
        with pytest.raises(CospeechError, match="knows no speakers"):
            model.style_vectors()
    with pytest.raises(CospeechError, match="without a style input"):
        method(style="none").generate(noise_speech(1), controls={"style": [0.0] * 4})


def test_a_broken_waveform_is_refused():
    waveform = np.zeros(16_000, dtype=np.float32)
    waveform[7] = np.nan
    with pytest.raises(CospeechError, match="waveform holds NaN"):
        method().generate(Speech(waveform))


def test_without_a_transcript_it_warns_and_pads(caplog):
    model = method(mean_style=True)
    with caplog.at_level(logging.WARNING):
        silent = model.generate(noise_speech(3, None), "ann").positions
    assert "no transcript: every word is padding" in caplog.text
    np.testing.assert_array_equal(silent, model.generate(noise_speech(3, ()), "ann").positions)
    assert not np.array_equal(silent, model.generate(noise_speech(3), "ann").positions)


def test_one_style_per_chunk_as_published_or_per_utterance():
    speech = noise_speech(5, None)
    calls: list[torch.Tensor] = []
    for fixed in (False, True):
        model = method(fixed_style=fixed)
        decode = model.generator.decode
        calls.clear()
        model.generator.decode = lambda s, f, z, decode=decode: calls.append(z) or decode(s, f, z)
        model.generate(speech, "ann")
        assert len(calls) == 3
        assert torch.equal(calls[0], calls[1]) is fixed


def test_the_untrained_speaker_is_drawn_as_published_or_never():
    drawn = {False: set(), True: set()}
    for only, speakers in drawn.items():
        model = method(trained_speakers_only=only, mean_style=True)
        posterior = model.generator.style_posterior
        model.generator.style_posterior = lambda ids, p=posterior, s=speakers: (
            s.update(ids.tolist()) or p(ids)
        )
        for seed in range(30):
            model.generate(noise_speech(0.5, None), generator=seeded(seed))
    assert drawn == {False: {0, 1, 2, 3}, True: {1, 2, 3}}


def batch(speakers: list[int]) -> GestureBatch:
    torch.manual_seed(2)
    count = len(speakers)
    return GestureBatch(
        window_ids=torch.arange(count),
        positions=torch.randn(count, 34, 10, 3),
        audio=torch.randn(count, 36_267),
        words=torch.randint(7, (count, 34)),
        speakers=torch.tensor(speakers),
    )


def test_sample_takes_known_speakers_and_draws_for_unknown_ones():
    model = method(mean_style=True).eval()
    known, mixed = batch([1, 2, 3, 1]), batch([1, 2, 0, 0])
    a = model.sample(known, seeded(0))
    b = model.sample(mixed, seeded(0))
    c = model.sample(mixed, seeded(5))
    assert a.shape == (4, 34, 10, 3)
    assert torch.equal(a[:2], b[:2])
    assert torch.equal(b[:2], c[:2])
    assert not torch.equal(b[2:], c[2:])


def test_sample_depends_on_its_generator_alone():
    model = method()
    model.train()
    first = model.sample(batch([1, 2]), seeded(1))
    torch.manual_seed(99)
    assert torch.equal(first, model.sample(batch([1, 2]), seeded(1)))
    assert not torch.equal(first, model.sample(batch([1, 2]), seeded(2)))
    assert model.generator.training


def test_sample_starts_from_the_real_seed_poses():
    model = method(mean_style=True)
    other = batch([1, 2])
    other.positions[:, 4:] = 0
    assert torch.equal(model.sample(batch([1, 2]), seeded(0)), model.sample(other, seeded(0)))
    other.positions[:, 3] = 1
    assert not torch.equal(model.sample(batch([1, 2]), seeded(0)), model.sample(other, seeded(0)))


def test_unit_length_keeps_the_bones():
    lengths = torch.tensor(FACTS["bone_lengths"])
    for unit in (False, True):
        positions = method(unit_length=unit).sample(batch([1, 2]), seeded(0))
        bones = positions[..., 1:, :] - positions[..., list(UPPER_BODY.parents[1:]), :]
        kept = torch.allclose(bones.norm(dim=-1), lengths.expand(2, 34, 9), atol=1e-5)
        assert kept is unit


def test_text_context_ignores_word_timing():
    model = method(context="text", word_timing="even", mean_style=True)
    early, late = batch([1, 2]), batch([1, 2])
    early.words[:], late.words[:] = 0, 0
    early.words[:, 2], early.words[:, 3] = 4, 5
    late.words[:, 20], late.words[:, 33] = 4, 5
    assert torch.equal(model.sample(early, seeded(0)), model.sample(late, seeded(0)))
    timed = method(mean_style=True)
    assert not torch.equal(timed.sample(early, seeded(0)), timed.sample(late, seeded(0)))


def test_a_checkpoint_is_enough_to_generate(tmp_path):
    model = method(fixed_style=True)
    trainer = Trainer(accelerator="cpu", logger=False, enable_checkpointing=False)
    trainer.strategy.connect(model)
    trainer.save_checkpoint(tmp_path / "trimodal.ckpt")
    loaded = Trimodal.load_from_checkpoint(tmp_path / "trimodal.ckpt", weights_only=True)
    speech = noise_speech(3)
    np.testing.assert_array_equal(
        model.generate(speech, "bob").positions, loaded.generate(speech, "bob").positions
    )
