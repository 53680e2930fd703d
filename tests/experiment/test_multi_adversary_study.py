"""The ablations as one multirun, and the paper's figures of them, as a user types them."""

import json
import shutil

import pytest
import torch

from tests import command_line
from tests.multi_adversary_runs import TINY

pytestmark = pytest.mark.slow


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
    verdicts = {verdict["claim"][:41]: verdict for verdict in figures["findings"]}
    slow = verdicts["the mean squared error alone gives slow, "]
    assert [part["seeds_that_agree"][1] for part in slow["comparisons"]] == [2, 2]
    assert "no_motion" in slow["not_run"]
    assert figures["facts"]["checkpoints"] == "last"
    assert "full, seed 0" in figures["facts"]["phases judged by"]

    # Runs that don't belong together, or aren't at their end, are refused.
    (folder,) = (tmp_path / "studies").glob("*/multi_adversary-synthetic-full-s0-*")
    shutil.copytree(folder, folder.with_name("again"))
    refused = command_line.run(tmp_path, *study, script="evaluate.py")
    assert refused.returncode == 1
    assert "are both full, seed 0" in refused.stderr
    shutil.rmtree(folder.with_name("again"))
    last = folder / "checkpoints" / "last.ckpt"
    content = torch.load(last, weights_only=True)
    content["stages"] |= {"stage": "adversarial", "step": 1}
    torch.save(content, last)
    refused = command_line.run(tmp_path, *study, script="evaluate.py")
    assert refused.returncode == 1
    assert "3 steps of its schedule are left" in refused.stderr
