"""What every field of the catalogue must do, whatever it is; a new one is found by being there."""

import logging
from dataclasses import replace

import numpy as np
import pytest

from cospeech.corpus.features import FIELDS, refuse_lacking
from cospeech.corpus.features.acoustics import ACOUSTICS
from cospeech.corpus.features.field import MotionField, SpeechField, WindowField
from cospeech.corpus.features.keeping import Stretch, kept_rows
from cospeech.corpus.splits import Span
from cospeech.corpus.store import Store
from cospeech.corpus.store_writer import StoreWriter
from cospeech.corpus.tracks import Tracks
from cospeech.corpus.windows import WindowDataset, WindowSpec
from cospeech.errors import ConfigError, CospeechError
from cospeech.motion.motion import Motion, resample_positions
from cospeech.speech.speech import Speech
from tests.corpora import make_recording

OF_SPEECH = sorted(name for name, field in FIELDS.items() if isinstance(field, SpeechField))
OF_FRAMES = sorted(
    name for name, field in FIELDS.items() if isinstance(field, SpeechField | MotionField)
)
SERVED = sorted(name for name, field in FIELDS.items() if field.reads != "search")
RATES = (15.0, 20.0, 25.0, 30.0)


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
    waveform = voiced(seconds, seed, loudness)
    return replace(
        made,
        motion=Motion(made.motion.skeleton, fps, positions),
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
        later = Speech(speech.waveform[round(16_000 / 60) :])
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
    assert changed == {name for name in OF_SPEECH if FIELDS[name].sees_whole_clip}


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
    folder = store.path / "features" / "acoustics-1"
    array, facts = next(folder.glob("*.npy")), next(folder.glob("*.json"))
    np.testing.assert_array_equal(np.load(array), expected)
    kept_rows(Store(store.path), field, 15.0, stretches, "x")
    assert len(computed) == 2
    good = {path: path.read_bytes() for path in (array, facts)}
    damages = {
        array: [good[array][:-40], b"", good[array][:300].replace(b"27", b"26"), b"\x80\x04."],
        facts: [b"{}", b"[1", good[facts].replace(b"199", b"198"), b"[" * 100_000],
    }
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
    kept_rows(store, replace(field, version=2), 20.0, stretches, "x")
    assert len(list(folder.glob("*.npy"))) == 2
    assert folder.with_name("acoustics-2").is_dir()


def test_what_a_corpus_cannot_fill_is_refused_by_name():
    with pytest.raises(
        ConfigError, match=r"m needs sound \(the field acoustics\), and c has none"
    ) as e:
        refuse_lacking("m", ["words", "acoustics"], "c", {"sound"})
    assert "corpus with audio" in e.value.hint
    refuse_lacking("m", ["words", "speakers"], "c", {"sound", "phases", "motion", "upper body"})
    with pytest.raises(ConfigError, match="no batch field gaze; there are positions, audio"):
        refuse_lacking("m", ["gaze"], "c", set())


def test_a_field_of_another_room_is_refused(store):
    with pytest.raises(ConfigError, match="motion that a search found"):
        WindowDataset(store, "train", WindowSpec(15, 30, 0, 30), frozenset({"matched"}))


def test_a_batch_says_which_fields_were_declared(store):
    needs = frozenset({"positions", "energy"})
    batch = WindowDataset(store, "val", WindowSpec(15, 30, 0, 30), needs).batch([0])
    with pytest.raises(KeyError, match=r"no 'pitch'.*declare energy, positions"):
        batch.require("pitch")
    assert batch.pitch is None
    with pytest.raises(AttributeError, match="no batch field gaze"):
        _ = batch.gaze


def test_the_catalogue_names_every_axis():
    for name, field in FIELDS.items():
        assert name == field.name
        assert field.unit
        assert isinstance(field, WindowField) or field.axis == "method frames"
