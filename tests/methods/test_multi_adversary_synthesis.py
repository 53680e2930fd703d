"""From windows to recordings of any length, and from gesturing joints to the evaluation's."""

import numpy as np
import pytest
import torch

from cospeech.corpus.features.acoustics import ACOUSTICS
from cospeech.corpus.features.positions import at_evaluation_rate
from cospeech.corpus.window_loader import open_windows
from cospeech.errors import CospeechError
from cospeech.methods.multi_adversary.synthesis import (
    evaluation_joints,
    gesture_skeleton,
    head_offsets,
    long_poses,
)
from cospeech.motion.gesture_joints import gesture_joints
from cospeech.motion.motion import resample_positions
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.speech.speech import Speech
from tests import multi_adversary_runs as runs


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """The embedded corpus: fingers, five spine joints, 60 fps."""
    return runs.embedded_store(tmp_path_factory.mktemp("s") / "s")


@pytest.fixture(scope="module")
def method(store):
    """Untrained, with the corpus's statistics."""
    method = runs.build(store, hidden_size=16)
    windows = runs.loader(method, store, "train").dataset
    method.players.fit_scales([windows.batch(range(len(windows)))], list(method.layout.arms))
    return method.eval()


def speech(seconds: float, seed: int = 0) -> Speech:
    rng = np.random.default_rng(seed)
    return Speech((rng.standard_normal(round(seconds * 16_000)) * 0.1).astype(np.float32), None)


def test_the_ten_joints_are_the_stored_upper_body_but_for_the_head(store, method):
    """Real joints, taken to the evaluation's space, against the store's own upper body."""
    windows = open_windows(store, "val", method, frozenset({"positions"}))
    batch = windows.batch(range(len(windows)))
    upper_body = evaluation_joints(batch.joints, method.layout, method.head)
    found = at_evaluation_rate(upper_body, 20.0)
    assert found.shape == batch.positions.shape == (len(batch), 75, 10, 3)
    exact = torch.arange(0, 75, 3)  # 15 and 20 fps meet every 0.2 s
    body = [i for i, name in enumerate(UPPER_BODY.joints) if name not in ("nose", "head")]
    a, b = found[:, exact][:, :, body], batch.positions[:, exact][:, :, body]
    torch.testing.assert_close(a, b, atol=1e-4, rtol=0)
    # In between, the chord of 50 ms; the head is the corpus's mean one.
    assert float((found[:, :, body] - batch.positions[:, :, body]).abs().max()) < 0.03
    neck = UPPER_BODY.index["neck"]
    head = found - found[:, :, neck : neck + 1]
    torch.testing.assert_close(head[0, 0, 2:4], method.head)
    assert float((head - head[:1, :1])[:, :, 2:4].abs().max()) < 1e-6


def test_nose_and_head_stand_at_bone_length_along_the_mean_direction():
    mean, lengths = torch.zeros(9, 3), torch.ones(9)
    mean[1], mean[2] = torch.tensor([0.0, 0.3, 0.4]), torch.tensor([0.0, 0.5, 0.0])
    lengths[1], lengths[2] = 0.1, 0.2
    found = head_offsets(mean.flatten().tolist(), lengths.tolist())
    torch.testing.assert_close(found, torch.tensor([[0, 0.06, 0.08], [0, 0.26, 0.08]]))


def test_resampling_agrees_with_the_one_for_recordings():
    positions = torch.randn(2, 100, 4, 3)
    found = at_evaluation_rate(positions, 20.0)
    for window, expected in zip(found, positions, strict=True):
        np.testing.assert_allclose(
            window.numpy(), resample_positions(expected.numpy(), 20.0, 15.0), atol=1e-5
        )


def test_features_of_a_recording_are_those_of_its_windows(store, method):
    windows = runs.loader(method, store, "val").dataset
    batch = windows.batch([0, 1])
    audio = store.read(0, "audio")[:, 0] / np.float32(32767)
    features = ACOUSTICS.of_speech(Speech(audio.astype(np.float32), None), 20.0)
    assert len(features) == int(np.ceil(len(audio) / 16_000 * 20))
    np.testing.assert_allclose(batch.acoustics.flatten(0, 1), features[:200], atol=1e-4)


@pytest.mark.parametrize("seconds", [0.005, 0.5, 5.0, 5.05, 13.337])
def test_motion_covers_the_speech_exactly(method, seconds):
    sound = speech(seconds)
    frames = int(np.ceil(len(sound.waveform) / 16_000 * 20 - 1e-9))
    motion = method.generate(sound)
    assert (len(motion), motion.fps, motion.skeleton.joints) == (frames, 20.0, UPPER_BODY.joints)
    joints = method.generate_joints(sound)
    assert (len(joints), len(joints.skeleton)) == (frames, 21)
    assert joints.first_bad_frame() is None


def test_no_speech_gives_no_motion(method):
    assert len(method.generate(Speech(np.zeros(0, dtype=np.float32), None))) == 0


def test_all_joints_and_upper_body_are_the_same_motion(store, method):
    sound = speech(3.0)
    joints, upper_body = method.generate_joints(sound), method.generate(sound)
    index = joints.skeleton.index
    layout = method.layout
    spine = joints.positions[:, index[layout.roles[layout.evaluation_spine]]]
    for name in ("neck", "left_wrist", "right_elbow"):
        np.testing.assert_allclose(
            joints.positions[:, index[name]] - spine,
            upper_body.positions[:, UPPER_BODY.index[name]],
            atol=1e-5,
        )


def test_the_skeleton_of_all_joints_hangs_together(store):
    layout = gesture_joints(store.skeletons[0])
    skeleton, order = gesture_skeleton(layout)
    assert [layout.roles[i] for i in order] == list(skeleton.joints)
    bones = {(layout.roles[a], layout.roles[b]) for a, b in layout.bones}
    assert {(skeleton.joints[a], skeleton.joints[b]) for a, b in skeleton.bones} == bones
    assert skeleton.parents.count(-1) == 1


def test_speech_of_a_window_is_the_sampled_window(store, method):
    batch = next(iter(runs.loader(method, store, "val")))
    windows = method.sample(batch, torch.Generator())
    audio = store.read(0, "audio")[:, 0] / np.float32(32767)
    features = torch.from_numpy(ACOUSTICS.of_speech(Speech(audio.astype(np.float32), None), 20.0))
    with torch.no_grad():
        poses = method.players.generator(method.players.scales.speech(features[None, :100]))
    upper_body = evaluation_joints(method.players.scales.joints(poses), method.layout, method.head)
    torch.testing.assert_close(
        at_evaluation_rate(upper_body, 20.0)[0], windows[0], atol=1e-4, rtol=0
    )


def counted(windows: torch.Tensor) -> torch.Tensor:
    """A generator whose pose tells how many steps its window is old."""
    steps = torch.arange(windows.shape[1], dtype=windows.dtype)
    return steps.expand(len(windows), -1)[..., None]


def test_windows_side_by_side_begin_anew():
    poses = long_poses(counted, torch.zeros(250, 2), 100, "reset")[:, 0]
    assert poses.tolist() == [*range(100), *range(100), *range(50)]


def test_a_carried_state_never_begins_anew():
    assert long_poses(counted, torch.zeros(250, 2), 100, "carry")[:, 0].tolist() == [*range(250)]


def test_overlapping_windows_are_faded_into_one_another():
    poses = long_poses(counted, torch.zeros(250, 2), 100, "crossfade")[:, 0]
    # The second window begins at 60; its share rises from 0 to 1, level at both ends.
    places = [(k + 1) / 41 for k in range(40)]
    shares = [place**2 * (3 - 2 * place) for place in places]
    fade = [(60 + k) + share * (k - (60 + k)) for k, share in enumerate(shares)]
    assert poses[:120].tolist() == pytest.approx([*range(60), *fade, *range(40, 60)], abs=1e-4)
    assert len(poses) == 250
    steps = poses.diff()
    assert float(steps.abs().max()) < 1.3  # the sawtooth's 60 are spread over two seconds
    assert float(steps[59]) == pytest.approx(1, abs=0.12)  # no jump where the fade begins
    assert float(steps[99]) == pytest.approx(1, abs=0.12)  # nor where it ends


@pytest.mark.parametrize("frames", [101, 120, 121, 180, 181, 1000])
@pytest.mark.parametrize("long_form", ["crossfade", "reset", "carry"])
def test_every_step_is_made_at_any_length(frames, long_form):
    poses = long_poses(
        lambda speech: speech, torch.arange(1.0, frames + 1)[:, None], 100, long_form
    )
    assert poses[:, 0].tolist() == pytest.approx(list(range(1, frames + 1)), rel=1e-5)


def test_what_it_cannot_do_is_refused(method):
    sound = speech(1.0)
    known = method.speakers[0]
    with pytest.raises(CospeechError, match=rf"nobody[^>]*> choose one of: .*{known}"):
        method.generate(sound, speaker="nobody")
    with pytest.raises(CospeechError, match=r"takes no controls.*levitation"):
        method.generate(sound, controls={"levitation": 1})
    with pytest.raises(CospeechError, match="can't continue"):
        method.generate(sound, seed_motion=method.generate(sound))
    broken = Speech(np.full(16_000, np.nan, dtype=np.float32), None)
    with pytest.raises(CospeechError, match="NaN"):
        method.generate(broken)


def test_a_checkpoint_is_enough_to_generate(store, tmp_path):
    method = runs.build(store)
    runs.fit(method, store, runs.SaveAt(tmp_path), epochs=1)
    loaded = type(method).load_from_checkpoint(tmp_path / "2.ckpt", weights_only=True)
    a, b = (model.generate_joints(speech(7.0)).positions for model in (method, loaded))
    assert a.shape == b.shape
    method.load_state_dict(torch.load(tmp_path / "2.ckpt", weights_only=True)["state_dict"])
    np.testing.assert_array_equal(method.generate_joints(speech(7.0)).positions, b)
