"""A method of somebody's own is judged, or refused by name before anything slow begins."""

import json

import numpy as np
import pytest
import torch

from cospeech.corpus.features.positions import at_evaluation_rate
from cospeech.corpus.store import Store
from cospeech.corpus.windows import WindowSpec
from cospeech.errors import ConfigError, CospeechError
from cospeech.experiment import judgeable, run
from cospeech.experiment.failures import as_sentence
from cospeech.experiment.judgeable import refuse_unjudgeable
from cospeech.methods.fitted import FittedWithoutSteps
from cospeech.methods.streams import WholeUtterance
from cospeech.metrics.evaluation_windows import EvaluationWindows
from cospeech.metrics.fgd import FrechetGestureDistance
from cospeech.metrics.window_metric import VALUE
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from data_modules.base import StoreDataModule
from tests.runs import Outputs, command
from tests.trainings import train

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning", "ignore::FutureWarning")


class Still(FittedWithoutSteps):
    """One pose throughout, at 20 fps; it reads nothing that the evaluation reads."""

    window = WindowSpec(fps=20.0, frames=60, seed_frames=0, stride=60)
    needs = frozenset({"energy"})

    def __init__(self, corpus, width=0.2):
        super().__init__()
        self.speakers = list(corpus["speakers"])
        self.save_hyperparameters()
        self.register_buffer("pose", torch.linspace(0, width, 30).reshape(10, 3))

    def fit_to_corpus(self):
        pass

    def sample(self, batch, generator):
        poses = self.pose.expand(*batch.require("energy").shape[:2], 10, 3)
        return at_evaluation_rate(poses, self.window.fps)

    def begin(self, speaker, controls, seed_motion, generator):
        return WholeUtterance(self._still)

    def _still(self, speech):
        frames = int(np.ceil(speech.duration * 20 - 1e-9))
        return Motion(UPPER_BODY, 20.0, self.pose.expand(frames, 10, 3).numpy().copy())


class Short(Still):
    window = WindowSpec(fps=20.0, frames=44, seed_frames=0, stride=44)


class LongEnough(Still):
    window = WindowSpec(fps=20.0, frames=45, seed_frames=0, stride=45)


class Windowless(FittedWithoutSteps):
    fit_to_corpus = sample = begin = None

    def __init__(self, corpus):
        super().__init__()


class Unsaved(Still):
    def __init__(self, corpus):
        FittedWithoutSteps.__init__(self)


class Mute(FittedWithoutSteps):
    window, needs = Still.window, Still.needs
    fit_to_corpus = sample = None

    def __init__(self, corpus):
        super().__init__()


class AtItsOwnRate(Still):
    def sample(self, batch, generator):
        return self.pose.expand(*batch.require("energy").shape[:2], 10, 3)


def trained(method, outputs, folder):
    given = [
        "model=knn",
        "trainer=cpu",
        "logger=none",
        "training.batch_size=4",
        "callbacks.progress_bar=null",
        "callbacks.render_samples=null",
        f"metrics.encoder={outputs.encoder}",
        f"outputs_dir={outputs.folder}",
        f"run_dir={folder}",
        "run_prefix=run",
        "study_name=study",
        *(f"choices.{name}=x" for name in ("model", "data", "ablation", "experiment", "study")),
    ]
    with command("train", *given) as cfg:
        cfg.model = {"_target_": f"{__name__}.{method.__name__}"}
        return run(cfg)


@pytest.fixture(scope="module")
def outputs(tmp_path_factory):
    return Outputs(tmp_path_factory.mktemp("outputs"))


@pytest.fixture
def prepared(outputs, monkeypatch):
    monkeypatch.setattr(StoreDataModule, "prepare_store", lambda self: Store(outputs.store))
    return outputs


def test_what_judges_read_a_method_need_not_declare(prepared, tmp_path):
    record = trained(Still, prepared, tmp_path / "run").record
    assert record["status"] == "ok"
    assert np.isfinite(record["epochs"][0]["val/fgd"])
    assert np.isfinite(record["final"]["windows"]["joint_mae"])
    assert np.isfinite(record["final"]["recordings"]["joint_mae"])


def test_samples_of_another_length_than_the_evaluation_frames_are_named(prepared, tmp_path):
    with pytest.raises(CospeechError, match=r"60, 10, 3\) where .* 45, 10, 3\)") as caught:
        trained(AtItsOwnRate, prepared, tmp_path / "run")
    assert "at_evaluation_rate" in caught.value.hint


@pytest.mark.parametrize(
    ("method", "problem", "help"),
    [
        (Short, "44 frames at 20 fps hold 33 frames at 15 fps", "windows of 45 frames or more"),
        (Windowless, "has no window or no needs", "a WindowSpec"),
        (Unsaved, "would lack corpus", "save_hyperparameters"),
        (Mute, "abstract class Mute .*begin", "mend"),
    ],
)
def test_what_could_not_be_judged_is_refused_before_the_corpus_is_prepared(
    method, problem, help, outputs, tmp_path, monkeypatch
):
    def prepare(self):
        raise AssertionError("the corpus is prepared")

    monkeypatch.setattr(StoreDataModule, "prepare_store", prepare)
    with pytest.raises(Exception, match=problem) as caught:
        trained(method, outputs, tmp_path / "run")
    sentence = as_sentence(caught.value)
    assert help in sentence.hint
    assert json.loads((tmp_path / "run" / "record.json").read_text())["status"] == "failed"


def test_the_least_length_is_said_as_it_is(outputs):
    refuse_unjudgeable("mine", LongEnough(outputs.facts))


def test_the_values_of_a_frechet_distance_are_those_that_it_computes():
    torch.manual_seed(0)
    distance = FrechetGestureDistance()
    windows = EvaluationWindows(torch.randn(40, 34, 10, 3), torch.randn(40, 32))
    distance.update(windows, windows)
    assert distance.compute().keys() == judgeable._OF_FGD | {VALUE}


@pytest.mark.parametrize(
    ("typed", "problem", "hint"),
    [
        (
            "~metrics.catalogue.fgd",
            "training.monitor=val/fgd: metrics.catalogue has no such metric",
            "leave metrics.catalogue.fgd as it is, or watch another:"
            " training.monitor=val/kernel_distance",
        ),
        (
            "metrics.catalogue.joint_mae=null callbacks.best.monitor=val/joint_mae",
            "callbacks.best.monitor=val/joint_mae: metrics",
            "joint_mae as it is, or watch another: callbacks.best.monitor=val/fgd",
        ),
        ("~metrics.catalogue.fgd training.monitor=val/fgd_mean_term", "fgd_mean_term", "gue.fgd "),
        ("~metrics.catalogue", "training.monitor=val/fgd: ", "keep it: leave metrics.cat"),
        ("model=knn_cgan ~metrics.catalogue.fgd", "makes values of its own of fgd", "gue.fgd as"),
        ("~metrics.catalogue.joint_mae", None, ""),
        ("training.monitor=val/my_own ~metrics.catalogue.fgd", None, ""),
        ("training.monitor=fgd ~metrics.catalogue.fgd", None, ""),
        (
            "~metrics.catalogue.fgd"
            " +metrics.catalogue.mine._target_=cospeech.metrics.fgd.FrechetGestureDistance",
            "training.monitor=val/fgd: metrics",
            "gue.fgd as",
        ),
        (
            "~metrics.catalogue.fgd training.monitor=val/mine_mean_term"
            " +metrics.catalogue.mine._target_=cospeech.metrics.fgd.FrechetGestureDistance",
            None,
            "",
        ),
    ],
)
def test_a_metric_that_checkpoints_are_chosen_by_is_there(
    typed, problem, hint, outputs, tmp_path, monkeypatch
):
    class Prepared(Exception):
        pass

    def prepare(self):
        raise Prepared

    monkeypatch.setattr(StoreDataModule, "prepare_store", prepare)
    model = () if "model=" in typed else ("model=trimodal",)
    wanted = Prepared if problem is None else ConfigError
    with pytest.raises(wanted) as caught:
        train(outputs.folder, *model, f"hydra.run.dir={tmp_path / 'run'}", *typed.split())
    if problem is not None:
        assert problem in caught.value.problem
        assert hint in caught.value.hint
