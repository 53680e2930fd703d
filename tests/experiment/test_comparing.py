"""Which finished runs a study of several takes together."""

import copy
from pathlib import Path
from types import SimpleNamespace

import pytest
from omegaconf import OmegaConf

from cospeech.errors import ConfigError
from cospeech.experiment import comparing
from cospeech.experiment.comparing import _require_one_study, compare_runs
from cospeech.methods.base import GestureMethod

CONFIG = {
    "model": {"learning_rate": 1e-4, "products_dir": "a"},
    "training": {"batch_size": 8},
}


def run(folder, ablation, seed, **changes):
    config = copy.deepcopy(CONFIG)
    experiment = changes.pop("experiment", "quick")
    config["model"] |= changes
    return SimpleNamespace(
        folder=Path(folder),
        ablation=ablation,
        seed=seed,
        config=config,
        experiment=experiment,
        method=object,
    )


def test_ablations_and_seeds_may_differ():
    one_study = [
        run("a", "full", 0),
        run("b", "full", 1, products_dir="elsewhere"),
        run("c", "method__no_motion", 0, learning_rate=1e-3),
    ]
    _require_one_study(one_study)
    # All of them were looked at: a twin of the last is refused.
    with pytest.raises(ConfigError, match="c and d are both no_motion, seed 0"):
        _require_one_study([*one_study, run("d", "method__no_motion", 0, learning_rate=1e-3)])


@pytest.mark.parametrize(
    ("second", "message"),
    [
        (run("b", "full", 0), "a and b are both full, seed 0"),
        (run("b", "full", 1, learning_rate=1e-3), "a and b have different settings"),
        (
            run("b", "x__no_motion", 0, experiment=None),
            "a is of experiment=quick, b of experiment=None",
        ),
    ],
)
def test_what_is_no_row_of_the_same_study_is_refused(second, message):
    with pytest.raises(ConfigError, match=message) as caught:
        _require_one_study([run("a", "full", 0), second])
    assert "runs=outputs/studies/NAME" in caught.value.hint


def finished(folder, ablation, method):
    found = run(folder, ablation, 0)
    found.method, found.fingerprint = method, "f"
    found.load = lambda store: (folder, store)
    return found


def test_a_study_that_judges_no_phases_gets_the_runs_of_any_method(monkeypatch, tmp_path):
    runs = [finished("a", "full", GestureMethod), finished("b", "x__no_text", GestureMethod)]
    judge = finished("c", "full", object)  # makes no motion
    monkeypatch.setattr(comparing, "_finished_below", lambda *_: [*runs, judge])
    store = SimpleNamespace(fingerprint="f")
    monkeypatch.setattr(comparing, "corpus_of", lambda *_: store)

    def study(store, systems, split, folder, about):
        return [(one.name, one.seed, one.method) for one in systems], split, dict(about)["runs"]

    monkeypatch.setattr(comparing, "build", lambda _: study)
    cfg = OmegaConf.create(
        {"runs": "r", "checkpoint": "best", "split": "val", "study_task": {"_target_": "x"}}
    )
    systems, split, names = compare_runs(cfg, tmp_path)
    assert systems == [("full", 0, ("a", store)), ("no_text", 0, ("b", store))]
    assert (split, names) == ("val", "a, b")
    monkeypatch.setattr(comparing, "_finished_below", lambda *_: [judge])
    with pytest.raises(ConfigError, match="of 1 finished runs none makes motion"):
        compare_runs(cfg, tmp_path)
