"""Which finished runs a study of several takes together."""

import copy
from pathlib import Path
from types import SimpleNamespace

import pytest

from cospeech.errors import ConfigError, CospeechError
from cospeech.experiment import evaluate
from cospeech.experiment.comparing import _full_name, _require_one_study, _require_seeds
from tests.runs import Outputs, command

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
        model="method",
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


def test_runs_of_several_methods_and_experiments_may_be_compared():
    """Where what is compared are methods, a name is the model's and the ablation's."""
    runs = [
        run("a", "full", 0),
        run("b", "full", 1),
        run("c", "method__no_motion", 0, learning_rate=1e-3, experiment=None),
    ]
    assert [_full_name(each) for each in runs] == ["method", "method", "method no_motion"]
    _require_seeds(runs, _full_name, "judge it alone")
    with pytest.raises(ConfigError, match="a and d have different settings") as caught:
        _require_seeds([*runs, run("d", "full", 2, learning_rate=1e-3)], _full_name, "alone")
    assert caught.value.hint == "alone"


@pytest.mark.parametrize("given", ["run={a}", "runs={folder}", "runs=[{a},{b},{a}]"])
def test_a_study_of_methods_takes_a_run_a_folder_and_a_list(given, tmp_path, monkeypatch):
    outputs = Outputs(tmp_path / "outputs")
    a, b = (outputs.run(model, name=model) for model in ("trimodal", "multi_adversary"))
    asked = []
    monkeypatch.setattr(
        "cospeech.studies.caused_gestures", lambda systems, **others: asked.append(systems)
    )
    monkeypatch.setattr(
        "cospeech.experiment.comparing._loaded", lambda runs, name, *_: [name(r) for r in runs]
    )
    given = given.format(a=a, b=b, folder=a.parent)
    places = (f"outputs_dir={outputs.folder}", f"run_dir={tmp_path}")
    with command("evaluate", "study=caused_gestures", given, *places) as cfg:
        evaluate(cfg)
    expected = {"trimodal"} if given.startswith("run=") else {"trimodal", "multi_adversary"}
    assert sorted(asked[0]) == sorted(expected)


def test_a_study_of_methods_says_what_it_lacks(tmp_path):
    outputs = Outputs(tmp_path / "outputs")
    places = (f"outputs_dir={outputs.folder}", f"run_dir={tmp_path}", "study=caused_gestures")
    with (
        command("evaluate", *places) as cfg,
        pytest.raises(ConfigError, match="runs is not set"),
    ):
        evaluate(cfg)
    with (
        command("evaluate", *places, f"run={outputs.run()}") as cfg,
        pytest.raises(CospeechError, match="nothing is known of what caused its gestures"),
    ):
        evaluate(cfg)
