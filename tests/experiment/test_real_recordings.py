"""Real people: the whole way from their files to a trained model and generated motion."""

import gzip
import json
import shutil

import numpy as np
import pytest
import torch

from cospeech.methods.gesticulator.joints import joints_of
from cospeech.motion.bvh import read_bvh, read_bvh_skeleton
from cospeech.motion.codecs import ExponentialMapCodec
from cospeech.motion.joint_map import find_joint_map
from cospeech.motion.upper_body import to_upper_body
from tests import command_line

pytestmark = pytest.mark.slow

TRIMODAL = (
    "model=trimodal",
    "model.hidden_size=64",
    "model.layers=2",
    "model.dropout=0",
    "model.adversarial_start_epoch=1000",
    "model.diversity_weight=0",
    "training.batch_size=16",
    "training.epochs=60",
)
SHORT = (
    "metrics.encoder_epochs=2",
    "callbacks.render_samples.every_n_epochs=0",
    "callbacks.render_samples.video=false",
    "callbacks.render_samples.clips=1",
    "logger=none",
)


@pytest.mark.parametrize("corpus", ["zeggs", "beat"])
def test_a_minute_of_a_person_is_learnt_by_heart(corpus, shared, tmp_path):
    root = tmp_path / "data"
    root.mkdir()
    for path in (shared / "data" / "real" / corpus).iterdir():
        if path.suffix in (".bvh", ".wav", ".TextGrid"):
            shutil.copy(path, root)
    done = command_line.run(
        tmp_path, *TRIMODAL, *SHORT, "data=mocap", f"data.root={root}", timeout=580
    )
    assert done.returncode == 0, done.stdout + done.stderr
    ((folder, record),) = command_line.records(tmp_path).items()
    assert record["status"] == "ok"
    first, last = record["epochs"][0]["train/huber"], record["epochs"][-1]["train/huber"]
    assert last < 0.35 * first
    assert (folder / "samples" / "player.html").stat().st_size > 50_000
    weights = torch.load(folder / "checkpoints" / "last.ckpt", weights_only=True)["state_dict"]
    assert all(value.isfinite().all() for value in weights.values())


@pytest.mark.parametrize(("corpus", "text"), [("zeggs", "none"), ("beat", "contextual")])
def test_gesticulator_learns_a_minute_by_heart(corpus, text, shared, tmp_path):
    """Beyond what the best motionless pose costs: the variance of what is made."""
    root = shared / "data" / "real" / corpus
    if text == "contextual":
        pytest.importorskip("transformers", reason="the text extra is not installed")
    done = command_line.run(
        tmp_path,
        "model=gesticulator",
        "experiment=gesticulator_quick",
        f"model.text={text}",
        "model.schedule=forced",
        "model.dropout=0",
        "model.conditioning_dropout=0",
        *SHORT,
        f"data={corpus}",
        f"data.root={root}",
        "data.split=time_blocks",
        "training.batch_size=8",
        "training.epochs=16",
        "trainer.check_val_every_n_epoch=8",
        timeout=580,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    (record,) = command_line.records(tmp_path).values()
    assert record["status"] == "ok"
    first, last = record["epochs"][0]["train/pose"], record["epochs"][-1]["train/pose"]
    (bvh,) = root.glob("*.bvh")
    motion = read_bvh(bvh)
    codec = ExponentialMapCodec(motion.skeleton, joints_of(motion.skeleton))
    poses = codec.encode(torch.from_numpy(motion.rotations_local))
    variance = float(poses.var(dim=0).mean())
    assert last < 0.1 * first
    assert last < 0.3 * variance
    assert np.isfinite(record["final"]["recordings"]["fgd"])


def test_every_real_bvh_is_read(shared):
    files = sorted((shared / "data" / "real").rglob("*.bvh"))
    files = [path for path in files if path.name != "genea_header.bvh"]
    assert len(files) >= 11
    for path in files:
        unit_scale = find_joint_map(read_bvh_skeleton(path)).unit_scale
        upper = to_upper_body(read_bvh(path, unit_scale=unit_scale))
        assert np.isfinite(upper.positions).all(), path
        neck = upper.positions[:, 1, 1]
        assert 0.15 < np.median(neck) < 0.5, path  # metres, up


def test_a_header_that_lies_gives_the_clear_error(shared, tmp_path):
    source = shared / "data" / "real" / "beat" / "2_scott_0_1_1.diffsheg_original.bvh.gz"
    root = tmp_path / "data"
    root.mkdir()
    (root / "scott.bvh").write_bytes(gzip.decompress(source.read_bytes()))
    shutil.copy(shared / "data" / "real" / "beat" / "2_scott_0_1_1.wav", root / "scott.wav")
    done = command_line.run(
        tmp_path, "data=mocap", f"data.root={root}", "data.strict=true", script="prepare.py"
    )
    assert done.returncode == 1
    for part in ("scott.bvh", "7669", "957", "data.frame_rate=15"):
        assert part in done.stderr
    assert "Traceback" not in done.stderr
    mended = command_line.run(
        tmp_path, "data=mocap", f"data.root={root}", "data.frame_rate=15", script="prepare.py"
    )
    assert mended.returncode == 0, mended.stderr
    (manifest,) = tmp_path.glob("stores/*/manifest.json")
    assert json.loads(manifest.read_text())["recordings"]["fps"] == [15.0]
