"""The real command on the embedded corpus: what a user types, and what is left afterwards."""

import json
import subprocess
import sys

import pytest

from tests import command_line
from tests.command_line import SMALL

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def outputs(tmp_path_factory):
    """One outputs folder for the module: the corpus and the encoder are made once."""
    return tmp_path_factory.mktemp("outputs")


def test_without_a_model_the_models_are_listed(outputs):
    done = command_line.run(outputs)
    assert done.returncode != 0
    for model in ("trimodal", "motion_autoencoder"):
        assert model in done.stderr
    assert "Traceback" not in done.stderr


def test_an_unknown_key_is_an_error_that_names_it(outputs):
    done = command_line.run(outputs, "model=trimodal", "model.hiden_size=3")
    assert done.returncode != 0
    assert "model.hiden_size: there is no such setting; did you mean 'hidden_size'?" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("script", ["train.py", "prepare.py"])
def test_a_corpus_without_its_folder_is_a_plain_sentence(script, tmp_path):
    model = ["model=trimodal"] if script == "train.py" else []
    done = command_line.run(tmp_path, *model, "data=ted", script=script)
    assert done.returncode == 1
    assert "error: data.root is not set" in done.stderr
    assert "Traceback" not in done.stderr


def test_an_impossible_setting_is_a_plain_sentence_and_leaves_no_run(outputs):
    before = command_line.records(outputs)
    done = command_line.run(outputs, *SMALL, "model.context=video")
    assert done.returncode == 1
    assert "context='video' is not one of both, audio, text" in done.stderr
    assert "Traceback" not in done.stderr
    assert command_line.records(outputs) == before


def test_asking_to_resume_nothing_is_a_clear_error(tmp_path):
    done = command_line.run(tmp_path, *SMALL, "ckpt_path=last")
    assert done.returncode != 0
    assert "no run trimodal-synthetic-full-s0-*" in done.stderr


def test_the_debug_run_goes_through_every_stage(tmp_path):
    done = command_line.run(tmp_path, "model=trimodal", "debug=fast")
    assert done.returncode == 0, done.stdout + done.stderr
    ((folder, record),) = command_line.records(tmp_path).items()
    assert record["status"] == "ok"
    assert "FGD ↓" in done.stdout
    assert str(folder / "samples" / "player.html") in done.stdout
    assert (folder / "samples" / "player.html").is_file()
    assert (folder / "samples" / "clip_0.mp4").is_file()


def test_a_study_is_one_multirun(outputs):
    small = [o for o in SMALL if not o.startswith("model=")]
    done = command_line.run(
        outputs,
        *small,
        "study=trimodal_ablations",
        "training.epochs=1",
        "hydra.sweeper.params.seed='0,1'",
        "hydra.sweeper.params.ablation='full,trimodal__no_audio'",
        timeout=600,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    folder = outputs / "studies" / "trimodal_ablations"
    rows = {
        (record["ablation"], record["seed"]): record["status"]
        for record in (json.loads(p.read_text()) for p in folder.glob("*/record.json"))
    }
    assert rows == {
        (ablation, seed): "ok" for ablation in ("full", "trimodal__no_audio") for seed in (0, 1)
    }
    report = subprocess.run(
        [sys.executable, "-m", "cospeech.reporting", str(folder)], capture_output=True, text=True
    )
    assert report.returncode == 0, report.stderr
    assert "trimodal, no audio" in report.stdout
    assert "±" in report.stdout
    assert (folder / "report.html").stat().st_size > 10_000
