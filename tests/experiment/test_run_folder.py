"""Which folder a run gets, and which one it goes on in."""

from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir

from cospeech.errors import ConfigError
from cospeech.experiment import run_folder, run_identity
from cospeech.reporting.record import write_json

CONF = Path(__file__).resolve().parents[2] / "conf"
PREFIX = "trimodal-synthetic-full-s0"


def config(*overrides):
    with initialize_config_dir(str(CONF), version_base="1.3"):
        return compose("train", overrides=["model=trimodal", *overrides])


def record(parent, time, cfg, **values):
    write_json(
        parent / f"{PREFIX}-{time}" / "record.json", {"identity": run_identity(cfg), **values}
    )


def test_a_new_run_gets_a_new_folder(tmp_path):
    cfg = config()
    first = run_folder("run", str(tmp_path), PREFIX, None, _root_=cfg)
    second = run_folder("run", str(tmp_path), PREFIX, None, _root_=cfg)
    assert Path(first).parent == tmp_path
    assert Path(first).name.startswith(PREFIX + "-")
    assert first != second


def test_last_is_the_newest_of_the_same_settings(tmp_path):
    full, debug = config(), config("debug=fast")
    record(tmp_path, "20260101-000000-000000", full)
    record(tmp_path, "20260102-000000-000000", full)
    record(tmp_path, "20260103-000000-000000", debug)  # newer, and another experiment
    found = run_folder("run", str(tmp_path), PREFIX, "last", _root_=full)
    assert Path(found).name.endswith("20260102-000000-000000")
    found = run_folder("run", str(tmp_path), PREFIX, "last", _root_=debug)
    assert Path(found).name.endswith("20260103-000000-000000")


def test_settings_named_by_numbers_and_by_words_have_an_identity():
    labels = "data.phase_labels={go: stroke, 1: none}"
    assert run_identity(config("data=mocap", "data.root=x", labels))


def test_a_run_may_be_made_longer_but_not_otherwise(tmp_path):
    record(tmp_path, "20260101-000000-000000", config())
    longer = config("training.epochs=200")
    assert run_folder("run", str(tmp_path), PREFIX, "last", _root_=longer)
    for change in ("model.learning_rate=1e-5", "training.batch_size=64", "data.minutes=10"):
        with pytest.raises(ConfigError, match="no run trimodal-synthetic-full-s0"):
            run_folder("run", str(tmp_path), PREFIX, "last", _root_=config(change))


def test_a_job_of_a_sweep_without_a_run_starts_one(tmp_path):
    name = run_folder("sweep", str(tmp_path), PREFIX, "last", _root_=config())
    assert "/" not in name
    assert name.startswith(PREFIX)


def test_jobs_of_a_sweep_find_their_own_runs(tmp_path):
    small, large = config("model.style_size=8"), config("model.style_size=16")
    record(tmp_path, "20260101-000000-000000", small)
    record(tmp_path, "20260101-000001-000000", large)
    names = [run_folder("sweep", str(tmp_path), PREFIX, "last", _root_=c) for c in (small, large)]
    assert names == [f"{PREFIX}-20260101-000000-000000", f"{PREFIX}-20260101-000001-000000"]
