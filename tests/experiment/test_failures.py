"""Which exceptions become a sentence, and what it says."""

import errno
import logging.config

import pytest
import torch
from hydra.utils import instantiate
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from cospeech.errors import ConfigError, InputFileError
from cospeech.experiment.command_line import _settings_of_place
from cospeech.experiment.failures import as_sentence
from cospeech.experiment.folders import changed_settings
from cospeech.reporting.record import write_json


def raised(action) -> BaseException:
    with pytest.raises(Exception) as error:  # noqa: PT011
        action()
    return error.value


def test_an_error_of_ours_inside_a_constructor_comes_out_as_it_is():
    target = {"_target_": "cospeech.errors.ConfigError"}
    assert as_sentence(raised(lambda: instantiate(target))).problem.startswith(
        "a setting: TypeError"
    )
    ours = InputFileError("file.bvh", "is empty")
    wrapped = RuntimeError("unexpected")
    wrapped.__cause__ = ours
    assert as_sentence(ours) is ours
    assert as_sentence(wrapped) is None  # who wraps it says that it is something else


def test_errors_of_settings_name_the_key():
    cfg = OmegaConf.create({"a": {"root": "???", "b": "${nowhere}"}})
    OmegaConf.set_struct(cfg, True)
    for action, key in (
        (lambda: cfg.a.root, "a.root"),
        (lambda: cfg.a.b, "a.b"),
        (lambda: cfg.a.c, "a.c"),
        (lambda: instantiate({"_target_": "nowhere.X"}), "nowhere.X"),
    ):
        error = raised(action)
        told = as_sentence(error)
        assert isinstance(told, ConfigError)
        assert key in told.problem
        assert "\n" not in told.problem
    assert isinstance(raised(lambda: cfg.a.c), OmegaConfBaseException)


@pytest.mark.parametrize(
    ("number", "hint"),
    [(errno.ENOSPC, "free some space"), (errno.EROFS, "outputs_dir=DIR"), (errno.EMFILE, "ulimit")],
)
def test_errors_of_the_system_say_what_and_where(number, hint):
    told = as_sentence(OSError(number, "what it is", "some/file"))
    assert told.problem == "some/file: what it is"
    assert hint in told.hint
    cfg = OmegaConf.create({"outputs_dir": "out"})
    assert "outputs_dir=out" in as_sentence(OSError(number, "what it is"), cfg).problem


def test_a_log_that_cannot_be_opened_is_named(tmp_path):
    file = {"class": "logging.FileHandler", "filename": str(tmp_path / "absent" / "train.log")}
    config = {"version": 1, "incremental": False, "handlers": {"file": file}}
    told = as_sentence(raised(lambda: logging.config.dictConfig(config)))
    assert told.problem == f"{file['filename']}: No such file or directory"


def test_the_place_is_named_of_a_command_that_ended_before_its_config(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for overrides, place in (
        (["model=knn"], "outputs"),
        (["outputs_dir=a", "outputs_dir='b c'"], "b c"),
    ):
        told = as_sentence(OSError(errno.ENOSPC, "full"), _settings_of_place(overrides))
        assert told.problem == f"below outputs_dir={tmp_path / place}: full"


def test_too_little_memory_is_one_line():
    for error in (
        MemoryError(),
        RuntimeError("[enforce fail] DefaultCPUAllocator: can't allocate memory: you tried\nmore"),
        torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2 GiB"),
    ):
        told = as_sentence(error)
        assert "memory" in told.problem
        assert "\n" not in told.problem
        assert "training.batch_size" in told.hint


def test_a_bug_stays_one():
    assert as_sentence(KeyError("x")) is None
    assert as_sentence(RuntimeError("mat1 and mat2 shapes cannot be multiplied")) is None


def config(**model):
    return OmegaConf.create(
        {
            "model": {"layers": 2, "context": "both", **model},
            "data": {"minutes": 4, "batch_size": "${training.batch_size}"},
            "training": {"epochs": 5, "batch_size": 8},
            "metrics": {"encoder": "trained"},
            "seed": 0,
        }
    )


def test_a_checkpoint_of_another_network_names_what_changed(tmp_path, monkeypatch):
    record = tmp_path / "run" / "record.json"
    write_json(record, {"config": OmegaConf.to_container(config(layers=4), resolve=True)})
    cfg = config(extra=1)
    cfg.ckpt_path = str(tmp_path / "run" / "checkpoints" / "last.ckpt")
    small, large = torch.nn.Linear(2, 2), torch.nn.Linear(3, 2)
    error = raised(lambda: small.load_state_dict(large.state_dict()))
    told = as_sentence(error, cfg)
    assert "size mismatch for weight" in told.problem
    assert "model.layers was 4, is 2" in told.problem
    assert "model.extra was absent, is 1" in told.problem
    assert "\n" not in told.problem
    assert "another network" in as_sentence(error).problem
    monkeypatch.chdir(tmp_path / "run")
    for path in ("checkpoints/last.ckpt", "../run/checkpoints/last.ckpt"):
        cfg.ckpt_path = path
        assert "model.layers was 4, is 2" in as_sentence(error, cfg).problem
    for path in ("x.ckpt", "/x.ckpt"):
        cfg.ckpt_path = path
        assert f"ckpt_path={path}: its weights" in as_sentence(error, cfg).problem


@pytest.mark.parametrize(
    "content", ["", "[]", "{", '{"config": 3}', '{"config": {"model": [1]}}', '{"config": null}']
)
def test_a_damaged_record_tells_of_its_difference_or_of_none(tmp_path, content):
    path = tmp_path / "record.json"
    path.write_text(content)
    assert all(" was " in line for line in changed_settings(config(), path))
    assert changed_settings(config(), tmp_path / "absent.json") == changed_settings(
        config(), path
    ) or ("[1]" in content)


def test_what_follows_from_other_settings_and_the_length_is_no_difference(tmp_path):
    path = tmp_path / "record.json"
    cfg = config()
    write_json(path, {"config": OmegaConf.to_container(cfg, resolve=True)})
    cfg.training.epochs = 100
    assert changed_settings(cfg, path) == []
    cfg.training.batch_size = 16
    assert changed_settings(cfg, path) == ["training.batch_size was 8, is 16"]
