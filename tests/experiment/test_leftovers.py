"""What a failed command leaves: nothing, unless something in it is worth keeping."""

import logging

import pytest
from filelock import FileLock

from cospeech.experiment.leftovers import remove_leftovers
from cospeech.reporting.record import write_json


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "runs" / "trimodal-1"
    (folder / ".hydra").mkdir(parents=True)
    (folder / ".hydra" / "config.yaml").write_text("a: 1\n")
    (folder / "train.log").write_text("error\n")
    return folder


def test_settings_and_a_log_alone_go(folder):
    assert remove_leftovers(folder)
    assert not folder.exists()


def test_the_log_that_is_open_is_closed(folder):
    handler = logging.FileHandler(folder / "train.log")
    logging.getLogger().addHandler(handler)
    try:
        assert remove_leftovers(folder)
        assert handler not in logging.getLogger().handlers
    finally:
        logging.getLogger().removeHandler(handler)


def test_a_run_that_failed_before_its_first_epoch_goes(folder):
    write_json(folder / "record.json", {"status": "failed", "epochs": []})
    (folder / ".lock").touch()
    (folder / "checkpoints").mkdir()
    (folder / "csv" / "version_0").mkdir(parents=True)
    (folder / "csv" / "version_0" / "hparams.yaml").write_text("seed: 0\n")
    assert remove_leftovers(folder)


@pytest.mark.parametrize(
    "kept",
    [
        ("record.json", '{"status": "failed", "epochs": [{"epoch": 0}]}'),
        ("record.json", '{"status": "interrupted", "epochs": []}'),
        ("record.json", '{"status": "ok"'),
        ("checkpoints/last.ckpt", "weights"),
        ("nan_batch.json", "{}"),
        ("evaluation.json", "{}"),
        ("notes.txt", "mine"),
    ],
    ids=lambda kept: f"{kept[0]} {kept[1][:40]}",
)
def test_what_is_worth_something_stays(folder, kept):
    name, text = kept
    (folder / name).parent.mkdir(exist_ok=True)
    (folder / name).write_text(text)
    assert not remove_leftovers(folder)
    assert (folder / name).read_text() == text
    assert (folder / "train.log").exists()


def test_a_folder_that_another_process_is_at_work_in_stays(folder):
    with FileLock(str(folder / ".lock")):
        assert not remove_leftovers(folder)
    assert (folder / "train.log").exists()


def test_a_folder_that_is_not_of_a_command_stays(tmp_path):
    (tmp_path / "train.log").write_text("mine\n")
    assert not remove_leftovers(tmp_path)
    assert (tmp_path / "train.log").exists()
