"""What every field of the catalogue must do, whatever it is; a new one is found by being there."""

import json
import logging
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from cospeech.corpus.features import FIELDS, refuse_lacking
from cospeech.corpus.features.acoustics import ACOUSTICS
from cospeech.corpus.features.field import FieldSource, MotionField, SpeechField, WindowField
from cospeech.corpus.features.keeping import Stretch, kept_rows
from cospeech.corpus.features.mel import GESTICULATOR_BY_INDEX
from cospeech.corpus.features.streaming import FieldStream
from cospeech.corpus.features.word_vectors import word_vectors
from cospeech.corpus.splits import SPLITS, Span
from cospeech.corpus.store import Store
from cospeech.corpus.store_writer import StoreWriter
from cospeech.corpus.tracks import Tracks
from cospeech.corpus.window_loader import open_windows
from cospeech.corpus.windows import WindowDataset, WindowSpec
from cospeech.errors import ConfigError, CospeechError
from cospeech.motion.motion import Motion, resample_positions, resample_rotations
from cospeech.speech.speech import Speech, Word
from tests.corpora import make_recording

OF_SPEECH = sorted(name for name, field in FIELDS.items() if isinstance(field, SpeechField))
OF_FRAMES = sorted(
    name for name, field in FIELDS.items() if isinstance(field, SpeechField | MotionField)
)
SERVED = sorted(name for name, field in FIELDS.items() if field.reads != "search")
RATES = (15.0, 20.0, 25.0, 30.0)


class Spelled:
    """Vectors of words by their letters, in the place of a language model's."""

    version, dimensions = "spelled", 384

    def vectors(self, words):
        rows = [np.random.default_rng(list(word.text.encode())).random(384) for word in words]
        return np.array(rows, dtype=np.float32).reshape(-1, 384)


@pytest.fixture(autouse=True)
def _no_language_model(monkeypatch):
    monkeypatch.setattr(
        "cospeech.corpus.features.word_vectors._packaged", lambda special_tokens: Spelled()
    )


def voiced(seconds, seed, loudness=0.3):
    """A gliding tone with pauses, and a little noise."""
    rng = np.random.default_rng(seed)
    times = np.arange(round(seconds * 16_000)) / 16_000
    tone = np.sin(2 * np.pi * np.cumsum(140 + 40 * np.sin(times)) / 16_000)
    gate = np.sin(2 * np.pi * 0.7 * times + seed) > -0.3
    return (loudness * tone * gate + 0.01 * rng.standard_normal(len(times))).astype(np.float32)


def recording(name, seed, fps=60.0, seconds=8.0, loudness=0.3):
    made = make_recording(name, seconds=seconds, seed=seed, phases=True)
    positions = resample_positions(made.motion.positions, 15.0, fps)
    times = np.arange(len(positions))[:, None, None] / fps
    axis = np.random.default_rng(seed).standard_normal((len(made.motion.skeleton), 3))
    turned = Rotation.from_rotvec((axis * np.sin(times)).reshape(-1, 3)).as_quat()
    rotations = turned.reshape(len(positions), -1, 4).astype(np.float32)
    waveform = voiced(seconds, seed, loudness)
    return replace(
        made,
        motion=Motion(made.motion.skeleton, fps, positions, rotations),
        phases=(np.arange(len(positions)) // 20 % 9).astype(np.int8),
        speech=Speech(waveform, made.speech.words),
    )


def written(folder, recordings, spans):
    with StoreWriter(folder, "s", {}, "0") as writer:
        for one in recordings:
            writer.add(one)
        return writer.finish(spans(writer.columns()["frames"]))


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """A whole recording of 60 fps, one of 15 fps cut in time, one of 24 fps."""
    takes = [recording("a", 1), recording("b", 2, fps=15.0), recording("c", 3, fps=24.0)]
    return written(
        tmp_path_factory.mktemp("s") / "s",
        takes,
        lambda frames: {
            "train": [Span(0, 0, frames[0]), Span(1, 0, 63)],
            "val": [Span(1, 63, frames[1])],
            "test": [Span(2, 0, frames[2])],
        },
    )


@pytest.mark.parametrize("name", OF_SPEECH)
@pytest.mark.parametrize("fps", RATES)
def test_training_and_speaking_have_the_same_bits(store, name, fps):
    field = FIELDS[name]
    for split, spans in store.splits.items():
        tracks = Tracks(store, spans, fps, [field], title=split)
        assert len(tracks) == len(spans)
        for i, span in enumerate(spans):
            trained = tracks.values(name, i)
            spoken = field.of_speech(store.speech(span), fps, len(trained))
            np.testing.assert_array_equal(trained, spoken)
            assert trained.std() > 0


@pytest.mark.parametrize("name", OF_SPEECH)
def test_with_motion_and_every_interleave_too(store, name):
    """The first interleave of a span is what a method speaks to; the others begin later."""
    field, span = FIELDS[name], store.splits["train"][0]
    tracks = Tracks(store, [span], 20.0, [field, FIELDS["joints"]], every_interleave=True)
    assert len(tracks) == 3
    speech = store.speech(span)
    first = tracks.values(name, 0)
    np.testing.assert_array_equal(first, field.of_speech(speech, 20.0, len(first)))
    second = tracks.values(name, 1)
    if field.fps is None:
        later = speech.since(round(16_000 / 60))
        np.testing.assert_array_equal(second, field.of_speech(later, 20.0, len(second)))
    else:
        together = field.of_speech(speech, 60.0, len(first) * 3)
        np.testing.assert_array_equal(second, together[1::3])


@pytest.mark.parametrize("name", OF_SPEECH)
def test_a_feature_of_speech_is_as_declared(name):
    field, speech = FIELDS[name], Speech(voiced(2.0, 5))
    values = field.of_speech(speech, 20.0)
    assert (values.shape, values.dtype) == ((40, field.width), field.dtype)
    assert np.isfinite(values).all()
    assert field.of_speech(Speech(speech.waveform[:100]), 20.0).shape == (1, field.width)
    assert field.of_speech(Speech(speech.waveform[:0]), 20.0).shape == (0, field.width)
    if field.fps is not None:
        own = field.compute(speech, field.fps, 0)
        assert abs(len(own) / field.fps - 2.0) < 0.1
        times = np.rint(np.arange(40) / 20 * field.fps).astype(int)
        np.testing.assert_array_equal(values, own[times.clip(max=len(own) - 1)])
    # What says that it doesn't look at the whole clip isn't changed by a loud noise far away.
    louder = speech.waveform.copy()
    louder[24_000:] = np.clip(louder[24_000:] * 50, -1, 1)
    same = np.array_equal(field.of_speech(Speech(louder), 20.0)[:20], values[:20])
    assert same or field.sees_whole_clip
    broken = Speech(np.full(800, np.nan, dtype=np.float32))
    with pytest.raises(CospeechError, match="NaN"):
        field.of_speech(broken, 20.0)


def test_loudness_elsewhere_shows_in_what_sees_the_whole_clip():
    """Or the declaration would be no more than a word."""
    quiet = np.sin(2 * np.pi * 150 * np.arange(32_000) / 16_000).astype(np.float32) * 1e-3
    quiet[::8000] += np.float32(1e-5)
    louder = quiet.copy()
    louder[24_000:] = voiced(0.5, 6, loudness=0.9)
    changed = {
        name
        for name in OF_SPEECH
        if not np.array_equal(
            FIELDS[name].of_speech(Speech(quiet), 20.0)[:20],
            FIELDS[name].of_speech(Speech(louder), 20.0)[:20],
        )
    }
    of_sound = (FIELDS[name] for name in OF_SPEECH if FIELDS[name].reads == "sound")
    assert changed == {field.name for field in of_sound if field.sees_whole_clip}


STREAMABLE = {
    "mel_gesticulator, published": GESTICULATOR_BY_INDEX,
    **{name: FIELDS[name] for name in OF_SPEECH if FIELDS[name].context is not None},
}
STREAMED = sorted(STREAMABLE)
PIECES = {
    "one by one": [1] * 3000,
    "tenths of a second": [1600] * 20,
    "odd": np.random.default_rng(1).integers(0, 5000, 12).tolist(),
    "at once": [],
}


@pytest.mark.parametrize("sizes", PIECES.values(), ids=PIECES)
@pytest.mark.parametrize("fps", RATES)
@pytest.mark.parametrize("name", STREAMED)
def test_a_field_heard_piece_by_piece_has_the_bits_of_the_whole(name, fps, sizes):
    if STREAMABLE[name] is GESTICULATOR_BY_INDEX and fps != 20:
        pytest.skip("it is paired with 20 fps")
    waveform = voiced(4.013, 7)
    stream, rows = FieldStream(STREAMABLE[name], fps), []
    for piece in np.split(waveform, np.cumsum(sizes)):
        rows.append(stream.hear(piece))
        due = (stream.samples / 16_000 - stream.look_ahead_s) * fps
        assert sum(map(len, rows)) >= np.ceil(due)
    rows.append(stream.finish())
    whole = STREAMABLE[name].of_speech(Speech(waveform), fps)
    np.testing.assert_array_equal(np.concatenate(rows), whole)


@pytest.mark.parametrize("name", STREAMED)
@pytest.mark.parametrize("samples", [0, 1, 100, 1100, 2500])
def test_a_field_of_hardly_any_sound_is_streamed_too(name, samples):
    waveform = voiced(1.0, 8)[:samples]
    stream = FieldStream(STREAMABLE[name], 20.0)
    rows = [*map(stream.hear, np.array_split(waveform, 3)), stream.finish()]
    whole = STREAMABLE[name].of_speech(Speech(waveform), 20.0)
    np.testing.assert_array_equal(np.concatenate(rows), whole)


def test_rows_of_the_published_hop_are_those_of_the_whole_wherever_a_part_begins():
    """Rows and parts begin together every 441 rows, 22 s."""
    field, waveform = STREAMABLE["mel_gesticulator, published"], voiced(25.0, 7)
    stream = FieldStream(field, 20.0)
    rows = [*map(stream.hear, np.array_split(waveform, 103)), stream.finish()]
    whole = field.of_speech(Speech(waveform), 20.0)
    np.testing.assert_array_equal(np.concatenate(rows), whole)


@pytest.mark.parametrize("name", STREAMED)
def test_a_piece_costs_the_same_however_much_was_heard_before(name):
    handed = []

    def counted(speech, fps, frames):
        handed.append(len(speech.waveform))
        return STREAMABLE[name].compute(speech, fps, frames)

    field = replace(STREAMABLE[name], compute=counted)
    if placed := field.placed:

        def counted_part(samples, first):
            handed.append(len(samples))
            return placed.compute(samples, first)

        field = replace(field, placed=placed._replace(compute=counted_part))
    stream = FieldStream(field, 20.0)
    totals = []
    for _ in range(3):
        for _ in range(200):
            stream.hear(voiced(0.1, 9))
        totals.append(sum(handed))
        handed.clear()
    # Where parts begin at multiples of 20 ms, more or less is held.
    assert totals[2] <= 1.1 * totals[1] <= 8 * 20 * 16_000
    assert max(totals) / 200 < 16_000


@pytest.mark.parametrize("name", sorted(set(OF_SPEECH) - set(STREAMED)))
def test_what_needs_all_of_the_sound_is_refused_by_name(name):
    with pytest.raises(CospeechError, match=f"{name} can't be computed piece by piece"):
        FieldStream(FIELDS[name], 15.0)


@pytest.mark.parametrize("name", OF_SPEECH)
def test_the_sound_of_another_block_is_not_seen(tmp_path, name):
    """The validation block of a recording is made forty times as loud."""
    blocks = {}
    for loud in (False, True):
        take = recording("a", 1, fps=15.0, loudness=0.02)
        if loud:
            take.speech.waveform[64_000:] *= 40
        spans = {"train": [Span(0, 0, 60)], "val": [Span(0, 60, 120)], "test": []}
        store = written(tmp_path / f"{loud}", [take], lambda _, spans=spans: spans)
        blocks[loud] = Tracks(store, spans["train"], 15.0, [FIELDS[name]]).values(name, 0)
    np.testing.assert_array_equal(blocks[False], blocks[True])


@pytest.mark.parametrize("name", SERVED)
@pytest.mark.parametrize("fps", RATES)
def test_a_window_of_any_field_at_any_rate(store, name, fps):
    spec, field = WindowSpec(fps, round(2 * fps), 0, round(fps)), FIELDS[name]
    windows = WindowDataset(store, "train", spec, frozenset({name}))
    batch = windows.batch([1, len(windows) - 1])
    values = batch.require(name)
    steps = {
        "method frames": spec.frames,
        "evaluation frames": int((spec.frames - 1) / fps * 15 + 1e-6) + 1,
        "samples": 32_000,
        "none": None,
    }[field.axis]
    assert values.shape[:2] == (2, steps) if steps else values.shape == (2,)
    assert values.numpy().dtype == field.dtype
    if field.width is not None:
        assert values[0].numel() == (steps or 1) * field.width
    if name in OF_FRAMES:
        for row, window in zip(values.numpy(), (1, len(windows) - 1), strict=True):
            first, sequence = windows.firsts[window], windows.sequences[window]
            whole = windows.tracks.values(name, int(sequence))
            np.testing.assert_array_equal(
                row, whole[first : first + spec.frames].reshape(row.shape)
            )


def test_every_word_has_a_frame_and_the_times_of_its_own():
    words = (Word("one", 0.1, 0.4), Word("two", 0.41, 0.42), Word("three", 0.7, 0.95))
    speech = Speech(np.zeros(16_000, dtype=np.float32), words)
    field = word_vectors(Spelled())
    values = field.of_speech(speech, 10.0)
    one, two, three = Spelled().vectors(words)
    silent = np.zeros(384)
    expected = [silent, one, one, one, two, silent, silent, three, three, three]
    np.testing.assert_array_equal(values, np.array(expected, dtype=np.float32))
    assert not FIELDS["word_vectors"].of_speech(Speech(speech.waveform), 10.0).any()
    later = field.of_speech(speech.since(4_000), 10.0)
    np.testing.assert_array_equal(later[:2], [one, two])
    assert len(speech.since(8_000).words) == 1


def test_windows_take_word_vectors_from_the_provider_they_name(store):
    class Lengths(Spelled):
        version, dimensions = "lengths", 2

        def vectors(self, words):
            return np.array([[len(word.text), 1] for word in words], np.float32).reshape(-1, 2)

    spec = WindowSpec(20, 40, 0, 40, own_fields=(word_vectors(Lengths()),))
    windows = WindowDataset(store, "train", spec, frozenset({"word_vectors"}))
    values = windows.batch([0]).word_vectors
    assert values.shape == (1, 40, 2)
    assert set(values[0, :, 0].tolist()) == {0, 3, 5}
    assert (store.path / "features" / "word_vectors-lengths-20").is_dir()


def test_rotations_of_a_rate_between_lie_on_the_shorter_arc(store):
    """24 fps are put on 40 for two sequences of 20; SciPy's Slerp says where."""
    tracks = Tracks(store, store.splits["test"], 20.0, [FIELDS["rotations"]], True)
    motion = store.motion(2)
    together = np.empty((sum(tracks.frames), *motion.rotations_local.shape[1:]))
    for i in range(2):
        together[i::2] = tracks.values("rotations", i)
    times = np.arange(len(together)) / 40
    for joint in range(len(motion.skeleton)):
        signs = np.where(np.arange(len(motion)) % 3 == 0, -1, 1)[:, None]
        recorded = Rotation.from_quat(motion.rotations_local[:, joint] * signs)
        expected = Slerp(np.arange(len(motion)) / 24, recorded)(times)
        apart = (expected.inv() * Rotation.from_quat(together[:, joint])).magnitude()
        assert apart.max() < 1e-3


def test_the_sign_of_a_quaternion_changes_no_rotation_between_frames():
    quaternions = Rotation.from_rotvec([[0, 0, 0.2], [0, 0, 0.6], [0, 0, 0.6]]).as_quat()
    quaternions[1] *= -1
    found = Rotation.from_quat(resample_rotations(quaternions, 10.0, 20.0)).as_rotvec()
    np.testing.assert_allclose(found[:, 2], [0.2, 0.4, 0.6, 0.6, 0.6], atol=1e-6)


def test_recordings_without_rotations_are_left_out_or_the_corpus_is_refused(tmp_path):
    with_them, without = recording("a", 1, seconds=4), recording("b", 2, seconds=4)
    without = replace(
        without, motion=Motion(without.motion.skeleton, 60.0, without.motion.positions)
    )
    spec = WindowSpec(20, 20, 0, 20)
    for takes, served in (([with_them, without], {0}), ([without, without], None)):
        takes = [replace(take, id=str(i)) for i, take in enumerate(takes)]
        store = written(
            tmp_path / f"{served}",
            takes,
            lambda frames: {
                "train": [Span(i, 0, n) for i, n in enumerate(frames)],
                "val": [],
                "test": [],
            },
        )
        if served is None:
            with pytest.raises(ConfigError, match="needs rotations of the joints"):
                WindowDataset(store, "train", spec, frozenset({"rotations"}))
        else:
            windows = WindowDataset(store, "train", spec, frozenset({"rotations", "root"}))
            assert set(windows.recordings.tolist()) == served
            batch = windows.batch(range(len(windows)))
            first = round(windows.starts_s[1] * 60)
            recorded = store.motion(0)
            np.testing.assert_array_equal(
                batch.rotations[1].numpy(), recorded.rotations_local[first : first + 60 : 3]
            )
            np.testing.assert_array_equal(
                batch.root[1].numpy(), recorded.positions[first : first + 60 : 3, 0]
            )


def test_judging_keeps_the_stride_of_a_method_that_interleaves_nothing(store):
    """Or the published windows would be judged on a third of their number."""
    plain = WindowSpec(15, 34, 4, 10, run=2)
    interleaved = replace(plain, interleaved=True)
    for split in ("train", "val", "test"):
        assert plain.of_split(split) == plain
    assert interleaved.of_split("train") == interleaved
    for split in ("val", "test"):
        assert interleaved.of_split(split) == WindowSpec(15, 34, 4, stride=34)

    class Reader:
        window, needs = plain, frozenset({"positions"})

    assert open_windows(store, "test", Reader()).spec == plain


def test_speech_comes_with_context_and_motion_without(store):
    spec = WindowSpec(20, 30, 0, 30, past=5, ahead=8)
    windows = WindowDataset(store, "val", spec, frozenset({"energy", "joints"}))
    batch = windows.batch(range(len(windows)))
    assert batch.joints.shape[1] == 30
    speech = windows.tracks.values("energy", 0)
    padded = np.concatenate([speech[:1].repeat(5, axis=0), speech, speech[-1:].repeat(8, axis=0)])
    for row, first in zip(batch.energy.numpy(), windows.firsts, strict=True):
        np.testing.assert_array_equal(row, padded[first : first + 43])


def test_what_lies_past_a_block_is_neither_heard_nor_interpolated(tmp_path):
    """The last window of the third interleave of 20 fps begins at 2.0333 s and is 2 s long."""
    spans = {"train": [Span(0, 0, 60)], "val": [Span(0, 60, 120)], "test": []}
    store = written(tmp_path / "s", [recording("a", 1)], lambda _: spans)
    spec = WindowSpec(20, 40, 0, 1, interleaved=True)
    windows = WindowDataset(store, "train", spec, frozenset({"audio", "positions"}))
    batch = windows.batch([len(windows) - 1])
    assert windows.starts_s[-1] == pytest.approx(122 / 60)
    first = int(windows.samples[-1])
    mine = store.audio(0, first, 64_000 - first)
    expected = np.concatenate([mine, mine[::-1]])[:32_000]
    np.testing.assert_array_equal(batch.audio[0].numpy(), expected)
    # 3.9667 s is between evaluation frames 59 and 60, and 60 is the other block's.
    np.testing.assert_array_equal(batch.positions[0, -1].numpy(), store.upper_body(0)[59])


def test_a_feature_is_computed_once_and_again_where_it_is_damaged(tmp_path, caplog, monkeypatch):
    store = written(
        tmp_path / "s",
        [recording(name, i, seconds=2.0) for i, name in enumerate("ab")],
        lambda frames: {
            "train": [Span(0, 0, frames[0]), Span(1, 0, frames[1])],
            "val": [],
            "test": [],
        },
    )
    computed = []

    def compute(speech, fps, frames):
        computed.append(len(speech.waveform))
        return ACOUSTICS.compute(speech, fps, frames)

    field = replace(ACOUSTICS, compute=compute)
    stretches = [Stretch(span) for span in store.splits["train"]]
    values, rows = kept_rows(store, field, 20.0, stretches, "x")
    assert rows.tolist() == [199, 199]
    assert isinstance(values, np.memmap)
    expected = np.array(values)
    folder = store.path / "features" / "acoustics-2"
    array, facts = next(folder.glob("*.npy")), next(folder.glob("*.json"))
    np.testing.assert_array_equal(np.load(array), expected)
    kept_rows(Store(store.path), field, 15.0, stretches, "x")
    assert len(computed) == 2
    good = {path: path.read_bytes() for path in (array, facts)}
    damages = {
        array: [good[array][:-40], b"", good[array][:300].replace(b"27", b"26"), b"\x80\x04."],
        facts: [b"{}", b"[1", good[facts].replace(b"199", b"198"), b"[" * 100_000],
    }
    of_another = json.loads(good[facts])
    of_another["stretches"].reverse()
    damages[facts].append(json.dumps(of_another).encode())
    for path, contents in damages.items():
        for content in contents:
            path.write_bytes(content)
            caplog.clear()
            with caplog.at_level(logging.WARNING):
                again, _ = kept_rows(store, field, 20.0, stretches, "x")
            assert "computed again" in caplog.text
            np.testing.assert_array_equal(again, expected)
            assert {path: path.read_bytes() for path in good} == good
    # Another list of stretches is another array; a newer version a folder of its own.
    kept_rows(store, field, 20.0, stretches[:1], "x")
    kept_rows(store, replace(field, version=3), 20.0, stretches, "x")
    assert len(list(folder.glob("*.npy"))) == 2
    assert folder.with_name("acoustics-3").is_dir()


def test_what_a_corpus_cannot_fill_is_refused_by_name():
    with pytest.raises(
        ConfigError, match=r"m needs sound \(the field acoustics\), and c has none"
    ) as e:
        refuse_lacking("m", ["words", "acoustics"], "c", {"sound"})
    assert "corpus with audio" in e.value.hint
    refuse_lacking("m", ["words", "speakers"], "c", {"sound", "phases", "motion", "upper body"})
    with pytest.raises(ConfigError, match=r"upper body \(the field joints, positions\) and sound"):
        refuse_lacking("m", ["positions", "audio", "joints"], "c", {"sound", "upper body"})
    with pytest.raises(ConfigError, match="no batch field gaze; there are positions, audio"):
        refuse_lacking("m", ["gaze"], "c", set())


def test_a_field_of_another_room_is_refused(store):
    with pytest.raises(ConfigError, match="motion that a search found"):
        WindowDataset(store, "train", WindowSpec(15, 30, 0, 30), frozenset({"matched"}))


def test_vectors_of_words_are_refused_where_nothing_prepared_has_a_transcript(tmp_path):
    take = recording("a", 1)
    silent = replace(take, speech=Speech(take.speech.waveform))
    spec = WindowSpec(15, 30, 0, 30)

    def stored(name, *takes):
        spans = [Span(i, 0, 100) for i in range(len(takes))]
        return written(tmp_path / name, takes, lambda _: dict.fromkeys(SPLITS, spans))

    without = stored("without", silent)
    with pytest.raises(ConfigError, match=r"needs transcripts .the field spoken_words"):
        WindowDataset(without, "train", spec, frozenset({"spoken_words"}))
    WindowDataset(without, "train", spec, frozenset({"words"}))
    with_one = stored("with one", silent, replace(take, id="b"))
    WindowDataset(with_one, "train", spec, frozenset({"spoken_words"}))


def test_a_batch_says_which_fields_were_declared(store):
    needs = frozenset({"positions", "energy"})
    batch = WindowDataset(store, "val", WindowSpec(15, 30, 0, 30), needs).batch([0])
    with pytest.raises(KeyError, match=r"no 'pitch'.*declare energy, positions"):
        batch.require("pitch")
    assert batch.pitch is None
    with pytest.raises(AttributeError, match="no batch field gaze"):
        _ = batch.gaze
    assert batch.having(pitch=batch.energy).pitch is batch.energy
    with pytest.raises(AttributeError, match=r"no batch field fields; see GestureBatch\.having"):
        replace(batch, pitch=batch.energy)


@pytest.mark.parametrize("source", get_args(FieldSource))
def test_whatever_a_corpus_lacks_has_a_name_and_a_way_out(source):
    fields = [field for field in FIELDS.values() if field.reads == source]
    needs = [field.name for field in fields if not field.has_padding]
    with pytest.raises(ConfigError, match=rf"m needs .*\(the field {needs[0]}") as caught:
        refuse_lacking("m", needs[:1], "c", {source})
    assert caught.value.hint


def test_the_catalogue_names_every_axis():
    for name, field in FIELDS.items():
        assert name == field.name
        assert field.unit
        assert isinstance(field, WindowField) or field.axis == "method frames"
