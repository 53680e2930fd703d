"""Two processes train the same kind of run as one, and agree on what they evaluate."""

import json

import pytest

from tests import command_line
from tests.command_line import SMALL

pytestmark = pytest.mark.slow


def test_two_processes_share_the_windows_and_the_metrics(tmp_path):
    done = command_line.run(
        tmp_path, *SMALL, "training.epochs=2", "model.adversarial_start_epoch=1", "trainer=ddp"
    )
    assert done.returncode == 0, done.stdout + done.stderr
    ((folder, record),) = command_line.records(tmp_path).items()
    assert record["status"] == "ok"
    assert [row["epoch"] for row in record["epochs"]] == [0, 1]
    alone = command_line.run(
        tmp_path,
        f"run={folder}",
        "metrics.encoder_epochs=1",
        script="evaluate.py",
    )
    assert alone.returncode == 0, alone.stdout + alone.stderr
    (path,) = tmp_path.glob("evaluations/*/evaluation.json")
    values = json.loads(path.read_text())
    assert values["final"]["recordings"]["fgd"] == pytest.approx(
        record["final"]["recordings"]["fgd"], rel=1e-5
    )
