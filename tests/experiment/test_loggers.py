"""The same metric names reach every dashboard, without an account or a network."""

import csv
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
}
RUN = ("model=trimodal", "debug=fast", "model.hidden_size=16", "model.layers=1", "test=false")


@pytest.fixture(scope="module")
def outputs(tmp_path_factory):
    return tmp_path_factory.mktemp("outputs")


def newest(outputs):
    return list(command_line.records(outputs))[-1]


def test_csv_and_tensorboard_by_default(outputs):
    done = command_line.run(outputs, *RUN)
    assert done.returncode == 0, done.stdout + done.stderr
    folder = newest(outputs)
    with (folder / "csv" / "version_0" / "metrics.csv").open() as file:
        header = next(csv.reader(file))
    assert set(header) >= EXPECTED
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    events = EventAccumulator(str(folder / "tensorboard"))
    events.Reload()
    assert set(events.Tags()["scalars"]) >= EXPECTED


def test_wandb_works_offline_without_an_account(outputs):
    pytest.importorskip("wandb")
    done = command_line.run(outputs, *RUN, "logger=wandb")
    assert done.returncode == 0, done.stdout + done.stderr
    (log,) = newest(outputs).glob("wandb/offline-run-*/run-*.wandb")
    content = log.read_bytes()
    for name in EXPECTED:
        assert name.encode() in content


def test_mlflow_keeps_a_local_store(outputs):
    pytest.importorskip("mlflow")
    done = command_line.run(outputs, *RUN, "logger=mlflow")
    assert done.returncode == 0, done.stdout + done.stderr
    with sqlite3.connect(outputs / "mlflow.db") as database:
        names = {row[0] for row in database.execute("select distinct key from metrics")}
    assert names >= EXPECTED
