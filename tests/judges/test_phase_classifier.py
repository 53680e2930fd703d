"""Training of the phase classifier, on the embedded corpus's true phases."""

import json
import re

import numpy as np
import pytest
import torch
from lightning import Trainer

from callbacks.step_seed import SeedEachStep
from cospeech.corpus.splits import Span
from cospeech.corpus.store_writer import StoreWriter
from cospeech.corpus.synthetic import SKELETON, synthesise
from cospeech.corpus.window_loader import WindowLoader, open_windows
from cospeech.errors import ConfigError, InputFileError
from cospeech.formats.phase_files import read_phases
from cospeech.formats.phase_files.writing import phase_segments, write_elan, write_phase_table
from cospeech.judges.phase_classifier import PhaseClassifier
from cospeech.judges.phase_classifier.__main__ import main
from cospeech.judges.phase_classifier.augmentation import cut_at_random, mirrored, random_sizes
from cospeech.judges.phase_classifier.frozen import FrozenPhaseClassifier
from cospeech.judges.phase_classifier.recording_scores import recording_scores
from cospeech.judges.phase_classifier.scores import PhaseScores, confusion_of
from cospeech.motion.bvh_writer import write_bvh
from cospeech.motion.gesture_joints import gesture_joints
from cospeech.motion.joint_map import find_joint_map
from cospeech.motion.phases import PHASES, frame_phases
from cospeech.motion.velocities import velocities
from data_modules.uci_phases import UciPhasesData
from tests.fabricated.sound import save_wav

SMALL = {"dense": 32, "recurrent": 32, "bidirectional": 16}


@pytest.fixture(scope="module")
def recordings():
    return list(synthesise(6, seed=2, speakers=2))


@pytest.fixture(scope="module")
def store(recordings, tmp_path_factory):
    with StoreWriter(tmp_path_factory.mktemp("s") / "s", "s", {}, "0") as writer:
        for recording in recordings:
            writer.add(recording)
        frames = writer.columns()["frames"]
        every = [Span(i, 0, count) for i, count in enumerate(frames)]
        return writer.finish({"train": every[:-6], "val": every[-6:-3], "test": every[-3:]})


def build(store, seed=0, **settings):
    torch.manual_seed(seed)
    return PhaseClassifier(store.facts(), **(SMALL | settings))


def loaders(model, store, batch_size=24):
    made = []
    for split in ("train", "val"):
        dataset = open_windows(store, split, model)
        runs = batch_size // dataset.spec.run
        training = split == "train"
        made.append(WindowLoader(dataset, runs, seed=0, shuffle=training, drop_last=training))
    return made


def fit(model, store, folder, epochs, **options):
    trainer = Trainer(
        max_epochs=epochs,
        accelerator="cpu",
        logger=False,
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
        num_sanity_val_steps=0,
        callbacks=[SeedEachStep(0)],
        default_root_dir=str(folder),
    )
    trainer.fit(model, *loaders(model, store), weights_only=True, **options)
    return trainer


@pytest.fixture(scope="module")
def trained(store, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    quick = {"learning_rate": 5e-3, "dense_dropout": 0.0, "recurrent_dropout": 0.1}
    model = build(store, pitch=False, **quick)
    trainer = fit(model, store, folder, epochs=12)
    return model, trainer, folder


def test_it_learns_the_phases(store, trained):
    _, trainer, folder = trained
    values = {name: float(value) for name, value in trainer.callback_metrics.items()}
    assert values["val/weighted_f"] > 0.7 > 0.45 > values["val/majority_weighted_f"]
    assert values["val/one_minus_weighted_f"] == pytest.approx(1 - values["val/weighted_f"])
    assert {"val/f_preparation", "val/f_stroke", "val/f_hold", "val/f_other"} <= set(values)
    picture = (folder / "confusion_val.svg").read_text()
    assert picture.count("%</text>") == 16
    assert f"{values['val/weighted_f']:.3f}" in picture
    classifier = FrozenPhaseClassifier.load(folder / "phase_classifier.pt")
    assert recording_scores(classifier, store, "test").weighted_f > 0.7


def test_the_file_is_the_best_epochs(store, trained):
    model, _, folder = trained
    classifier = FrozenPhaseClassifier.load(folder / "phase_classifier.pt")
    (batch,) = loaders(model, store, batch_size=1000)[1]
    joints = batch.joints[:, :, model.joint_indices]
    found = classifier.class_probabilities(joints).argmax(-1).numpy()
    true = classifier.merge(batch.phases[:, 1:].numpy())
    scores = PhaseScores.of(confusion_of(true, found, 4))
    assert scores.weighted_f == pytest.approx(float(model.best_weighted_f), abs=1e-6)


def test_statistics_are_those_of_the_training_windows(store, trained):
    model = trained[0]
    dataset = open_windows(store, "train", model)
    batch = dataset.batch(range(len(dataset)))
    values = velocities(batch.joints[:, :, :16], 20.0, speeds=False).flatten(0, 1).double()
    assert int(model.features.steps) == len(values) == 2 * len(dataset) * 99
    torch.testing.assert_close(model.features.mean.double(), values.mean(0), atol=1e-6, rtol=1e-4)
    expected = values.std(0, correction=0)
    torch.testing.assert_close(model.features.deviation.double(), expected, atol=1e-6, rtol=1e-4)


def test_a_resumed_run_is_the_uninterrupted_one(store, tmp_path):
    whole = build(store, pitch=False)
    fit(whole, store, tmp_path / "whole", epochs=3)
    first = build(store, pitch=False)
    fit(first, store, tmp_path / "cut", epochs=2).save_checkpoint(tmp_path / "cut.ckpt")
    second = build(store, seed=9, pitch=False)
    fit(second, store, tmp_path / "cut", epochs=3, ckpt_path=tmp_path / "cut.ckpt")
    for (name, a), b in zip(whole.state_dict().items(), second.state_dict().values(), strict=True):
        assert torch.equal(a, b), name


def test_training_windows_are_cut_at_random_places_of_their_runs(store):
    model = build(store, pitch=False)
    dataset = open_windows(store, "train", model)
    batch = dataset.batch([0, 7, 11])
    runs = batch.joints.unflatten(0, (3, 2)).flatten(1, 2)
    labels = batch.phases.unflatten(0, (3, 2)).flatten(1, 2)
    torch.manual_seed(0)
    joints, _, phases = cut_at_random(batch.joints, None, batch.phases, model.window)
    assert joints.shape == batch.joints.shape
    starts = []
    for i, window in enumerate(joints):
        places = [s for s in range(101) if torch.equal(runs[i // 2, s : s + 100], window)]
        assert len(places) == 1
        assert torch.equal(labels[i // 2, places[0] : places[0] + 100], phases[i])
        starts += places
    assert len(set(starts)) > 4
    fixed = build(store, pitch=False, run=1)
    assert (fixed.window.run, fixed.window.stride) == (1, 50)
    assert cut_at_random(batch.joints, None, batch.phases, fixed.window)[0] is batch.joints


def test_the_mirror_exchanges_sides_and_turns_x():
    roles = gesture_joints(SKELETON).roles[:16]
    joints = torch.randn(2, 9, 16, 3)
    seen = mirrored(joints, roles)
    for i, role in enumerate(roles):
        side, _, joint = role.partition("_")
        other = roles.index(f"{'right' if side == 'left' else 'left'}_{joint}")
        torch.testing.assert_close(seen[..., i, 0], -joints[..., other, 0])
        torch.testing.assert_close(seen[..., i, 1:], joints[..., other, 1:])


def test_sizes_vary_evenly_to_both_sides():
    torch.manual_seed(0)
    factors = random_sizes(torch.zeros(20_000, 2, 1, 3), 0.4)
    assert factors.shape == (20_000, 1, 1, 1)
    assert float(factors.log().abs().max()) == pytest.approx(0.4, abs=1e-3)
    assert float(factors.log().mean()) == pytest.approx(0, abs=0.01)
    assert float(factors.log().var()) == pytest.approx(0.8**2 / 12, rel=0.03)


def test_pitch_needs_sound_and_shows_in_the_input(store):
    with_pitch, without = build(store), build(store, pitch=False)
    assert "acoustics" in with_pitch.needs
    assert "acoustics" not in without.needs
    assert (with_pitch.features.channels, without.features.channels) == (49, 48)
    batch = open_windows(store, "val", with_pitch).batch([0])
    joints, pitch = with_pitch._inputs(batch)
    assert torch.equal(pitch, batch.acoustics[..., 26])
    assert joints.shape == (1, 100, 16, 3)


def test_choices_that_there_are_not_are_refused(store):
    for name, value in {"classes": "seven", "joints": "legs", "protocol": "loud"}.items():
        with pytest.raises(ConfigError, match=rf"model\.{name}={value}: choose one of"):
            build(store, **{name: value})


def test_pieces_validate_and_training_windows_don_t_touch_them(store):
    model = build(store, pitch=False, protocol="pieces", pieces=5, piece_s=12, pieces_seed=5)
    training, validation = (open_windows(store, split, model) for split in ("train", "val"))
    pieces = validation.tracks.spans
    assert [piece.stop - piece.start for piece in pieces] == [180] * 5
    assert open_windows(store, "test", model).tracks.spans == store.splits["test"]
    assert validation.spec.run == 1
    length = 199 / 20  # of a run
    for piece in pieces:
        here = training.recordings[::2] == piece.recording
        starts = training.starts_s[::2][here]
        before, after = starts + length < piece.start / 15, starts >= piece.stop / 15 - 1e-9
        assert (before | after).all()
    assert len(validation) == 10
    for recording, start in zip(validation.recordings, validation.starts_s, strict=True):
        inside = [
            piece.start / 15 <= start and start + 99 / 20 < piece.stop / 15
            for piece in pieces
            if piece.recording == recording
        ]
        assert sum(inside) == 1
    with pytest.raises(ConfigError, match="13 pieces"):
        open_windows(store, "val", build(store, pitch=False, protocol="pieces"))


def test_scores_by_hand():
    true = np.array([0, 0, 0, 0, 1, 1, 1, 2, 2, 2])
    found = np.array([0, 0, 0, 1, 1, 1, 0, 2, 2, 0])
    confusion = confusion_of(true, found, 4)
    assert confusion.tolist() == [[3, 1, 0, 0], [1, 2, 0, 0], [1, 0, 2, 0], [0, 0, 0, 0]]
    scores = PhaseScores.of(confusion)
    # precision 3/5 and recall 3/4; 2/3 and 2/3; 1 and 2/3
    np.testing.assert_allclose(scores.f, [2 / 3, 2 / 3, 4 / 5, 0])
    assert scores.weighted_f == pytest.approx(0.4 * 2 / 3 + 0.3 * 2 / 3 + 0.3 * 4 / 5)
    assert scores.macro_f == pytest.approx((2 / 3 + 2 / 3 + 4 / 5) / 3)
    assert scores.accuracy == pytest.approx(0.7)
    assert scores.majority == pytest.approx(0.4)
    # always "0": precision 0.4, recall 1, and F = 4/7 for that class alone
    assert scores.majority_weighted_f == pytest.approx(0.4 * 4 / 7)
    assert "weighted F 0.707" in scores.table(["a", "b", "c", "d"])
    with pytest.raises(ValueError, match="no step"):
        PhaseScores.of(np.zeros((2, 2)))


@pytest.mark.parametrize("fps", [24.0, 29.97, 60.0, 100.0, 120.0])
@pytest.mark.parametrize("write", [write_phase_table, write_elan])
def test_written_phases_are_read_back_frame_by_frame(tmp_path, fps, write):
    rng = np.random.default_rng(0)
    labels = rng.permutation(np.repeat(np.arange(9), 40)).repeat(rng.integers(1, 9, 360))
    path = tmp_path / f"x{'.csv' if write is write_phase_table else '.eaf'}"
    write(path, phase_segments(labels, fps))
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
    np.testing.assert_array_equal(frame_phases(read_phases(path), len(labels), fps), labels)


def test_a_bvh_is_labelled_on_the_command_line(recordings, trained, tmp_path, capsys):
    classifier = FrozenPhaseClassifier.load(trained[2] / "phase_classifier.pt")
    motion = recordings[0].motion.slice(0, 900)
    bvh, wav = tmp_path / "take.bvh", tmp_path / "take.wav"
    write_bvh(bvh, motion)
    save_wav(wav, recordings[0].speech.waveform[: 15 * 16_000])
    files = [str(bvh), "--classifier", str(trained[2] / "phase_classifier.pt")]
    assert main(["label", *files, "--audio", str(wav), "--out", str(tmp_path / "out")]) == 0
    shown = capsys.readouterr().out
    assert "stroke" in shown
    assert "take.phases.csv" in shown
    labels = classifier.label(motion)
    names = np.array(classifier.classes)[labels]
    for file in ("take.phases.csv", "take.eaf"):
        read = frame_phases(read_phases(tmp_path / "out" / file), 900, 60.0)
        expected = ["none" if name == "other" else name for name in names]
        # the BVH's numbers are rounded, which may move a border by a frame
        assert np.mean(np.array(PHASES)[read] == expected) > 0.99
    table = (tmp_path / "out" / "take.phases.csv").read_text().splitlines()
    assert table[0] == "start_s,end_s,phase,class"
    assert {line.split(",")[3] for line in table[1:]} == set(names)
    assert wav.as_uri() in (tmp_path / "out" / "take.eaf").read_text()


def test_a_skeleton_of_unknown_names_is_labelled_with_a_map(recordings, trained, tmp_path, capsys):
    motion = recordings[0].motion.slice(0, 300)
    roles = find_joint_map(motion.skeleton).to_dict()
    bvh, yaml = tmp_path / "take.bvh", tmp_path / "mine.yaml"
    write_bvh(bvh, motion)
    weights = str(trained[2] / "phase_classifier.pt")
    arguments = ["label", str(bvh), "--classifier", weights, "--out", str(tmp_path)]
    assert main(arguments) == 0
    table = (tmp_path / "take.phases.csv").read_text()
    write_bvh(bvh, motion, unit_scale=1.0)
    assert main([*arguments, "--unit-scale", "1"]) == 0
    assert (tmp_path / "take.phases.csv").read_text() == table
    assert main([*arguments, "--unit-scale", "1", "--up-axis", "z"]) == 0
    assert (tmp_path / "take.phases.csv").read_text() != table
    write_bvh(bvh, motion)
    # fingers are found by their English names, so those stay in the new ones
    bvh.write_text(re.sub(r"(JOINT|ROOT) (\w+)", r"\1 \2Bone", bvh.read_text()))
    assert main(arguments) == 1
    assert "no joint map fits" in capsys.readouterr().err
    del roles["name"]
    text = json.dumps(roles)
    for joint in sorted(find_joint_map(motion.skeleton).required, key=len, reverse=True):
        text = text.replace(f'"{joint}"', f'"{joint}Bone"')
    yaml.write_text(text)
    assert main([*arguments, "--joint-map", str(yaml)]) == 0
    assert (tmp_path / "take.phases.csv").read_text() == table
    assert main([*arguments, "--joint-map", "nobody"]) == 1
    assert "there are" in capsys.readouterr().err


def test_the_command_line_says_what_is_missing(store, trained, recordings, tmp_path, capsys):
    assert main(["score", str(store.path), "--classifier", str(tmp_path / "no.pt")]) == 1
    assert "no such weights file" in capsys.readouterr().err
    build(store).frozen().save(tmp_path / "with_pitch.pt")
    write_bvh(tmp_path / "take.bvh", recordings[0].motion.slice(0, 60))
    files = [str(tmp_path / "take.bvh"), "--classifier", str(tmp_path / "with_pitch.pt")]
    assert main(["label", *files, "--out", str(tmp_path)]) == 1
    assert "--audio" in capsys.readouterr().err


def test_folds_are_pooled_on_the_command_line(store, trained, tmp_path, capsys):
    file, folder = str(trained[2] / "phase_classifier.pt"), str(store.path)
    one = recording_scores(FrozenPhaseClassifier.load(file), store, "test")
    assert main(["score", folder, "--classifier", file]) == 0
    shown = capsys.readouterr().out
    assert shown == one.table(("preparation", "stroke", "hold", "other")) + "\n"
    assert main(["score", folder, folder, "--classifier", file, file]) == 0
    assert capsys.readouterr().out == shown  # the same frames twice have the same scores
    assert main(["score", folder, folder, "--classifier", file]) == 1
    assert "1 classifiers and 2 stores" in capsys.readouterr().err
    build(store, classes="six", pitch=False).frozen().save(tmp_path / "six.pt")
    arguments = ["score", folder, folder, "--classifier", file, str(tmp_path / "six.pt")]
    assert main(arguments) == 1
    assert "different classes" in capsys.readouterr().err


def test_wrists_without_sound_train_on_the_uci_set(shared, tmp_path):
    data = UciPhasesData(
        store_dir=str(tmp_path),
        batch_size=32,
        seed=0,
        split="published",
        val_share=0.1,
        test_share=0.1,
        split_seed=0,
        strict=True,
        max_recordings=None,
        root=str(shared / "data/real/uci_gesture_phase"),
        protocol="leave_user_out",
        held_out="c",
    )
    store = data.prepare_store()
    model = build(store, pitch=False, joints="wrists", mirror=True)
    fit(model, store, tmp_path / "run", epochs=4)
    scores = recording_scores(model.frozen(), store, "test")
    assert scores.weighted_f > scores.majority_weighted_f + 0.1
    classifier = FrozenPhaseClassifier.load(tmp_path / "run" / "phase_classifier.pt")
    assert classifier.roles == ("left_wrist", "right_wrist")
    full = recording_scores(classifier, store, "val")
    assert full.confusion.sum() == len(store.phases(store.splits["val"][0].recording))


def test_a_damaged_bvh_is_an_error_of_the_file(trained, tmp_path, capsys):
    (tmp_path / "x.bvh").write_text("HIERARCHY\n")
    arguments = ["label", str(tmp_path / "x.bvh"), "--out", str(tmp_path)]
    assert main([*arguments, "--classifier", str(trained[2] / "phase_classifier.pt")]) == 1
    assert "x.bvh" in capsys.readouterr().err
    with pytest.raises(InputFileError):
        read_phases(tmp_path / "x.bvh")
