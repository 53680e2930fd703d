"""Real people: the whole way from their files to a trained model and generated motion."""

import gzip
import json
import shutil

import numpy as np
import pytest
import torch

from cospeech.motion.bvh import read_bvh, read_bvh_skeleton
from cospeech.motion.joint_map import find_joint_map
from cospeech.motion.upper_body import to_upper_body
from tests import command_line

pytestmark = pytest.mark.slow

SMALL = (
    "model=trimodal",
    "model.hidden_size=64",
    "model.layers=2",
    "model.dropout=0",
    "model.adversarial_start_epoch=1000",
    "model.diversity_weight=0",
    "training.batch_size=16",
    "data=mocap",
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
        tmp_path, *SMALL, f"data.root={root}", "training.epochs=60", timeout=580
    )
    assert done.returncode == 0, done.stdout + done.stderr
    ((folder, record),) = command_line.records(tmp_path).items()
    assert record["status"] == "ok"
    first, last = record["epochs"][0]["train/huber"], record["epochs"][-1]["train/huber"]
    assert last < 0.35 * first
    assert (folder / "samples" / "player.html").stat().st_size > 50_000
    weights = torch.load(folder / "checkpoints" / "last.ckpt", weights_only=True)["state_dict"]
    assert all(value.isfinite().all() for value in weights.values())


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
