"""Two processes train the same kind of run as one, and agree on what they evaluate."""

import json

import pytest
import torch

from cospeech.corpus.store import Store
from cospeech.corpus.windows import WindowDataset
from cospeech.methods.trimodal import Trimodal
from cospeech.metrics.encoder import load_encoder
from cospeech.metrics.fgd import FrechetGestureDistance
from tests import command_line
from tests.command_line import SMALL

pytestmark = pytest.mark.slow


def test_two_processes_share_the_windows_and_the_metrics(tmp_path):
    done = command_line.run(
        tmp_path,
        *SMALL,
        "training.epochs=2",
        "model.adversarial_start_epoch=1",
        "model.mean_style=true",
        "trainer=ddp",
    )
    assert done.returncode == 0, done.stdout + done.stderr
    ((folder, record),) = command_line.records(tmp_path).items()
    assert record["status"] == "ok"
    assert [row["epoch"] for row in record["epochs"]] == [0, 1]
    alone = command_line.run(
        tmp_path,
        f"run={folder}",
        script="evaluate.py",
    )
    assert alone.returncode == 0, alone.stdout + alone.stderr
    (path,) = tmp_path.glob("evaluations/*/evaluation.json")
    values = json.loads(path.read_text())
    assert values["final"]["recordings"]["fgd"] == pytest.approx(
        record["final"]["recordings"]["fgd"], rel=1e-5
    )

    # Each process judged its share of the test windows; together that is one process's number.
    (path,) = tmp_path.glob("stores/*/manifest.json")
    store = Store(path.parent)
    method = Trimodal.load_from_checkpoint(folder / "checkpoints" / "best.ckpt", weights_only=True)
    method.eval()
    dataset = WindowDataset(store, "test", method.window, method.needs)
    batch = dataset.batch(range(len(dataset)))
    (encoder,) = store.path.glob("encoders/*.pt")
    distance = FrechetGestureDistance(load_encoder(encoder))
    distance.update(batch.positions, real=True)
    distance.update(method.sample(batch, torch.Generator()), real=False)
    assert record["final"]["windows"]["fgd"] == pytest.approx(distance.compute().item(), rel=1e-3)
