"""The study of the multi-adversary paper, on a small embedded corpus and systems that are known."""

import json

import numpy as np
import pytest
import torch

from cospeech.corpus.splits import Span
from cospeech.corpus.store_writer import StoreWriter
from cospeech.corpus.synthetic import synthesise
from cospeech.corpus.windows import WindowSpec
from cospeech.errors import CospeechError
from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
from cospeech.judges.phase_classifier.network import PhaseFeatures, PhaseNetwork, PhaseSizes
from cospeech.judges.phase_classifier.step_sequences import step_sequences
from cospeech.methods.base import GestureMethod
from cospeech.metrics.encoder import GestureEncoder
from cospeech.metrics.encoder.network import PoseAutoencoder
from cospeech.motion.gesture_joints import gesture_joints
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.velocities import body_positions
from cospeech.studies.multi_adversary_figures import multi_adversary_figures
from cospeech.studies.multi_adversary_figures.generating import in_paper_order, label_joints
from cospeech.studies.multi_adversary_figures.held_out import held_out_part, training_mean_pose
from cospeech.studies.trained_system import TrainedSystem


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    with StoreWriter(tmp_path_factory.mktemp("s") / "s", "small", {}, "0" * 64) as writer:
        for recording in synthesise(3, seed=5, speakers=2):
            writer.add(recording)
        frames = writer.columns()["frames"]
        middle = len(frames) // 2
        return writer.finish(
            {
                "train": [Span(i, 0, frames[i]) for i in range(1, middle)],
                "val": [Span(0, 0, frames[0])],
                "test": [Span(i, 30, frames[i]) for i in range(middle, len(frames))],
            }
        )


@pytest.fixture(scope="module")
def layout(store):
    return gesture_joints(store.skeletons[0])


@pytest.fixture(scope="module")
def held_out(store):
    return held_out_part(store, "test")


@pytest.fixture(scope="module")
def classifier(layout, held_out):
    torch.manual_seed(0)
    roles = [layout.roles[i] for i in layout.arms]
    features = PhaseFeatures(len(roles), pitch=True)
    windows = held_out.windows.batch(range(10))
    features.fit([(windows.joints[:, :, list(layout.arms)], windows.acoustics[:, :, -1])])
    network = PhaseNetwork(features.channels, 4, PhaseSizes(8, 8, 8))
    for parameter in network.parameters():
        # or an untrained network says the same throughout
        parameter.data *= 3
    return FrozenPhaseClassifier(network, features, "four", "arms", roles)


class Scaled(GestureMethod):
    """Real motion, larger or smaller around the mean pose, its joints in another order."""

    window = WindowSpec(20.0, 100, 0, 100)
    sample = begin = None

    def border_frames(self):
        return 100

    def __init__(self, held_out, size, frames_short=0):
        super().__init__()
        self.size, self.frames_short = size, frames_short
        store = held_out.store
        self.roles = gesture_joints(store.skeletons[0]).roles
        self.mean = training_mean_pose(store).astype(np.float32)
        self.takes = {
            store.speech(take.span).waveform.tobytes(): (
                take.joints,
                store.upper_body_motion(take.span),
            )
            for take in held_out.takes
        }

    def sample_joints(self, batch):
        assert not self.training
        return torch.from_numpy(self.mean) + self.size * (
            batch.joints - torch.from_numpy(self.mean)
        )

    def generate(self, speech, speaker=None, seed_motion=None, controls=None, generator=None):
        _, motion = self.takes[speech.waveform.tobytes()]
        mean = motion.positions.mean(axis=0)
        positions = mean + self.size * (motion.positions - mean)
        return Motion(motion.skeleton, motion.fps, positions)

    def generate_joints(self, speech):
        joints, _ = self.takes[speech.waveform.tobytes()]
        joints = self.mean + self.size * (joints - self.mean)
        joints = joints[: len(joints) - self.frames_short, ::-1]
        parents = (-1,) * len(self.roles)
        return Motion(Skeleton("joints", self.roles[::-1], parents), 20.0, joints)


def encoder():
    torch.manual_seed(0)
    return GestureEncoder(PoseAutoencoder(), [0.0] * 27)


def test_takes_are_the_held_out_motion_with_its_speech(store, layout, held_out):
    assert len(held_out.takes) == len(store.splits["test"])
    for take, span in zip(held_out.takes, store.splits["test"], strict=True):
        assert (take.span.recording, take.span.start) == (span.recording, 30)
        motion = store.motion(span.recording)
        # two seconds in at 60 fps, every third frame
        expected = body_positions(motion.slice(120, len(motion)), layout.body)[::3]
        np.testing.assert_array_equal(take.joints, expected)
        assert len(take.pitch) == len(take.joints)
        assert take.pitch.max() > 60
        duration = len(store.speech(take.span).waveform) / 16000
        assert abs(duration - len(take.joints) / 20) < 0.1
        windows = held_out.windows.batch(held_out.side_by_side(take)).joints.numpy()
        count = len(take.joints) // 100
        np.testing.assert_array_equal(
            windows.reshape(-1, *expected.shape[1:]), expected[: 100 * count]
        )


def test_mean_pose_is_that_of_the_training_part(store, layout):
    positions = np.concatenate(
        [
            body_positions(store.motion(span.recording), layout.body)
            for span in store.splits["train"]
        ]
    )
    np.testing.assert_allclose(
        training_mean_pose(store), positions.mean(axis=0, dtype=np.float64), atol=1e-3
    )


def test_phases_of_joints_are_those_of_the_recording(store, layout, classifier):
    """Of a take that begins with its recording, the classifier's own labels agree."""
    joints = body_positions(store.motion(0), layout.body)
    speech = store.speech(Span(0, 0, store.recordings[0].frames))
    sequences = step_sequences(store.motion(0), layout.body, speech)
    labels = label_joints(classifier, joints[::3], layout, sequences.pitch[0])
    assert len(set(labels.tolist())) > 1
    assert (labels == classifier.label(store.motion(0), speech)[::3]).mean() > 0.99


def test_real_motion_and_half_of_it(store, held_out, classifier, tmp_path, capsys):
    systems = [
        TrainedSystem("mse_only", 0, Scaled(held_out, 0.5)),
        TrainedSystem("full", 3, Scaled(held_out, 1.0)),
        TrainedSystem("full", 1, Scaled(held_out, 1.0)),
    ]
    result = multi_adversary_figures(store, encoder(), "test", tmp_path, systems, classifier, 0)
    kept = json.loads((tmp_path / "figures.json").read_text())
    assert kept["findings"] == json.loads(json.dumps(result["findings"]))
    real, full, half = kept["systems"]
    assert [real["name"], full["name"], half["name"]] == ["real", "full", "mse_only"]
    assert full["seeds"] == [1, 3]

    def value(system, key):
        return system["statistics"][key]["value"]

    assert value(full, "velocity") == pytest.approx(value(real, "velocity"), rel=1e-4)
    assert value(half, "velocity") == pytest.approx(value(real, "velocity") / 2, rel=1e-4)
    assert value(half, "range_ratio") == pytest.approx(0.5, rel=1e-4)
    assert value(full, "velocity_area") == pytest.approx(0, abs=1e-5)
    for key in ("phase_shares", "phase_transitions", "phase_durations"):
        assert value(full, key) < 0.02
    assert value(half, "diversity") == pytest.approx(value(real, "diversity") / 2, rel=1e-4)
    assert value(full, "seam") == pytest.approx(value(real, "seam"), rel=1e-3)
    assert value(full, "fgd") == pytest.approx(0, abs=1e-9)
    assert value(half, "fgd") > 10 * abs(value(full, "fgd"))
    answers = {finding["claim"][:41]: finding["answer"] for finding in kept["findings"]}
    assert answers["the mean squared error alone gives slow, "] == "holds as far as run"
    assert (tmp_path / "figures.html").read_text().count("<svg") > 5
    printed = capsys.readouterr().out
    assert "wrist velocity, cm/s" in printed
    assert str(tmp_path / "figures.html") in printed
    # the methods are as they were
    assert all(system.method.training for system in systems)


def test_without_a_classifier_there_are_no_phases(store, held_out, tmp_path):
    systems = [TrainedSystem("full", 0, Scaled(held_out, 0.9))]
    result = multi_adversary_figures(store, encoder(), "test", tmp_path, systems, None, 0)
    assert result["systems"][1]["phases"] is None
    assert "phase_shares" not in result["systems"][1]["statistics"]
    assert "No phase classifier was given" in (tmp_path / "figures.html").read_text()


def test_systems_that_can_not_be_judged(store, held_out, tmp_path):
    def study(*systems):
        return multi_adversary_figures(store, encoder(), "test", tmp_path, systems, None, 0)

    with pytest.raises(CospeechError, match="no trained systems"):
        study()
    short = TrainedSystem("full", 0, Scaled(held_out, 1.0, frames_short=40))
    with pytest.raises(CospeechError, match="frames of motion for speech of"):
        study(short)

    class Mute(Scaled):
        sample_joints = None

    other = Mute(held_out, 1.0)
    with pytest.raises(CospeechError, match="full: a Mute makes no gesturing joints"):
        study(TrainedSystem("full", 0, other))
    assert not list(tmp_path.iterdir())


def test_the_papers_order(held_out):
    method = Scaled(held_out, 1.0)
    names = ["no_phase", "mse_only", "full", "hard_labels", "no_motion"]
    systems = [TrainedSystem(name, 0, method) for name in names]
    ordered = [system.name for system in in_paper_order(systems)]
    assert ordered == ["full", "no_motion", "mse_only", "hard_labels", "no_phase"]
