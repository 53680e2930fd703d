"""Gesticulator as a method against the published code: frames, histories and padding in place."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from lightning import Trainer
from torch.utils.data import DataLoader

from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.facts import placeholder_facts
from cospeech.corpus.features.positions import at_evaluation_rate
from cospeech.methods.gesticulator import Gesticulator, inputs
from cospeech.methods.gesticulator.networks import AHEAD, HISTORY, PAST
from cospeech.methods.gesticulator.published import from_published
from cospeech.motion.codecs.exponential_maps import (
    exponential_maps,
    quaternions_of_exponential_maps,
)
from cospeech.motion.upper_body import to_upper_body
from cospeech.speech.speech import Speech
from tests.fabricated.mocap import TRINITY_BODY
from tests.parity import formulas

FRAMES = 40
KNOWN = HISTORY - 1


class Bert:
    dimensions, version = 768, "formula"

    def __init__(self, name, special_tokens):
        pass


class Scripted(Gesticulator):
    """The real step; step i is of the i-th epoch. Its mean pose is given, and its logs are kept."""

    epochs = (0, 7, 8, 9, 11)

    def __init__(self, **settings):
        facts = placeholder_facts() | {"skeleton": TRINITY_BODY.to_dict()}
        super().__init__(facts, language_model="bert", **settings)
        self.steps = []

    @property
    def current_epoch(self):
        return self.epochs[min(len(self.steps), len(self.epochs) - 1)]

    def on_train_start(self):
        pass

    def log_dict(self, values, **options):
        self.steps.append({name: float(value) for name, value in values.items()})


@pytest.fixture
def method(monkeypatch):
    monkeypatch.setattr(inputs, "ContextualVectors", Bert)
    return scripted()


def scripted(**settings):
    method = Scripted(schedule="released", dropout=0.0, conditioning_dropout=0.0, **settings)
    method.network.load_state_dict(from_published(formulas.gesticulator_weights("no_pca_45")))
    method.mean_pose.copy_(formulas.gesticulator_inputs(45)[2])
    return method


def rotations_of(method, poses):
    """Of all joints of the skeleton; those that aren't coded are at rest."""
    codec = method.codec
    rotations = torch.zeros(*poses.shape[:2], len(codec.skeleton), 4, dtype=poses.dtype)
    rotations[..., 3] = 1
    coded = quaternions_of_exponential_maps(poses.unflatten(-1, (15, 3)))
    for column, joint in enumerate(codec.joints):
        rotations[..., codec.skeleton.index[joint], :] = coded[..., column, :]
    return rotations


def train_batch(method):
    """The published windows; the speech before a window's context is none of its business."""
    speech, poses, _ = (values.double() for values in formulas.gesticulator_inputs(45))
    before = torch.full((len(speech), KNOWN, speech.shape[-1]), 1e3, dtype=speech.dtype)
    heard = torch.cat([before, speech[:, : PAST + FRAMES + AHEAD]], dim=1)
    shown = poses[:, PAST - KNOWN : PAST + FRAMES]
    assert heard.shape[1] == PAST + method.window.frames + AHEAD
    return GestureBatch(
        torch.arange(4),
        rotations=rotations_of(method, shown),
        mel_gesticulator=heard[..., :64],
        spoken_words=heard[..., 64:],
    )


def losses_of(method, steps):
    """``(steps, 3)`` of pose, velocity, and what is descended."""
    batch = train_batch(method)
    trainer = Trainer(
        accelerator="cpu",
        max_epochs=1,
        logger=False,
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
    )
    method = method.double()
    trainer.fit(method, DataLoader([batch] * steps, batch_size=None, collate_fn=lambda item: item))
    return np.array(
        [[step[f"train/{name}"] for name in ("pose", "velocity", "loss")] for step in method.steps]
    )


def test_five_training_steps_have_the_published_losses(method):
    losses = losses_of(method, 5)
    expected = formulas.expected("gesticulator")["training_losses45"]
    np.testing.assert_allclose(losses * [1, 0.6, 1], expected[:, :3], rtol=1e-5)


def test_a_velocity_across_the_batch_is_the_published_slip(monkeypatch):
    monkeypatch.setattr(inputs, "ContextualVectors", Bert)
    losses = losses_of(scripted(velocity_axis="batch"), 1)
    expected = formulas.expected("gesticulator")["training_losses45"]
    assert losses[0, 1] == pytest.approx(expected[0, 3], rel=1e-5)
    assert losses[0, 2] == pytest.approx(expected[0, 0] + 0.6 * expected[0, 3], rel=1e-5)


def test_windows_are_judged_on_the_published_poses(method):
    speech = formulas.gesticulator_inputs(45)[0][:, :-1]
    batch = GestureBatch(
        torch.arange(4), mel_gesticulator=speech[..., :64], spoken_words=speech[..., 64:]
    )
    found = method.sample(batch, torch.Generator())
    poses = torch.from_numpy(formulas.expected("gesticulator")["out45_autoregressive"]).float()
    motion = method.codec.motion(poses.flatten(0, 1), 20.0)
    positions = torch.from_numpy(to_upper_body(motion).positions).unflatten(0, poses.shape[:2])
    torch.testing.assert_close(found, at_evaluation_rate(positions, 20.0), atol=2e-5, rtol=0)


def test_a_whole_speech_is_padded_and_begun_as_published(method):
    """What the published prediction interface gives for 41 frames of sound and 21 of text."""
    speech = formulas.gesticulator_inputs(45)[0]
    rows = {"mel_gesticulator": speech[0, :41, :64], "spoken_words": speech[0, :42, 64:]}
    method.fields = tuple(
        replace(
            field,
            fps=None,
            context=None,
            placed=None,
            opens=None,
            compute=lambda _, fps, frames, name=field.name: rows[name][:frames].numpy(),
        )
        for field in method.fields
    )
    motion = method.generate(Speech(np.zeros(32_000, dtype=np.float32)))
    joints = [TRINITY_BODY.index[joint] for joint in method.codec.joints]
    made = exponential_maps(torch.from_numpy(motion.rotations_local[:, joints])).flatten(1)
    published = formulas.expected("gesticulator")["predicted_clip"][0]
    # Lengths of at most pi: compared as rotations where the published ones are longer.
    expected = exponential_maps(
        quaternions_of_exponential_maps(torch.from_numpy(published).unflatten(-1, (15, 3)))
    )
    np.testing.assert_allclose(made, expected.flatten(1), atol=2e-5, rtol=0)
