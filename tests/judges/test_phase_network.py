"""The phase network and its frozen form."""

import math

import numpy as np
import pytest
import torch

from cospeech.corpus.synthetic import SKELETON
from cospeech.errors import CospeechError, InputFileError
from cospeech.formats.uci_phases import UCI_SKELETON
from cospeech.judges.phase_classifier.frozen import WRIST_ROLES, FrozenPhaseClassifier
from cospeech.judges.phase_classifier.network import PhaseFeatures, PhaseNetwork, PhaseSizes
from cospeech.judges.phase_classifier.step_sequences import centred
from cospeech.motion.gesture_joints import gesture_joints
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.motion.velocities import body_positions
from cospeech.speech.feature_sets.opensmile import opensmile_features
from cospeech.speech.speech import Speech
from tests.corpora import REST_POSE

SMALL = PhaseSizes(dense=12, recurrent=10, bidirectional=6)
ARMS = gesture_joints(UPPER_BODY).roles[:6]


def make_motion(seconds=12.0, fps=60.0, seed=0, skeleton=UPPER_BODY, rest=REST_POSE):
    rng = np.random.default_rng(seed)
    times = np.arange(round(seconds * fps))[:, None, None] / fps
    rates, phases = rng.uniform(0.2, 1.5, (2, *rest.shape))
    moves = 0.1 * np.sin(2 * np.pi * (rates * times + phases))
    return Motion(skeleton, fps, (rest + moves).astype(np.float32))


def make_classifier(merge="four", pitch=False, joint_set="arms", roles=ARMS, classes=4, **options):
    torch.manual_seed(3)
    features = PhaseFeatures(len(roles), pitch, **options)
    generator = torch.Generator().manual_seed(0)
    joints = 0.05 * torch.randn(8, 40, len(roles), 3, generator=generator)
    hertz = 100 * torch.rand(8, 40, generator=generator)
    features.fit([(joints, hertz)])
    network = PhaseNetwork(features.channels, classes, SMALL)
    for _ in range(20):  # running statistics of their own
        network(features(joints, hertz))
    return FrozenPhaseClassifier(network, features, merge, joint_set, roles)


def tone(seconds, hertz=150.0):
    times = np.arange(round(seconds * 16_000)) / 16_000
    wave = sum(np.sin(2 * np.pi * k * hertz * times) / k for k in range(1, 6))
    return Speech((0.2 * wave * (np.sin(2 * times) > 0)).astype(np.float32))


def test_the_network_has_the_papers_layers_and_our_sizes():
    network = PhaseNetwork(49, 4)
    assert network(torch.zeros(2, 99, 49)).shape == (2, 99, 4)
    lstm = 4 * (128 * (128 + 128) + 2 * 128)
    both_ways = 2 * 4 * (64 * (128 + 64) + 2 * 64)
    expected = (49 + 1) * 128 + lstm + both_ways + 2 * 128 + (128 + 1) * 4
    assert sum(p.numel() for p in network.parameters()) == expected
    stroke = PhaseNetwork(49, 2)
    assert stroke(torch.zeros(2, 99, 49)).shape == (2, 99, 1)
    assert (stroke.dense.out_features, stroke.norm.num_features) == (64, 64)


def test_the_loss_is_the_mean_cross_entropy_per_step():
    scores = torch.tensor([[[2.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]])
    expected = -(np.log(np.e**2 / (np.e**2 + 3)) + np.log(1 / (np.e + 3))) / 2
    loss = PhaseNetwork(3, 4, SMALL).loss(scores, torch.tensor([[0, 0]]))
    assert float(loss) == pytest.approx(expected, rel=1e-6)
    stroke = PhaseNetwork(3, 2, SMALL)
    scores = torch.tensor([[[0.0], [math.log(3.0)]]])  # probabilities 1/2 and 3/4
    probabilities = stroke.probabilities(scores)
    torch.testing.assert_close(probabilities, torch.tensor([[[0.5, 0.5], [0.25, 0.75]]]))
    expected = -(np.log(0.5) + np.log(0.25)) / 2
    assert float(stroke.loss(scores, torch.tensor([[1, 0]]))) == pytest.approx(expected, rel=1e-6)


def test_features_are_z_scores_of_metres_per_second_and_hertz():
    joints = torch.zeros(1, 4, 2, 3)
    joints[0, :, 0, 1] = torch.tensor([0.0, 0.1, 0.3, 0.3])  # left wrist rises: 2, 4, 0 m/s
    hertz = torch.tensor([[500.0, 100.0, 200.0, 0.0]])
    features = PhaseFeatures(2, pitch=True)
    assert not features.fitted
    values = features(joints, hertz)[0]  # statistics 0 and 1: as they are
    torch.testing.assert_close(values[:, 1], torch.tensor([2.0, 4.0, 0.0]))
    torch.testing.assert_close(values[:, 6], torch.tensor([100.0, 200.0, 0.0]))
    assert values[:, [0, 2, 3, 4, 5]].eq(0).all()
    features.fit([(joints, hertz)])
    assert features.fitted
    scores = features(joints, hertz)[0, :, 1]
    torch.testing.assert_close(scores, torch.tensor([0.0, 2.0, -2.0]) / np.sqrt(8 / 3))


def test_statistics_don_t_depend_on_how_windows_are_batched():
    generator = torch.Generator().manual_seed(1)
    joints = torch.randn(10, 30, 3, 3, generator=generator)
    one, many = PhaseFeatures(3, pitch=False), PhaseFeatures(3, pitch=False)
    one.fit([(joints, None)])
    many.fit([(joints[i : i + 3], None) for i in range(0, 10, 3)])
    torch.testing.assert_close(one.mean, many.mean)
    torch.testing.assert_close(one.deviation, many.deviation)
    with pytest.raises(ValueError, match="no steps"):
        one.fit([])


def test_the_low_pass_is_one_two_one_over_positions():
    joints = torch.zeros(1, 7, 1, 3)
    joints[0, 3, 0, 0] = 1.0  # becomes 1/4, 1/2, 1/4
    speeds = PhaseFeatures(1, pitch=False, speeds=True, smooth=True)(joints)[0]
    torch.testing.assert_close(speeds[:, 0], torch.tensor([0.0, 5.0, 5.0, -5.0, -5.0, 0.0]))
    torch.testing.assert_close(speeds[:, 3], speeds[:, 0].abs(), atol=1e-3, rtol=0)


@pytest.mark.parametrize(("merge", "classes"), [("four", 4), ("stroke", 2)])
def test_gradients_flow_through_to_the_joints(merge, classes):
    classifier = make_classifier(merge, classes=classes, pitch=True).double()
    generator = torch.Generator().manual_seed(4)
    joints = 0.05 * torch.randn(2, 9, 6, 3, generator=generator).double()
    hertz = 200 * torch.rand(2, 9, generator=generator).double()
    joints.requires_grad_()
    classifier.train()  # as inside a method that trains

    def stroke(values):
        return classifier.class_probabilities(values, hertz)[..., 1].square().sum()

    (gradient,) = torch.autograd.grad(stroke(joints), joints)
    assert gradient.abs().max() > 1e-3
    step = 1e-6
    for index in [(0, 0, 0, 0), (0, 4, 2, 1), (1, 8, 5, 2), (1, 3, 1, 0)]:
        moved = [joints.detach().clone() for _ in range(2)]
        moved[0][index] += step
        moved[1][index] -= step
        slope = float(stroke(moved[0]) - stroke(moved[1])) / (2 * step)
        assert float(gradient[index]) == pytest.approx(slope, rel=1e-4, abs=1e-6)


def test_nothing_changes_it():
    classifier = make_classifier()
    before = {name: value.clone() for name, value in classifier.state_dict().items()}
    generator = torch.nn.Linear(5, 30 * 18)
    optimiser = torch.optim.SGD([*generator.parameters(), *classifier.parameters()], lr=0.1)
    classifier.train()
    joints = generator(torch.randn(4, 5)).unflatten(1, (30, 6, 3))
    classifier.class_probabilities(joints)[..., 2].mean().backward()
    optimiser.step()
    assert generator.weight.grad.abs().sum() > 0
    assert all(parameter.grad is None for parameter in classifier.parameters())
    for name, value in classifier.state_dict().items():
        assert torch.equal(value, before[name]), name


def test_dropout_is_off_and_a_window_does_not_see_its_neighbours_in_the_batch():
    classifier = make_classifier()
    joints = 0.05 * torch.randn(5, 30, 6, 3, generator=torch.Generator().manual_seed(1))
    classifier.train()
    together = classifier.class_probabilities(joints)
    torch.testing.assert_close(classifier.class_probabilities(joints), together, rtol=0, atol=0)
    alone = torch.cat([classifier.class_probabilities(window[None]) for window in joints])
    torch.testing.assert_close(alone, together)
    torch.testing.assert_close(classifier.eval().class_probabilities(joints), together)


def test_its_lstms_stay_in_training_mode():
    # cuDNN refuses a backward pass in the other mode; only a GPU would show it.
    classifier = make_classifier().eval()
    assert classifier.network.forward_lstm.training
    assert classifier.network.both_ways_lstm.training
    assert not classifier.network.recurrent_dropout.training
    assert not classifier.network.norm.training


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")
def test_gradients_flow_on_a_gpu():
    classifier = make_classifier().cuda().eval()
    joints = torch.randn(2, 30, 6, 3, device="cuda", requires_grad=True)
    classifier.class_probabilities(joints)[..., 0].sum().backward()
    assert joints.grad.abs().sum() > 0


def test_further_training_of_the_network_changes_nothing():
    features = PhaseFeatures(6, pitch=False)
    network = PhaseNetwork(18, 4, SMALL)
    classifier = FrozenPhaseClassifier(network, features, "four", "arms", ARMS)
    assert network.dense.weight.requires_grad
    before = classifier.network.dense.weight.clone()
    with torch.no_grad():
        network.dense.weight.zero_()
    assert torch.equal(classifier.network.dense.weight, before)


def test_windows_of_a_sequence_are_read_in_their_middles():
    windows, (which, steps) = centred(330, 100)
    assert windows.shape == (11, 100)
    assert windows[:, 0].tolist() == [*range(0, 230, 25), 230]
    assert np.array_equal(windows[which, 0] + steps, np.arange(329))
    inner = slice(50, 329 - 50)
    assert np.abs(steps[inner] - 49).max() <= 13  # half a stride from the middle
    assert (which[:50] == 0).all()
    assert (which[-36:] == 10).all()
    short, (which, steps) = centred(40, 100)
    assert short.tolist() == [list(range(40))]
    assert steps.tolist() == list(range(39))


@pytest.mark.parametrize("fps", [60.0, 100.0])
def test_a_long_recording_is_labelled_as_its_windows_are_in_their_middles(fps):
    classifier = make_classifier(pitch=True)
    motion, speech = make_motion(16.0, fps), tone(16.0)
    found = classifier.probabilities(motion, speech)
    assert found.shape == (len(motion), 4)
    np.testing.assert_allclose(found.sum(1), 1, atol=1e-5)
    layout = gesture_joints(UPPER_BODY)
    positions = torch.from_numpy(body_positions(motion, layout.body))
    hertz = torch.from_numpy(opensmile_features(speech.waveform)[:, 26])
    every = round(fps / 20)
    for interleave in range(every):
        for window in (1, 4):
            native = interleave + every * (25 * window + np.arange(100))
            rows = np.rint(native / fps * 100).astype(int)
            alone = classifier.class_probabilities(
                classifier.choose(positions[None, native], layout), hertz[rows][None]
            )[0]
            middle = slice(40, 60)
            np.testing.assert_allclose(
                found[native[1:]][middle], alone.detach().numpy()[middle], atol=1e-6
            )
    labels = classifier.label(motion, speech)
    assert np.array_equal(labels, found.argmax(1))
    assert len(np.unique(labels)) > 1


def test_any_frame_rate_is_labelled_nearest_in_time():
    classifier = make_classifier()
    fast = make_motion(8.0, 120.0)
    slow = Motion(UPPER_BODY, 30.0, fast.positions[::4])
    at_120, at_30 = classifier.probabilities(fast), classifier.probabilities(slow)
    assert len(at_30) == 240
    # 30 fps is put on 40 by interpolation, so only nearly the same
    assert np.abs(at_30 - at_120[::4]).mean() < 0.01
    coarse = classifier.probabilities(Motion(UPPER_BODY, 20.0, fast.positions[::6]))
    np.testing.assert_allclose(coarse[1:], at_120[6::6], atol=1e-6)
    np.testing.assert_array_equal(coarse[0], coarse[1])


def test_wrists_are_seen_from_the_spine():
    classifier = make_classifier(joint_set="wrists", roles=WRIST_ROLES)
    rest = np.zeros((6, 3), dtype=np.float32)
    kinect = make_motion(6.0, 20.0, seed=2, skeleton=UCI_SKELETON, rest=rest)
    names = kinect.skeleton.index
    wrists = kinect.positions[:, [names["left_wrist"], names["right_wrist"]]]
    relative = torch.from_numpy(wrists - kinect.positions[:, [names["spine"]]])
    expected = classifier.class_probabilities(relative[None, :100])[0].numpy()
    found = classifier.probabilities(kinect)
    np.testing.assert_allclose(found[41:55], expected[40:54], atol=1e-6)
    # the same joints out of a method's larger set
    layout = gesture_joints(UPPER_BODY)
    joints = torch.randn(1, 30, len(layout.roles), 3)
    by_name = {role: joints[:, :, i] for i, role in enumerate(layout.roles)}
    spine = by_name[layout.roles[layout.evaluation_spine]]
    chosen = classifier.choose(joints, layout)
    torch.testing.assert_close(chosen[:, :, 0], by_name["left_wrist"] - spine)
    torch.testing.assert_close(chosen[:, :, 1], by_name["right_wrist"] - spine)


def test_missing_joints_are_named():
    roles = gesture_joints(SKELETON).roles[:16]
    classifier = make_classifier(roles=roles)
    with pytest.raises(CospeechError, match=r"left_thumb_tip.*which this skeleton lacks") as caught:
        classifier.label(make_motion(3.0))
    assert "model.joints=wrists" in caught.value.hint
    with pytest.raises(CospeechError, match="right_pinky_tip"):
        classifier.choose(torch.zeros(1, 5, 8, 3), gesture_joints(UPPER_BODY))


def test_what_it_can_t_label_is_said():
    with pytest.raises(CospeechError, match="reads the pitch") as caught:
        make_classifier(pitch=True).label(make_motion(3.0))
    assert "model.pitch=false" in caught.value.hint
    with pytest.raises(CospeechError, match=r"0\.03 s long"):
        make_classifier().label(make_motion(2 / 60))
    assert len(make_classifier().label(make_motion(0.1))) == 6


@pytest.mark.parametrize(
    ("merge", "classes", "options"),
    [("six", 6, {"pitch": True}), ("stroke", 2, {"speeds": True, "smooth": True})],
)
def test_a_file_gives_the_same_classifier(tmp_path, merge, classes, options):
    classifier = make_classifier(merge, classes=classes, **options)
    path = tmp_path / "run" / "phase_classifier.pt"
    classifier.save(path)
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]
    loaded = FrozenPhaseClassifier.load(path)
    assert loaded.describe() == classifier.describe()
    assert loaded.classes == classifier.classes
    motion, speech = make_motion(6.0), tone(6.0)
    expected = classifier.probabilities(motion, speech)
    np.testing.assert_array_equal(loaded.probabilities(motion, speech), expected)
    assert not any(parameter.requires_grad for parameter in loaded.parameters())


def test_other_files_are_refused(tmp_path):
    path = tmp_path / "phase_classifier.pt"
    with pytest.raises(InputFileError, match="no such weights file"):
        FrozenPhaseClassifier.load(path)
    path.write_bytes(b"not a checkpoint")
    with pytest.raises(InputFileError, match="read safely"):
        FrozenPhaseClassifier.load(path)
    for content, told in (
        ({"format": "something else"}, "not a phase classifier but a file of the kind something"),
        ({"state_dict": {}}, "not a phase classifier but the checkpoint of a training"),
        ({"format": "product", "stage": "pretraining"}, "but what the stage pretraining of a"),
        ({"format": 3, "stage": [3]}, r"but what the stage \[3\] of a training left"),
        ({}, "not a phase classifier"),
    ):
        torch.save(content, path)
        with pytest.raises(InputFileError, match=told) as caught:
            FrozenPhaseClassifier.load(path)
        assert "phase_classifier.pt in the folder of a run" in str(caught.value)
    torch.save(make_classifier, path)  # a pickled function
    with pytest.raises(InputFileError, match="read safely"):
        FrozenPhaseClassifier.load(path)
    make_classifier().save(path)
    content = torch.load(path, weights_only=True)
    del content["state"]["features.mean"]
    torch.save(content, path)
    with pytest.raises(InputFileError, match="damaged"):
        FrozenPhaseClassifier.load(path)


def test_parts_that_don_t_fit_are_refused():
    features = PhaseFeatures(6, pitch=False)
    with pytest.raises(ValueError, match="18 channels"):
        FrozenPhaseClassifier(PhaseNetwork(19, 4, SMALL), features, "four", "arms", ARMS)
    with pytest.raises(ValueError, match="6 joints"):
        FrozenPhaseClassifier(PhaseNetwork(18, 4, SMALL), features, "four", "arms", ARMS[:5])
    with pytest.raises(ValueError, match="2 joints, not 6"):
        make_classifier().class_probabilities(torch.zeros(1, 5, 2, 3))
    with pytest.raises(ValueError, match="pitch"):
        make_classifier(pitch=True).class_probabilities(torch.zeros(1, 5, 6, 3))
