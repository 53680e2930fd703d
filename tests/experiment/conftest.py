"""Finished runs, each made once, in this process, on one small ready corpus."""

import contextlib
import functools
import io
from dataclasses import dataclass

import pytest
from hydra import compose, initialize_config_dir

from cospeech.experiment import RunResult
from cospeech.experiment.building import build, chosen_encoder
from cospeech.experiment.finished_run import load
from tests.runs import CONF
from tests.trainings import CORPUS, SETTINGS, train


@dataclass
class Finished:
    """A run that came to its end."""

    result: RunResult
    printed: str

    @property
    def folder(self):
        return self.result.folder

    @property
    def record(self):
        return self.result.record

    def method(self, checkpoint="best"):
        return load(self.folder, checkpoint)


class Ready:
    """A folder of outputs that holds a small embedded corpus and an encoder of it."""

    def __init__(self, outputs):
        self.outputs = outputs
        with initialize_config_dir(str(CONF), version_base="1.3"):
            cfg = compose("evaluate", [f"outputs_dir={outputs}", *CORPUS])
        self.store = build(cfg.data).prepare_store()
        self.encoder = chosen_encoder(self.store, cfg.metrics)

    @functools.cache  # noqa: B019 (there is one of it)
    def finished(self, name):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            result = train(self.outputs, *SETTINGS[name])
        return Finished(result, printed.getvalue())


@pytest.fixture(scope="session")
def ready(tmp_path_factory):
    return Ready(tmp_path_factory.mktemp("outputs"))
