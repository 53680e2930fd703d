"""Two processes train the same kind of run as one, and agree on what they evaluate."""

import json

import pytest
import torch

from cospeech.corpus.store import Store
from cospeech.corpus.window_loader import open_windows
from cospeech.corpus.windows import WindowDataset
from cospeech.evaluation import EpochEvaluation, EvaluationFields, standard_catalogue
from cospeech.methods.multi_adversary import MultiAdversary
from cospeech.methods.multi_adversary.tally import Tally
from cospeech.methods.trimodal import Trimodal
from cospeech.metrics.encoder import load_encoder
from tests import command_line
from tests.command_line import SMALL
from tests.multi_adversary_runs import TINY

pytestmark = pytest.mark.slow


def test_two_processes_go_through_the_stages_together(tmp_path):
    done = command_line.run(
        tmp_path,
        *TINY,
        "model=multi_adversary",
        "trainer=ddp",
        "training.epochs=20",
        "model.run=1",
    )
    assert done.returncode == 0, done.stdout + done.stderr
    ((folder, record),) = command_line.records(tmp_path).items()
    assert record["status"] == "ok"
    assert record["epochs"][-1]["train/stage"] == 5
    stages = {path.name.split("-")[0] for path in (tmp_path / "products").iterdir()}
    assert len(stages) == 4
    # Selected by all validation windows, as one process counts them.
    (manifest,) = tmp_path.glob("stores/*/manifest.json")
    method = MultiAdversary.load_from_checkpoint(
        folder / "checkpoints" / "last.ckpt", weights_only=True
    ).eval()
    windows = open_windows(Store(manifest.parent), "val", method)
    batch = windows.batch(range(len(windows)))
    wrists = [method.layout.roles.index(f"{side}_wrist") for side in ("left", "right")]
    tally = Tally(wrists, 20.0, None)
    tally.add("generated", method.sample_joints(batch), None)
    tally.add("real", batch.joints, None)
    assert record["epochs"][-1]["val/wrist_speed_gap"] == pytest.approx(tally.gap(), rel=1e-3)


def test_two_processes_share_the_windows_and_the_metrics(tmp_path):
    done = command_line.run(
        tmp_path,
        *SMALL,
        "metrics.encoder=trained",
        "metrics.encoder_epochs=1",
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
    catalogue = standard_catalogue()
    fields = EvaluationFields(dataset, catalogue.needs)
    evaluation = EpochEvaluation(catalogue, load_encoder(encoder), fields, torch.device("cpu"))
    evaluation.update(method.sample(batch, torch.Generator()), batch)
    for name, value in evaluation.compute().items():
        found = record["final"]["windows"][name]
        assert found == pytest.approx(value.item(), rel=1e-3, abs=1e-6), name
