"""Which folder a run gets, and which one it goes on in."""

import json
from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir

from cospeech.errors import ConfigError, InputFileError
from cospeech.experiment import run, run_folder, run_identity
from cospeech.experiment.folders import changed_settings, command_folder
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
    changes = ("seed=1", "model.learning_rate=1e-5", "training.batch_size=64", "data.minutes=10")
    for change in (*changes, "metrics.encoder_seed=1"):
        with pytest.raises(ConfigError, match="no run trimodal-synthetic-full-s0"):
            run_folder("run", str(tmp_path), PREFIX, "last", _root_=config(change))


def test_workers_and_the_place_of_stores_may_differ(tmp_path):
    record(tmp_path, "20260101-000000-000000", config())
    other = config("data.workers=1", "data.store_dir=elsewhere")
    assert run_folder("run", str(tmp_path), PREFIX, "last", _root_=other)
    write_json(tmp_path / "record.json", {"config": {"data": {"workers": 4, "minutes": 1}}})
    told = changed_settings(other, tmp_path / "record.json")
    assert any(line.startswith("data.minutes was 1") for line in told)
    assert not any("workers" in line or "store_dir" in line for line in told)


def test_a_run_may_go_on_with_fewer_metrics(tmp_path):
    record(tmp_path, "20260101-000000-000000", config())
    fewer = config("~metrics.catalogue.joint_mae")
    assert run_folder("run", str(tmp_path), PREFIX, "last", _root_=fewer)


@pytest.mark.parametrize("content", ["", '{"identity": "3', "[]"])
def test_a_damaged_record_is_named_where_no_other_run_fits(tmp_path, content):
    path = tmp_path / f"{PREFIX}-20260102-000000-000000" / "record.json"
    path.parent.mkdir()
    path.write_text(content)
    with pytest.raises(ConfigError, match=r"record\.json is damaged") as error:
        run_folder("run", str(tmp_path), PREFIX, "last", _root_=config())
    assert str(path) in error.value.problem
    checkpoint = path.parent / "checkpoints" / "last.ckpt"
    assert error.value.hint.endswith(f"ckpt_path={checkpoint}")
    record(tmp_path, "20260101-000000-000000", config())
    found = run_folder("run", str(tmp_path), PREFIX, "last", _root_=config())
    assert found.endswith("20260101-000000-000000")


def test_a_record_with_a_wrong_value_is_not_gone_on_with_nor_written_over(tmp_path):
    record(tmp_path, "20260102-000000-000000", config(), seed="0", epochs=[{"epoch": 0}])
    with pytest.raises(ConfigError, match=r"record\.json is damaged"):
        run_folder("run", str(tmp_path), PREFIX, "last", _root_=config())
    (path,) = tmp_path.glob("*/record.json")
    before = path.read_text()
    cfg = config("ckpt_path=last", f"run_dir={path.parent}")
    cfg.choices = {"model": "trimodal", "data": "synthetic", "ablation": "full"}
    cfg.run_prefix = PREFIX
    errors = []
    for _ in range(2):
        with pytest.raises(InputFileError, match="seed is a text, not a whole number") as caught:
            run(cfg)
        errors.append(caught)  # which holds its frames, and these no lock
    assert path.read_text() == before


@pytest.mark.parametrize("null", ["fit", "config", "objective"])
def test_a_null_in_a_record_is_as_good_as_nothing(tmp_path, null):
    values = {"status": "ok", "fit": {"asked": 2, "ended": 2}}
    values["config"] = {"training": {"epochs": 2}}
    write_json(tmp_path / "record.json", {**values, null: None})
    cfg = config("training.epochs=2", "ckpt_path=last", f"run_dir={tmp_path}")
    if null != "config":
        assert run(cfg).record["status"] == "ok"
        return
    cfg.training.epochs = 1
    with pytest.raises(ConfigError, match="has 2 epochs already"):
        run(cfg)


def test_a_finished_run_with_more_epochs_than_asked_for_is_refused(tmp_path):
    record = {
        "status": "ok",
        "fit": {"asked": 2, "ended": 2},
        "config": {"training": {"epochs": 2}},
    }
    write_json(tmp_path / "record.json", record)
    cfg = config("training.epochs=1", "ckpt_path=last", f"run_dir={tmp_path}")
    with pytest.raises(ConfigError, match="has 2 epochs already"):
        run(cfg)
    assert json.loads((tmp_path / "record.json").read_text()) == record
    cfg.training.epochs = 2
    assert run(cfg).record["status"] == "ok"


@pytest.mark.parametrize(
    ("command", "given"),
    [("train", ["model=trimodal", "run_prefix=run"]), ("generate", []), ("evaluate", [])],
)
def test_everything_of_a_command_goes_where_it_is_told_to(tmp_path, command, given):
    """The log and Hydra's settings too, which go to Hydra's folder."""
    with initialize_config_dir(str(CONF), version_base="1.3"):
        cfg = compose(command, [*given, f"run_dir={tmp_path / 'mine'}"], return_hydra_config=True)
    assert cfg.hydra.run.dir == cfg.run_dir == str(tmp_path / "mine")
    assert command_folder("its own", _root_=config()) == "its own"


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
