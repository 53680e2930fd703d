"""The ablations as one multirun, and the paper's figures of them, as a user types them."""

import json

import pytest

from tests import command_line

pytestmark = pytest.mark.slow

TINY = (
    "experiment=multi_adversary_quick",
    "data.minutes=6",
    "data.speakers=2",
    "metrics.encoder_epochs=1",
    "model.hidden_size=16",
    "model.classifier_sizes={dense: 8, recurrent: 8, bidirectional: 8}",
    "model.classifier_steps=5",
    "model.pretraining_steps=5",
    "model.snapshots=2",
    "model.curriculum_batches=2",
    "model.motion_pretraining_steps=2",
    "model.adversarial_steps=4",
    "training.batch_size=8",
    "callbacks.render_samples.video=false",
    "callbacks.render_samples.clips=1",
    "logger=none",
)


def test_ablations_over_seeds_and_their_figures(tmp_path):
    done = command_line.run(
        tmp_path,
        "study=multi_adversary_ablations",
        *TINY,
        "ablation=full,multi_adversary__mse_only",
        "seed=0,1",
    )
    assert done.returncode == 0, done.stdout + done.stderr
    runs = [json.loads(path.read_text()) for path in tmp_path.glob("studies/*/*/record.json")]
    assert sorted((run["ablation"], run["seed"]) for run in runs) == [
        ("full", 0),
        ("full", 1),
        ("multi_adversary__mse_only", 0),
        ("multi_adversary__mse_only", 1),
    ]
    # What rows of one seed have in common is made once.
    products = sorted(path.name.split("-")[0] for path in (tmp_path / "products").iterdir())
    stages = ("classifier", "motion_pretraining", "phase_curriculum", "pretraining")
    assert products == sorted(2 * stages)

    study = ("study=multi_adversary_figures", f"runs={tmp_path}/studies")
    refused = command_line.run(tmp_path, *study, "checkpoint=newest", script="evaluate.py")
    assert refused.returncode == 1
    assert "checkpoint='newest' is not one of best, last" in refused.stderr
    drawn = command_line.run(tmp_path, *study, script="evaluate.py")
    assert drawn.returncode == 0, drawn.stdout + drawn.stderr
    (page,) = tmp_path.rglob("figures.html")
    figures = json.loads(page.with_name("figures.json").read_text())
    names = [system["name"] for system in figures["systems"]]
    assert names == ["real", "full", "mse_only"]
    assert [system["seeds"] for system in figures["systems"][1:]] == [[0, 1], [0, 1]]
    verdicts = {verdict["claim"]: verdict for verdict in figures["findings"]}
    slowest = verdicts["the mean squared error alone gives the slowest motion of all"]
    assert [part["seeds_that_agree"][1] for part in slowest["comparisons"]] == [2]
    assert "no_motion" in slowest["not_run"]
