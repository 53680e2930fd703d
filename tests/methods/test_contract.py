"""What every method must do, whatever it is. Methods are found by their yaml."""

import functools
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from hydra import compose, initialize_config_dir
from hydra.errors import InstantiationException
from hydra.utils import instantiate
from lightning import Trainer

import cospeech.experiment  # noqa: F401  registers the resolver of run folders
from callbacks.step_seed import SeedEachStep
from cospeech.corpus.features.field import SpeechField
from cospeech.corpus.features.streaming import FieldStream
from cospeech.corpus.splits import Span
from cospeech.corpus.synthetic.body import SKELETON
from cospeech.corpus.window_loader import WindowLoader, open_windows
from cospeech.errors import CospeechError
from cospeech.evaluation import standard_catalogue
from cospeech.methods.base import GestureMethod
from cospeech.methods.capabilities import MakesStages, TakesControls
from cospeech.methods.fitted import FittedWithoutSteps
from cospeech.motion.kinematics import skeleton_positions
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.upper_body import UPPER_BODY, to_upper_body
from cospeech.speech.speech import SAMPLE_RATE, Speech, Word, covering_frames
from tests.corpora import make_recording, make_store

CONF = Path(__file__).resolve().parents[2] / "conf"
MODELS = sorted(path.stem for path in (CONF / "model").glob("*.yaml"))


def model_config(name: str):
    name, *settings = name.split()
    overrides = [f"model={name}", *settings]
    if (CONF / "experiment" / f"{name}_quick.yaml").is_file():
        overrides.append(f"experiment={name}_quick")
    with initialize_config_dir(str(CONF), version_base="1.3"):
        return compose("train", overrides=overrides).model


def body_without_fingers():
    joints = [joint for joint in SKELETON.joints if "Hand" not in joint or joint.endswith("Hand")]
    parents = [SKELETON.parents[SKELETON.index[joint]] for joint in joints]
    return Skeleton(
        "body",
        tuple(joints),
        tuple(-1 if parent < 0 else joints.index(SKELETON.joints[parent]) for parent in parents),
        SKELETON.offsets[[SKELETON.index[joint] for joint in joints]],
    )


def turning(recording, seed):
    """The same on a body whose joints turn a little about an axis of their own."""
    skeleton, frames = body_without_fingers(), np.arange(len(recording.motion))
    pace = 15 + seed + np.arange(len(skeleton)) % 7
    angles = 0.2 * np.sin(frames[:, None] / pace + seed)
    angles[:, 0] = 0
    rotations = np.zeros((*angles.shape, 4), dtype=np.float32)
    rotations[..., 1], rotations[..., 3] = np.sin(angles / 2), np.cos(angles / 2)
    positions = skeleton_positions(skeleton, rotations)
    motion = Motion(skeleton, recording.motion.fps, positions.astype(np.float32), rotations)
    return replace(recording, motion=motion)


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """Six recordings long enough for runs of windows, with phases and rotations, no fingers."""
    recordings = [
        turning(
            make_recording(
                f"take{i}", speaker=("ada", "ben")[i % 2], seconds=24, seed=i, phases=True
            ),
            i,
        )
        for i in range(6)
    ]
    return make_store(tmp_path_factory.mktemp("store"), recordings)


def build(name: str, store):
    torch.manual_seed(0)
    try:
        return instantiate(model_config(name), corpus=store.facts(), _convert_="all")
    except InstantiationException as error:
        if "need the extra" in str(error.__cause__):
            pytest.skip(f"{name}: {str(error.__cause__).splitlines()[0]}")
        raise


def loader(model, store, split="train"):
    dataset = open_windows(store, split, model, standard_catalogue().fields)
    runs = 8 // dataset.spec.run
    return WindowLoader(dataset, runs, seed=0, shuffle=split == "train", drop_last=True)


def fit(model, store, folder, epochs=1):
    trainer = Trainer(
        max_epochs=epochs,
        limit_train_batches=2,
        accelerator="cpu",
        logger=False,
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
        callbacks=[SeedEachStep(0)],
        default_root_dir=str(folder),
    )
    trainer.fit(model, loader(model, store))
    return trainer


@pytest.fixture(params=MODELS)
def name(request):
    return request.param


@pytest.fixture
def method(name, store):
    model = build(name, store)
    if not isinstance(model, GestureMethod):
        pytest.skip(f"{name} makes no motion")
    return model


def test_two_steps_change_what_it_holds_and_leave_no_nan(name, store, tmp_path):
    model = build(name, store)
    is_fitted = isinstance(model, FittedWithoutSteps)
    held = dict(model.state_dict() if is_fitted else model.named_parameters())
    before = {key: value.clone() for key, value in held.items()}
    trainer = fit(model, store, tmp_path)
    after = model.state_dict()
    assert any(not torch.equal(before[key], after[key]) for key in before)
    assert all(value.isfinite().all() for value in after.values())
    assert trainer.global_step >= 2, "a checkpoint is saved once a step is counted"
    assert bool(trainer.optimizers) is not is_fitted


def test_controls_are_checked_by_the_method_alone(method):
    if not isinstance(method, TakesControls):
        with pytest.raises(CospeechError, match="takes no controls"):
            method.open(controls={"style": 1})
        return
    for values in ({"levitation": 1}, [{"levitation": 1}], 3, [3]):
        with pytest.raises(CospeechError):
            method.parse_controls(values)
        with pytest.raises(CospeechError):
            method.open(controls=values)


def test_the_same_seed_trains_the_same_weights(name, store, tmp_path):
    first, second = build(name, store), build(name, store)
    fit(first, store, tmp_path)
    fit(second, store, tmp_path)
    for (key, a), b in zip(first.state_dict().items(), second.state_dict().values(), strict=True):
        assert torch.equal(a, b), key


def test_samples_have_the_windows_shape_and_follow_the_seed(method, store):
    batch = next(iter(loader(method, store, "val")))
    method.eval()
    positions = method.sample(batch, torch.Generator().manual_seed(1))
    assert positions.shape == batch.positions.shape
    assert positions.shape[2:] == (10, 3)
    assert positions.isfinite().all()
    np.testing.assert_allclose(positions[:, :, 0], 0, atol=1e-6)  # the spine is the origin
    again = method.sample(batch, torch.Generator().manual_seed(1))
    assert torch.equal(positions, again)


@pytest.mark.parametrize("seconds", [0.5, 2.2667, 7.03])
def test_generated_motion_covers_the_audio_exactly(method, store, seconds):
    speech = store.speech(Span(5, 0, 150))
    speech = Speech(speech.waveform[: round(seconds * 16_000)], speech.words)
    motion = method.generate(speech, speaker="ada", generator=torch.Generator().manual_seed(3))
    assert len(motion) == int(np.ceil(len(speech.waveform) / 16_000 * method.window.fps - 1e-9))
    assert motion.fps == method.window.fps
    assert motion.first_bad_frame() is None
    upper_body = to_upper_body(motion)
    assert upper_body.skeleton.joints == UPPER_BODY.joints
    assert np.isfinite(upper_body.positions).all()
    check_rotations(motion)
    again = method.generate(speech, speaker="ada", generator=torch.Generator().manual_seed(3))
    np.testing.assert_array_equal(motion.positions, again.positions)


def check_rotations(motion):
    """They are unit quaternions, and the positions are what they make of the skeleton."""
    rotations, parents = motion.rotations_local, motion.skeleton.parents
    if rotations is None:
        return
    np.testing.assert_allclose(np.linalg.norm(rotations, axis=-1), 1, atol=1e-6)
    root = motion.positions[:, parents.index(-1)]
    posed = skeleton_positions(motion.skeleton, rotations, root)
    np.testing.assert_allclose(posed, motion.positions, atol=1e-5)


def test_the_ten_joints_come_of_the_whole_skeleton_where_a_method_knows_it(store):
    """Else what is judged and what is written as BVH could be two motions."""
    motion = build("gesticulator", store).generate(store.speech(Span(5, 0, 60)))
    assert motion.rotations_local is not None
    assert set(SKELETON.joints) > set(motion.skeleton.joints) > {"Hips", "LeftHand", "LeftUpLeg"}


def test_speech_without_a_transcript_is_enough(method):
    waveform = np.sin(np.arange(40_000) / 20).astype(np.float32) * 0.3
    motion = method.generate(Speech(waveform, None))
    assert motion.first_bad_frame() is None


def test_unknown_speakers_and_controls_are_refused_with_the_known_ones(method, store):
    speech = store.speech(Span(5, 0, 60))
    with pytest.raises(CospeechError, match="ada") as caught:
        method.generate(speech, speaker="nobody")
    assert "nobody" in str(caught.value)
    with pytest.raises(CospeechError, match="levitation"):
        method.generate(speech, controls={"levitation": 1})


def test_a_checkpoint_is_enough_to_generate(method, store, tmp_path):
    trainer = fit(method, store, tmp_path)
    path = tmp_path / "model.ckpt"
    trainer.save_checkpoint(path)
    loaded = type(method).load_from_checkpoint(path, weights_only=True)
    speech = store.speech(Span(5, 0, 90))
    a = method.generate(speech, speaker="ben", generator=torch.Generator().manual_seed(0))
    b = loaded.generate(speech, speaker="ben", generator=torch.Generator().manual_seed(0))
    np.testing.assert_array_equal(a.positions, b.positions)


def test_testing_a_checkpoint_through_the_trainer_loads_safely(method, store, tmp_path):
    trainer = fit(method, store, tmp_path)
    path = tmp_path / "model.ckpt"
    trainer.save_checkpoint(path)
    trained = {key: value.clone() for key, value in method.state_dict().items()}
    with torch.no_grad():
        for parameter in method.parameters():
            parameter.zero_()
    trainer.test(
        method, loader(method, store, "test"), ckpt_path=path, verbose=False, weights_only=True
    )
    for key, value in method.state_dict().items():
        assert torch.equal(value, trained[key]), key


def test_generation_does_not_disturb_training(method, store):
    speech = store.speech(Span(5, 0, 60))
    method.train()
    torch.manual_seed(7)
    expected = torch.rand(3)
    torch.manual_seed(7)
    buffers = {key: value.clone() for key, value in method.named_buffers()}
    method.generate(speech)
    assert torch.equal(torch.rand(3), expected), "generate drew from the global generator"
    assert method.training
    for key, value in method.named_buffers():
        assert torch.equal(value, buffers[key]), key


# Streams -----------------------------------------------------------------------------------

ONE_BY_ONE = [15_000, *[1] * 600, 20_400, *[1] * 600, 5_000, 40_000]
"""Samples of pieces: one by one where the first steps and chunks become complete."""

CUTS = {
    "one by one": ONE_BY_ONE,
    "thousands": [1000] * 120,
    "odd": np.random.default_rng(0).integers(1, 9000, 40).tolist(),
}

OTHERWISE = [
    "knn model.preselect=pose_only",
    "knn_cgan model.preselect=pose_only",
    "knn_cgan model.form=paper",
    "gesticulator model.text=none",
    "gesticulator model.text=none model.published_hop=false",
    "gesticulator model.published_hop=false model.published_timing=false",
]
"""Settings with a delay or a look-ahead of their own."""

each_stream = pytest.mark.parametrize("name", [*MODELS, *OTHERWISE])


def spoken(store) -> Speech:
    """7 s of a voice that comes and goes, with words, among them one that no vocabulary has."""
    times_s = np.arange(112_345) / SAMPLE_RATE
    voice = np.sin(2 * np.pi * (150 * times_s + 5 * np.sin(times_s))) * (np.sin(5 * times_s) > 0)
    waveform = 0.2 * voice + store.speech(Span(5, 0, 150)).waveform[: len(voice)]
    texts = [*store.facts()["words"][4:9], "Zounds"]
    starts = np.arange(20) * 0.36 + 0.02
    words = tuple(Word(texts[i % len(texts)], s, s + 0.3) for i, s in enumerate(starts))
    return Speech(waveform.astype(np.float32), words)


def pushed(method, speech: Speech, sizes: Sequence[int]) -> tuple[list[Motion], list[int]]:
    """Motion of each piece and of the end, and how many frames there were after each piece."""
    stream = method.open("ada", generator=torch.Generator().manual_seed(3))
    assert speech.words is not None
    motions, frames, begin = list[Motion](), list[int](), 0
    while begin < len(speech.waveform):
        end = begin + (sizes[len(frames)] if len(frames) < len(sizes) else 10_000)
        begun = [w for w in speech.words if begin <= w.start * SAMPLE_RATE < end]
        motion = stream.push(speech.waveform[begin:end], begun)
        motions += [] if motion is None else [motion]
        frames.append(sum(map(len, motions)))
        begin = end
    return [*motions, stream.finish()], frames


@each_stream
@pytest.mark.parametrize("cut", CUTS)
def test_the_motion_is_the_same_however_the_sound_is_cut(method, store, cut):
    speech = spoken(store)
    whole = method.generate(speech, "ada", generator=torch.Generator().manual_seed(3))
    motions, _ = pushed(method, speech, CUTS[cut])
    first, *others = motions
    together = functools.reduce(Motion.followed_by, others, first)
    np.testing.assert_array_equal(together.positions, whole.positions)
    if whole.rotations_local is not None:
        np.testing.assert_array_equal(together.rotations_local, whole.rotations_local)


@each_stream
def test_frames_come_after_the_declared_delay(method, store):
    check_delay(method, store)


def check_delay(method, store):
    speech, fps = spoken(store), method.window.fps
    delay_s = method.open().delay_s
    is_longer = False
    for sizes in (CUTS["one by one"], CUTS["thousands"]):
        _, frames = pushed(method, speech, sizes)
        ends = np.cumsum([*sizes, *[10_000] * len(frames)])[: len(frames)]
        for end, made in zip(ends.clip(max=len(speech.waveform)).tolist(), frames, strict=True):
            assert frames_due(end, delay_s, fps) <= made <= covering_frames(end, fps)
            is_longer |= made < frames_due(end, delay_s - 0.15, fps)
    assert (frames[-1] > 0) is math.isfinite(delay_s)
    assert is_longer or delay_s in (0, math.inf), "it says that it waits longer than it does"


def frames_due(samples: int, delay_s: float, fps: float) -> int:
    due_s = samples / SAMPLE_RATE - delay_s
    return 0 if due_s <= 0 else math.ceil(round(due_s * fps, 6))


def other_sound(speech: Speech, second: float) -> Speech:
    """The speech with other sound from a time on."""
    waveform, other = speech.waveform.copy(), np.sin(np.arange(len(speech.waveform)) / 9)
    waveform[round(second * SAMPLE_RATE) :] = other[round(second * SAMPLE_RATE) :]
    return Speech(waveform, speech.words)


def other_words(speech: Speech, second: float) -> Speech:
    """The speech with other texts of the words that begin after a time."""
    assert speech.words is not None
    others = [w.text for w in speech.words[1:]] + [speech.words[0].text]
    words = [
        replace(word, text=other) if word.start > second else word
        for word, other in zip(speech.words, others, strict=True)
    ]
    return Speech(speech.waveform, tuple(words))


LOOK_AHEADS = {"look_ahead_s": other_sound, "words_look_ahead_s": other_words}


@each_stream
@pytest.mark.parametrize("declared", LOOK_AHEADS)
def test_frames_depend_on_speech_up_to_the_declared_look_ahead(method, store, declared):
    check_look_ahead(method, store, declared)


def check_look_ahead(method, store, declared="look_ahead_s"):
    look_ahead_s, fps = getattr(method.open(), declared), method.window.fps
    speech = spoken(store)

    def changed_from(second):
        """Which frames change with the speech from a time on."""
        before, after = (
            method.generate(each, "ada").positions
            for each in (speech, LOOK_AHEADS[declared](speech, second))
        )
        return (before != after).any(axis=(1, 2))

    if look_ahead_s == -math.inf:
        assert not changed_from(0).any()
        return
    if look_ahead_s == math.inf:
        changed = changed_from(len(speech.waveform) / SAMPLE_RATE - 1)
        assert changed[: round(fps)].any(), (
            "the first second could be made before the last is heard"
        )
        return
    # Where steps of 8 frames and chunks of 30 begin.
    first_frames = (0, 8, 16, 24, 30, 32, 40)
    for frame in first_frames:
        assert not changed_from(frame / fps + look_ahead_s)[: frame + 1].any()
    # What convolutions hear at the edge of all they hear can be less than rounding; and words begin
    # every 0.36 s.
    edge_s = max(0.15, 0.2 * look_ahead_s) if declared == "look_ahead_s" else 0.5
    assert any(
        changed_from(frame / fps + look_ahead_s - edge_s)[: frame + 1].any()
        for frame in first_frames
    ), "it says that it looks further ahead than it does"


class Misdeclared:
    """A method whose streams say something else of themselves."""

    def __init__(self, method, **declared):
        self.window, self.generate = method.window, method.generate
        self._method, self._declared = method, declared

    def open(self, *arguments, **named):
        stream = self._method.open(*arguments, **named)
        vars(stream).update(self._declared)
        return stream


@pytest.mark.parametrize("name", ["trimodal"])
@pytest.mark.parametrize("wrong_s", [0, 1.9, 3, math.inf])
def test_a_wrong_declaration_is_noticed(method, store, wrong_s):
    assert method.open().delay_s == method.open().look_ahead_s == pytest.approx(34 / 15)
    with pytest.raises(AssertionError):
        check_delay(Misdeclared(method, delay_s=wrong_s), store)
    for look_ahead_s in {wrong_s, -math.inf}:
        with pytest.raises(AssertionError):
            check_look_ahead(Misdeclared(method, look_ahead_s=look_ahead_s), store)
        misdeclared = Misdeclared(method, words_look_ahead_s=look_ahead_s)
        with pytest.raises(AssertionError):
            check_look_ahead(misdeclared, store, "words_look_ahead_s")


@each_stream
def test_motion_that_streams_is_that_of_the_last_stage(method, store):
    if not isinstance(method, MakesStages):
        pytest.skip("it has no stages")
    speech, generator = spoken(store), torch.Generator().manual_seed(3)
    *_, last = method.stages(speech, None, generator, "ada").values()
    motion = method.generate(speech, "ada", generator=torch.Generator().manual_seed(3))
    expected = method.matcher.database.upper_body(last)
    # Of a network that sees the speech at once or in pieces, up to rounding.
    np.testing.assert_allclose(motion.positions, expected, atol=3e-6 * np.abs(expected).max())


@each_stream
def test_features_are_computed_of_new_sound_alone(method, store, monkeypatch):
    """A push may not compute features of all that was heard before."""
    handed = list[int]()

    def counting(of, samples):
        def counted(self, *arguments):
            handed.append(samples(self, *arguments))
            return of(self, *arguments)

        return counted

    whole, part = SpeechField.of_speech, FieldStream._compute
    monkeypatch.setattr(
        SpeechField, "of_speech", counting(whole, lambda _, s, *__: len(s.waveform))
    )
    monkeypatch.setattr(FieldStream, "_compute", counting(part, lambda self, *_: len(self._sound)))
    speech, stream = spoken(store), method.open("ada")
    for piece in np.array_split(speech.waveform, 70):
        stream.push(piece)
    assert max(handed, default=0) < SAMPLE_RATE
    handed.clear()
    stream.finish()
    assert sum(handed) <= len(speech.waveform)


def test_a_motion_that_it_cannot_continue_is_refused_before_any_sound(method):
    frames = method.window.seed_frames
    if not frames:
        with pytest.raises(CospeechError, match="can't continue a motion"):
            method.open(seed_motion=method.generate(Speech(np.zeros(8000, np.float32))))
        return
    fps, positions = method.window.fps, np.zeros((frames, 10, 3), np.float32)
    method.open(seed_motion=Motion(UPPER_BODY, fps, positions))
    other = replace(UPPER_BODY, name="other", joints=tuple(f"{j}_" for j in UPPER_BODY.joints))
    for motion, told in (
        (Motion(other, fps, positions), "skeleton 'other'"),
        (Motion(UPPER_BODY, fps, positions[..., :2]), "in 2 dimensions"),
        (Motion(UPPER_BODY, fps + 1, positions), "the seed motion runs at"),
        (Motion(UPPER_BODY, fps, positions[1:]), f"{frames} are needed"),
        (Motion(UPPER_BODY, fps, positions * np.nan), "NaN"),
    ):
        with pytest.raises(CospeechError, match=told):
            method.open(seed_motion=motion)


def test_a_stream_takes_samples_of_its_kind_and_ends_once(method):
    for samples in (np.zeros(800, np.int16), np.zeros((800, 1), np.float32), [0.0] * 800):
        with pytest.raises(CospeechError, match="float32"):
            method.open().push(samples)
    stream = method.open()
    stream.push(np.zeros(8000, np.float32))
    stream.finish()
    for again in (stream.finish, lambda: stream.push(np.zeros(800, np.float32))):
        with pytest.raises(CospeechError, match="has been finished"):
            again()
