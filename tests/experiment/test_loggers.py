"""The same metric names reach the optional dashboards, without an account or a network."""

import sqlite3

import pytest

from tests import command_line

pytestmark = pytest.mark.slow

EXPECTED = {
    "val/fgd",
    "val/fgd_mean_term",
    "val/fgd_covariance_term",
    "val/joint_mae",
    "train/loss",
    "test/fgd",
    "test_recordings/fgd",
    "test_recordings/joint_mae",
}
CHOSEN = {"model": "trimodal", "data": "synthetic", "ablation": "full", "experiment": None}
RUN = ("model=trimodal", "debug=fast", "model.hidden_size=16", "model.layers=1")


@pytest.fixture(scope="module")
def outputs(tmp_path_factory):
    return tmp_path_factory.mktemp("outputs")


def newest(outputs):
    return list(command_line.records(outputs))[-1]


def test_wandb_works_offline_without_an_account(outputs):
    pytest.importorskip("wandb")
    done = command_line.run(outputs, *RUN, "logger=wandb")
    assert done.returncode == 0, done.stdout + done.stderr
    (log,) = newest(outputs).glob("wandb/offline-run-*/run-*.wandb")
    content = log.read_bytes()
    for name in EXPECTED:
        assert name.encode() in content
    assert b"trimodal" in content
    assert b"runtime.choices" not in content


def test_mlflow_keeps_a_local_store(outputs):
    pytest.importorskip("mlflow")
    done = command_line.run(outputs, *RUN, "logger=mlflow")
    assert done.returncode == 0, done.stdout + done.stderr
    with sqlite3.connect(outputs / "mlflow.db") as database:
        names = {row[0] for row in database.execute("select distinct key from metrics")}
        settings = dict(database.execute("select key, value from params").fetchall())
    assert names >= EXPECTED
    assert {key: settings[key] for key in CHOSEN} == {k: str(v) for k, v in CHOSEN.items()}
