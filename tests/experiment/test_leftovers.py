"""What a failed command leaves: nothing, unless something in it is worth keeping."""

import logging
import os

import pytest
from filelock import FileLock

from cospeech.experiment.leftovers import remove_leftovers
from cospeech.reporting.record import write_json


@pytest.fixture
def folder(tmp_path):
    """The folder that Hydra makes, with the log of this process."""
    folder = tmp_path / "runs" / "trimodal-1"
    (folder / ".hydra").mkdir(parents=True)
    (folder / ".hydra" / "config.yaml").write_text("a: 1\n")
    handler = logging.FileHandler(folder / "train.log")
    logging.getLogger().addHandler(handler)
    yield folder
    logging.getLogger().removeHandler(handler)
    handler.close()


def age(path):
    """Make a file as old as one from before this process."""
    os.utime(path, (0, 0))


def test_settings_and_the_log_alone_go(folder):
    remove_leftovers(folder)
    assert not folder.exists()
    assert folder.parent.exists()
    assert not [h for h in logging.getLogger().handlers if getattr(h, "baseFilename", "") == folder]


def test_a_run_that_failed_before_its_first_epoch_goes(folder):
    write_json(folder / "record.json", {"status": "failed", "epochs": []})
    (folder / ".lock").touch()
    (folder / ".record.json.0123abcd.part").touch()
    (folder / "checkpoints").mkdir()
    (folder / "csv" / "version_0").mkdir(parents=True)
    (folder / "csv" / "version_0" / "hparams.yaml").write_text("seed: 0\n")
    (folder / "wandb").mkdir()
    (folder / "wandb" / "latest-run").symlink_to(folder / "wandb")
    remove_leftovers(folder)
    assert not folder.exists()


def test_a_folder_that_the_user_named_loses_only_what_the_command_wrote(tmp_path):
    write_json(tmp_path / "record.json", {"status": "failed", "epochs": []})
    (tmp_path / ".lock").touch()
    remove_leftovers(tmp_path, itself=False)
    assert tmp_path.exists()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "name", ["csv/mine.csv", "tensorboard/a/b", ".hydra/x.yaml", "record.json"]
)
def test_what_is_older_than_the_process_stays(folder, name):
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    write_json(folder / name, {"status": "failed", "epochs": []})
    age(folder / name)
    remove_leftovers(folder)
    assert (folder / name).exists()
    assert (folder / "train.log").exists()


def test_an_empty_folder_from_before_stays(folder):
    (folder / "drafts").mkdir()
    age(folder / "drafts")
    remove_leftovers(folder)
    assert (folder / "drafts").exists()


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
        ("notes.log", "mine"),
    ],
    ids=lambda kept: f"{kept[0]} {kept[1][:40]}",
)
def test_what_is_worth_something_stays(folder, kept):
    name, text = kept
    (folder / name).parent.mkdir(exist_ok=True)
    (folder / name).write_text(text)
    remove_leftovers(folder)
    assert (folder / name).read_text() == text
    assert (folder / "train.log").exists()


def test_a_folder_that_another_process_is_at_work_in_stays(folder):
    with FileLock(str(folder / ".lock")):
        remove_leftovers(folder)
    assert (folder / "train.log").exists()


def test_a_folder_that_is_not_of_a_command_stays(tmp_path):
    (tmp_path / "train.log").write_text("mine\n")
    remove_leftovers(tmp_path)
    assert (tmp_path / "train.log").exists()
