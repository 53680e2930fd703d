"""Which finished runs a study of several takes together."""

import copy
from pathlib import Path
from types import SimpleNamespace

import pytest

from cospeech.errors import ConfigError
from cospeech.experiment.comparing import _require_one_study

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
