"""Real people without annotated phases: all stages with a classifier from a file, then motion."""

import shutil

import numpy as np
import pytest
import torch

from cospeech.judges.phase_classifier.frozen import WRIST_ROLES, FrozenPhaseClassifier
from cospeech.judges.phase_classifier.network import PhaseFeatures, PhaseNetwork, PhaseSizes
from cospeech.methods.multi_adversary import MultiAdversary
from cospeech.speech.audio import load_audio
from cospeech.speech.speech import Speech
from tests import command_line

pytestmark = pytest.mark.slow

SMALL = (
    "model=multi_adversary",
    "experiment=multi_adversary_quick",
    "data=mocap",
    "model.run=1",
    "model.stride=10",
    "model.hidden_size=64",
    "model.pretraining_dropout=[0,0]",
    "model.pretraining_steps=150",
    "model.pretraining_learning_rate=5e-3",
    "model.snapshots=3",
    "model.curriculum_batches=3",
    "model.motion_pretraining_steps=3",
    "model.adversarial_steps=4",
    "training.batch_size=8",
    "metrics.encoder_epochs=2",
    "callbacks.render_samples.video=false",
    "callbacks.render_samples.clips=1",
    "logger=none",
)


@pytest.mark.parametrize(("corpus", "fingers"), [("zeggs", 10), ("beat", 10)])
def test_a_minute_of_a_person_goes_through_all_stages(corpus, fingers, shared, tmp_path):
    root = tmp_path / "data"
    root.mkdir()
    for path in (shared / "data" / "real" / corpus).iterdir():
        if path.suffix in (".bvh", ".wav", ".TextGrid"):
            shutil.copy(path, root)
    torch.manual_seed(0)
    network = PhaseNetwork(6, 4, PhaseSizes(8, 8, 8))
    classifier = FrozenPhaseClassifier(
        network, PhaseFeatures(2, pitch=False), "four", "wrists", WRIST_ROLES
    )
    classifier.save(tmp_path / "wrists.pt")
    done = command_line.run(
        tmp_path, *SMALL, f"data.root={root}", f"model.classifier={tmp_path / 'wrists.pt'}"
    )
    assert done.returncode == 0, done.stdout + done.stderr
    ((folder, record),) = command_line.records(tmp_path).items()
    assert record["status"] == "ok"
    errors = [
        row["train/pretraining_mse"] for row in record["epochs"] if "train/pretraining_mse" in row
    ]
    assert errors[-1] < 0.6 * errors[0]
    assert record["epochs"][-1]["train/stage"] == 5
    assert "val/phase_share_hold_generated" in record["epochs"][-1]
    method = MultiAdversary.load_from_checkpoint(
        folder / "checkpoints" / "best.ckpt", weights_only=True
    )
    assert len(method.layout.finger_tips) == fingers
    audio = load_audio(next(root.glob("*.wav")))
    motion = method.generate_joints(Speech(audio[: 20 * 16_000], None))
    assert len(motion) == 400
    # Somebody of human size: shoulders apart, wrists within an arm's length of them.
    index = motion.skeleton.index
    left, right = (motion.positions[:, index[f"{side}_shoulder"]] for side in ("left", "right"))
    width = np.linalg.norm(left - right, axis=-1)
    assert 0.2 < width.mean() < 0.6
    reach = np.linalg.norm(motion.positions[:, index["left_wrist"]] - left, axis=-1)
    assert 0.1 < reach.mean() < 0.8
