"""Which exceptions become a sentence, and what it says."""

import errno
import logging.config

import pytest
import torch
from hydra.errors import InstantiationException
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


def settings(tmp_path, command="train", **more):
    """What the advice looks at in a command's config."""
    own = {
        "train": {"ckpt_path": None, "training": {"batch_size": 64}},
        "prepare": {"training": {"batch_size": 64}},
        "evaluate": {"run": "a", "training": {"batch_size": 64}},
        "generate": {"run": "a"},
    }[command]
    data = {"store_dir": str(tmp_path / "stores"), "workers": None}
    return OmegaConf.create({"outputs_dir": str(tmp_path / "out"), "data": data, **own, **more})


def hint_of(number, file, cfg=None):
    told = as_sentence(OSError(number, "what it is", *([] if file is None else [str(file)])), cfg)
    if file is not None:
        assert told.problem == f"{file}: what it is"
    return told.hint


def test_what_cannot_be_written_goes_elsewhere_by_the_setting_of_its_place(tmp_path):
    cfg = settings(tmp_path, "prepare")
    for number in (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.ENAMETOOLONG):
        assert "outputs_dir=DIR" in hint_of(number, tmp_path / "out" / "runs" / "new", cfg)
        assert "data.store_dir=DIR" in hint_of(number, tmp_path / "stores" / "new", cfg)
        assert "DIR" not in (hint_of(number, tmp_path / "else" / "new", cfg) or "")
    cfg.data.store_dir = "${outputs_dir}/stores"
    in_both = hint_of(errno.EROFS, tmp_path / "out" / "stores" / "new", cfg)
    assert in_both == "write elsewhere with outputs_dir=DIR"


def test_what_cannot_be_read_is_not_to_be_written_elsewhere(tmp_path):
    (tmp_path / "out").mkdir()
    there = tmp_path / "out" / "best.ckpt"
    there.touch()
    cfg = settings(tmp_path)
    assert hint_of(errno.EACCES, there, cfg) == "change its permissions"
    assert hint_of(errno.EACCES, tmp_path / "data" / "a.bvh", cfg) == "change its permissions"
    assert "outputs_dir" in hint_of(errno.ENOSPC, there, cfg)
    assert hint_of(errno.EACCES, None, cfg) == "change its permissions"
    assert hint_of(errno.ENOENT, tmp_path / "out" / "absent", cfg) is None
    assert "ulimit" in hint_of(errno.EMFILE, there, cfg)


def test_a_file_where_a_folder_should_be_is_named_and_the_setting_that_gives_another(tmp_path):
    cfg = settings(tmp_path)
    (tmp_path / "out").write_text("")
    told = as_sentence(raised(lambda: (tmp_path / "out" / "runs" / "new").mkdir(parents=True)), cfg)
    assert told.problem == f"{tmp_path / 'out'} is a file, not a folder"
    assert told.hint == "give another folder: outputs_dir=DIR"
    (tmp_path / "stores").write_text("")
    told = as_sentence(raised(lambda: (tmp_path / "stores").mkdir(exist_ok=True)), cfg)
    assert told.problem == f"{tmp_path / 'stores'} is a file, not a folder"
    assert told.hint == "give another folder: data.store_dir=DIR"
    told = as_sentence(raised(lambda: (tmp_path / "out" / "a.wav").read_bytes()))
    assert (told.problem, told.hint) == (f"{tmp_path / 'out'} is a file, not a folder", None)
    told = as_sentence(raised(tmp_path.mkdir), cfg)  # a folder is none
    assert told.problem == f"{tmp_path}: File exists"


def test_only_a_training_goes_on_from_a_checkpoint(tmp_path):
    for command in ("train", "prepare", "evaluate", "generate"):
        cfg = settings(tmp_path, command)
        for file in (None, tmp_path / "out" / "new"):
            hint = hint_of(errno.ENOSPC, file, cfg)
            assert hint.startswith("free some space")
            assert ("ckpt_path=last" in hint) == (command == "train")


def test_the_place_of_a_file_without_a_name_is_told():
    cfg = OmegaConf.create({"outputs_dir": "out"})
    assert "outputs_dir=out" in as_sentence(OSError(errno.ENOSPC, "what it is"), cfg).problem


def test_what_an_object_of_the_settings_met_is_told_and_not_that_it_cannot_be_made(tmp_path):
    error = raised(lambda: instantiate({"_target_": "os.mkdir", "path": tmp_path / "a" / "b"}))
    assert as_sentence(error).problem == f"{tmp_path / 'a' / 'b'}: No such file or directory"
    error = raised(lambda: instantiate({"_target_": "importlib.import_module", "name": "nowhere"}))
    assert "Target 'importlib.import_module' is" in as_sentence(error).problem
    error = InstantiationException("Error in call to target 'x.Logger'\nfull_key: logger.x")
    error.__cause__ = ModuleNotFoundError("No module named 'x'")
    told = as_sentence(error)
    assert told.problem == "logger.x: ModuleNotFoundError: No module named 'x'"
    assert told.hint.startswith("install what it needs")


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


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        RuntimeError("[enforce fail] DefaultCPUAllocator: can't allocate memory: you tried\nmore"),
        torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2 GiB"),
    ],
)
def test_too_little_memory_is_one_line_with_what_takes_less_of_it(error, tmp_path):
    told = as_sentence(error, settings(tmp_path))
    assert "memory" in told.problem
    assert "\n" not in told.problem
    assert told.hint.endswith("training.batch_size=32")
    one_window = {"training": {"batch_size": 1}}
    assert as_sentence(error, settings(tmp_path, "train", **one_window)).hint is None
    assert as_sentence(error, settings(tmp_path, "prepare")).hint.endswith("data.workers=1")
    for command in ("evaluate", "generate"):
        assert as_sentence(error, settings(tmp_path, command)).hint is None
    assert as_sentence(error).hint is None


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
    assert as_sentence(error).hint is None
    cfg.ckpt_path = "last"
    assert as_sentence(error, cfg).hint == "leave ckpt_path out for a new run"
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
