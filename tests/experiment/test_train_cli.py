"""The real command on the embedded corpus: what a user types, and what is left afterwards."""

import json
import subprocess
import sys

import pytest

from cospeech.metrics.encoder import load_encoder
from tests import command_line
from tests.command_line import SMALL

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def outputs(tmp_path_factory):
    """One outputs folder for the module: the corpus and the encoder are made once."""
    return tmp_path_factory.mktemp("outputs")


@pytest.fixture(scope="module")
def finished(outputs):
    done = command_line.run(outputs, *SMALL, "training.epochs=2", "model.adversarial_start_epoch=1")
    assert done.returncode == 0, done.stdout + done.stderr
    ((folder, record),) = command_line.records(outputs).items()
    return done, folder, record


def test_without_a_model_the_models_are_listed(outputs):
    done = command_line.run(outputs)
    assert done.returncode != 0
    for model in ("trimodal", "motion_autoencoder"):
        assert model in done.stderr
    assert "Traceback" not in done.stderr


def test_a_run_leaves_its_record(finished):
    _, folder, record = finished
    assert record["status"] == "ok"
    assert folder.name.startswith("trimodal-synthetic-full-s0-")
    assert [row["epoch"] for row in record["epochs"]] == [0, 1]
    for row in record["epochs"]:
        parts = row["val/fgd_mean_term"] + row["val/fgd_covariance_term"]
        assert row["val/fgd"] == pytest.approx(parts, rel=1e-4)
    assert record["objective"] == pytest.approx(
        min(row["val/fgd"] for row in record["epochs"]), rel=1e-5
    )
    assert record["config"]["model"]["hidden_size"] == 16
    assert len(record["encoder"]["sha256"]) == 64
    assert record["final"]["windows"]["fgd"] > 0
    assert record["final"]["recordings"]["windows"] > 0
    assert {"real_train", "mean_pose", "mismatched", "noise"} <= set(record["references"])
    for sample in record["samples"]:
        assert (folder / sample).stat().st_size > 10_000


def test_the_adversary_joins_at_its_epoch(finished):
    _, _, record = finished
    assert "train/discriminator" not in record["epochs"][0]
    assert record["epochs"][1]["train/discriminator"] > 0


def test_the_cost_is_said_at_the_start(finished):
    done, _, _ = finished
    assert "2 epochs x" in done.stdout
    assert "s per step" in done.stdout
    assert "add experiment=trimodal_quick" in done.stdout


def test_the_table_and_the_page_are_shown_at_the_end(finished):
    done, folder, _ = finished
    assert "real" in done.stdout
    assert str(folder / "samples" / "player.html") in done.stdout


def test_a_finished_run_is_judged_again_to_the_same_numbers(finished, outputs):
    _, folder, record = finished
    done = command_line.run(outputs, f"run={folder}", script="evaluate.py")
    assert done.returncode == 0, done.stdout + done.stderr
    (path,) = outputs.glob("evaluations/*/evaluation.json")
    values = json.loads(path.read_text())
    assert values["encoder"]["sha256"] == record["encoder"]["sha256"]
    assert values["final"]["recordings"]["fgd"] == pytest.approx(
        record["final"]["recordings"]["fgd"], rel=1e-5
    )


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
    assert (folder / "samples" / "player.html").is_file()
    assert (folder / "samples" / "clip_0.mp4").is_file()


def newest_autoencoder(outputs):
    folders = command_line.records(outputs)
    return [folder for folder in folders if folder.name.startswith("motion_autoencoder-")][-1]


def test_the_auto_encoder_trains_explicitly_and_becomes_the_stores_own(outputs):
    settings = ("model=motion_autoencoder", "data.minutes=4", "data.speakers=2")
    done = command_line.run(outputs, *settings, "metrics.encoder_epochs=2")
    assert done.returncode == 0, done.stdout + done.stderr
    (kept,) = outputs.glob("stores/*/encoders/autoencoder-e2-s0.pt")
    own = newest_autoencoder(outputs) / "encoder.pt"
    assert load_encoder(kept).sha256 == load_encoder(own).sha256
    # Trained otherwise than by default it stays with its run: the store's FGD scale is unchanged.
    before = kept.read_bytes()
    done = command_line.run(
        outputs, *settings, "metrics.encoder_epochs=2", "training.batch_size=16"
    )
    assert done.returncode == 0, done.stdout + done.stderr
    other = newest_autoencoder(outputs) / "encoder.pt"
    assert load_encoder(other).sha256 != load_encoder(own).sha256
    assert kept.read_bytes() == before


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
