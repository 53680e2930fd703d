"""Motion matching as a user types it: training, the studies of a run, controlled generation."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from tests import command_line
from tests.fabricated.sound import save_wav

pytestmark = pytest.mark.slow

TINY = (
    "model=knn_cgan",
    "model.generator_width=8",
    "model.critic_width=8",
    "model.critic_updates=6",
    "model.pair_stride=32",
    "training.batch_size=8",
    "data.minutes=6",
    "data.speakers=2",
    "callbacks.render_samples.video=false",
    "callbacks.render_samples.clips=1",
    "callbacks.render_samples.seconds=3",
    "logger=none",
)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    outputs = tmp_path_factory.mktemp("outputs")
    done = command_line.run(outputs, *TINY)
    assert done.returncode == 0, done.stdout + done.stderr
    ((folder, record),) = command_line.records(outputs).items()
    return outputs, folder, record


@pytest.fixture(scope="module")
def search_run(run):
    """The search alone, whose output is recorded motion from the beginning."""
    outputs, folder, _ = run
    done = command_line.run(outputs, "model=knn", *TINY[6:])
    assert done.returncode == 0, done.stdout + done.stderr
    (searched,) = set(command_line.records(outputs)) - {folder}
    return outputs, searched


def test_a_study_of_controls(run):
    outputs, folder, _ = run
    refused = command_line.run(outputs, "study=control_adherence", script="evaluate.py")
    assert refused.returncode == 1
    assert "add run=outputs/runs/ID" in refused.stderr
    done = command_line.run(
        outputs, "study=control_adherence", f"run={folder}", script="evaluate.py"
    )
    assert done.returncode == 0, done.stdout + done.stderr
    (path,) = outputs.glob("evaluations/*/control_adherence.json")
    rows = json.loads(path.read_text())["controls"]
    of_search = [row for row in rows if row["stage"] == "k-NN"]
    assert len(of_search) == 6
    assert {row["stage"] for row in rows} == {"k-NN", "k-NN + cGAN"}
    assert path.with_suffix(".png").stat().st_size > 20_000


def test_table_three_of_a_run(run):
    outputs, folder, _ = run
    done = command_line.run(
        outputs, "study=matching_synchrony", f"run={folder}", script="evaluate.py"
    )
    assert done.returncode == 0, done.stdout + done.stderr
    for system in ("k-NN pose-only", "k-NN audio pre-selected", "k-NN + cGAN"):
        assert system in done.stdout
    (path,) = outputs.glob("evaluations/*/synchrony.json")
    assert json.loads(path.read_text())["run"] == folder.name


def test_caused_gestures_of_several_runs(run, search_run):
    outputs, folder, _ = run
    _, searched = search_run
    done = command_line.run(
        outputs, "study=caused_gestures", f"runs=[{folder},{searched}]", script="evaluate.py"
    )
    assert done.returncode == 0, done.stdout + done.stderr
    (path,) = outputs.glob("evaluations/*/caused_gestures.json")
    found = json.loads(path.read_text())
    rows = {row["name"]: row for row in found["systems"]}
    assert list(rows)[-2:] == ["knn_cgan", "knn"]
    assert rows["knn"]["seeds"] == [0]
    assert rows["knn"]["counts"]["beats"] > 5
    assert rows["recorded motion"]["numbers"]["beats_met"]["value"] > 0.8
    assert 0.5 < rows["knn"]["numbers"]["speed"]["value"] < 2
    assert folder.name in found["facts"]["runs"]
    assert "minus knn_cgan" in done.stdout


def test_controlled_generation_from_files(search_run, tmp_path):
    outputs, folder = search_run
    rng = np.random.default_rng(0)
    save_wav(tmp_path / "speech.wav", rng.normal(0, 0.1, 16_000 * 9).astype(np.float32))
    (tmp_path / "speech.tsv").write_text("0.5\t0.9\thello\n4.0\t4.6\thuge\n")
    found = {}
    for name, where in (("high", ">= p70"), ("low", "<= p30")):
        (tmp_path / f"{name}.yaml").write_text(f"- where: left_wrist_height {where}\n")
        done = command_line.run(
            outputs,
            f"run={folder}",
            f"audio={tmp_path}/speech.wav",
            f"transcript={tmp_path}/speech.tsv",
            f"controls={tmp_path}/{name}.yaml",
            script="generate.py",
        )
        assert done.returncode == 0, done.stdout + done.stderr
        assert re.search(r"9\.0 s of motion in .* times real time", done.stdout)
        motion = np.load(re.search(r"motion: (\S+)", done.stdout)[1])
        assert motion["positions"].shape == (135, 10, 3)
        assert motion["fps"] == 15
        found[name] = motion["positions"][:, list(motion["joints"]).index("left_wrist"), 1].mean()
    assert found["high"] > found["low"] + 0.02
    page = re.search(r"listen: (\S+)", done.stdout)[1]
    assert "huge" in Path(page).read_text()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ((), "run is not set"),
        (("run=nowhere", "audio=speech.wav"), "run=nowhere: no record.json"),
        (("run={folder}", "audio={tmp}/none.wav"), "none.wav"),
        (("run={folder}", "audio={tmp}/a.wav", "speaker=nobody"), "no training speaker 'nobody'"),
        (("run={folder}", "audio={tmp}/a.wav", "controls={tmp}/c.yaml"), "c.yaml"),
    ],
)
def test_what_generation_refuses(run, tmp_path, given, message):
    outputs, folder, _ = run
    save_wav(tmp_path / "a.wav", np.zeros(16_000, np.float32))
    (tmp_path / "c.yaml").write_text("- {wher: 3}\n")
    overrides = [item.format(folder=folder, tmp=tmp_path) for item in given]
    done = command_line.run(outputs, *overrides, script="generate.py")
    assert done.returncode == 1
    assert message in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("corpus", ["zeggs", "beat"])
@pytest.mark.parametrize("model", ["knn", "knn_cgan"])
def test_a_minute_of_a_person(corpus, model, shared, tmp_path):
    root = tmp_path / "data"
    root.mkdir()
    for path in (shared / "data" / "real" / corpus).iterdir():
        if path.suffix in (".bvh", ".wav", ".TextGrid"):
            shutil.copy(path, root)
    small = TINY if model == "knn_cgan" else ("model=knn", *TINY[6:])
    small = [item for item in small if not item.startswith("data.")]
    done = command_line.run(tmp_path, *small, "data=mocap", f"data.root={root}")
    assert done.returncode == 0, done.stdout + done.stderr
    ((folder, record),) = command_line.records(tmp_path).items()
    assert record["status"] == "ok"
    assert np.isfinite(record["final"]["recordings"]["fgd"])
    wav = sorted(root.glob("*.wav"))[0]
    made = command_line.run(tmp_path, f"run={folder}", f"audio={wav}", script="generate.py")
    assert made.returncode == 0, made.stderr
    positions = np.load(re.search(r"motion: (\S+)", made.stdout)[1])["positions"]
    steps = np.linalg.norm(np.diff(positions[:, [6, 9]], axis=0), axis=-1)
    assert 0.001 < steps.mean() < 0.2
