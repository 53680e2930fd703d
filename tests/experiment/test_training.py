"""A run's order: what is judged, when its record says that it is done, and how it goes on."""

import json
import logging
from types import SimpleNamespace

import pytest
import torch
from filelock import FileLock
from lightning import LightningModule

from cospeech.corpus.facts import placeholder_facts
from cospeech.corpus.features import FIELDS
from cospeech.corpus.store import Store
from cospeech.errors import ConfigError, CospeechError
from cospeech.experiment import run, training
from cospeech.experiment.building import build
from cospeech.experiment.context import RunInterrupted
from cospeech.judges.motion_autoencoder import MotionAutoencoder
from cospeech.methods.trimodal import Trimodal
from cospeech.metrics.encoder import packaged_encoder, save_encoder
from cospeech.reporting.record import RunRecord, write_json
from data_modules.base import StoreDataModule
from tests.runs import CONF, Outputs, command
from tests.trainings import train

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning", "ignore::FutureWarning")


@pytest.fixture
def outputs(tmp_path, monkeypatch):
    made = Outputs(tmp_path / "outputs")
    monkeypatch.setattr(StoreDataModule, "prepare_store", lambda self: Store(made.store))
    return made


@pytest.fixture
def trained_epochs(monkeypatch):
    epochs = []
    monkeypatch.setattr(
        Trimodal, "on_train_epoch_start", lambda self: epochs.append(self.current_epoch)
    )
    return epochs


def trained(outputs, *more):
    given = (
        "model=trimodal",
        "model.hidden_size=8",
        "model.layers=1",
        "training.epochs=1",
        "training.batch_size=8",
        "trainer=cpu",
        "+trainer.limit_train_batches=1",
        "+trainer.limit_val_batches=1",
        "logger=none",
        "callbacks.render_samples=null",
        "callbacks.progress_bar=null",
        f"metrics.encoder={outputs.encoder}",
        f"hydra.run.dir={outputs.folder / 'run'}",
    )
    return train(outputs.folder, *given, *more)


def record_of(outputs):
    return json.loads((outputs.folder / "run" / "record.json").read_text())


def test_the_best_weights_are_judged_and_ok_is_said_when_all_is_recorded(outputs, monkeypatch):
    def spoil(self):
        for parameter in self.parameters():
            torch.nn.init.zeros_(parameter)

    def write(self):
        written.append((self.values["status"], self.values["final"], self.values["references"]))
        really_write(self)

    written, really_write = [], RunRecord.write
    monkeypatch.setattr(RunRecord, "write", write)
    monkeypatch.setattr(Trimodal, "on_train_end", spoil)  # after the checkpoints
    result = trained(outputs)
    best = torch.load(outputs.folder / "run" / "checkpoints" / "best.ckpt", weights_only=True)
    for name, value in result.model.state_dict().items():
        assert torch.equal(value, best["state_dict"][name]), name
    done = [(final, references) for status, final, references in written if status == "ok"]
    assert done
    for final, references in done:
        assert final["windows"].keys() & final["recordings"].keys()
        assert references


def test_a_folder_that_another_process_is_at_work_in_is_left_alone(outputs):
    folder = outputs.folder / "run"
    folder.mkdir()
    with (
        FileLock(str(folder / ".lock")),
        pytest.raises(ConfigError, match="another process is at work"),
    ):
        trained(outputs)
    assert not (folder / "record.json").exists()


def test_a_run_goes_on_with_its_own_corpus_alone(outputs):
    folder = outputs.folder / "run"
    folder.mkdir()
    write_json(folder / "record.json", {"status": "interrupted", "data_fingerprint": 64 * "1"})
    with pytest.raises(ConfigError, match="the corpus has changed"):
        trained(outputs, "ckpt_path=last")


def test_a_run_that_the_user_stops_says_so(outputs, monkeypatch):
    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(training, "_run", stopped)
    with pytest.raises(RunInterrupted):
        trained(outputs)
    assert record_of(outputs)["status"] == "interrupted"


def test_what_comes_after_a_run_is_done_takes_nothing_back(tmp_path):
    record = RunRecord(tmp_path / "record.json", {"id": "a", "config": {}})
    record.finish("ok")
    training._close(record, "interrupted", "stopped")
    assert json.loads((tmp_path / "record.json").read_text())["status"] == "ok"


def test_of_a_last_checkpoint_that_is_gone_the_one_before_is_taken(tmp_path):
    cfg = SimpleNamespace(ckpt_path="last")
    assert training._checkpoint(cfg, tmp_path) is None
    (tmp_path / "checkpoints").mkdir()
    (tmp_path / "checkpoints" / "last.previous.ckpt").touch()
    assert training._checkpoint(cfg, tmp_path) == str(tmp_path / "checkpoints" / "last.ckpt")


def test_a_run_whose_training_has_ended_goes_on_behind_it(
    outputs, trained_epochs, monkeypatch, caplog
):
    with monkeypatch.context() as patched:
        patched.setattr(training, "evaluate_recordings", lambda *_, **__: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            trained(outputs)
    failed = record_of(outputs)
    assert failed["status"] == "failed"
    assert failed["fit"] == {"asked": 1, "ended": 1}
    failed["hardware"]["torch_threads"] = 99
    failed["fit"]["asked"] = 2  # as of a method that ends its training itself
    (outputs.folder / "run" / "record.json").write_text(json.dumps(failed))
    trained_epochs.clear()
    with caplog.at_level(logging.WARNING):
        trained(outputs, "ckpt_path=last", "training.epochs=2")
    assert "torch_threads: 99 before, 1 from here on, so the run won't end bit-equal" in caplog.text
    assert trained_epochs == []
    assert record_of(outputs)["status"] == "ok"
    # Asked for more epochs, it trains those.
    trained(outputs, "ckpt_path=last", "training.epochs=3")
    assert trained_epochs == [1, 2]
    longer = record_of(outputs)
    assert [row["epoch"] for row in longer["epochs"]] == [0, 1, 2]
    assert longer["fit"] == {"asked": 3, "ended": 3}
    # Numbers of two encoders would not belong together.
    torch.manual_seed(5)
    save_encoder(MotionAutoencoder(outputs.facts).encoder("another"), outputs.encoder)
    with pytest.raises(ConfigError, match="encoder of the evaluation has changed"):
        trained(outputs, "ckpt_path=last", "training.epochs=4")


def test_the_embedded_corpus_is_judged_by_what_ships_and_says_so(outputs, caplog):
    with caplog.at_level(logging.INFO):
        trained(outputs, "metrics.encoder=${data.encoder}", "test=false")
    record, sha256 = record_of(outputs), packaged_encoder().sha256
    assert record["encoder"] == {"sha256": sha256, "name": "packaged"}
    assert record["config"]["metrics"]["encoder"] == "packaged"
    assert f"judged by the encoder {sha256[:12]} (packaged)" in caplog.text
    assert not (outputs.store / "encoders").exists()
    # Rows are kept for the encoder that they were taken with.
    (rows,) = (outputs.store / "references").iterdir()
    assert rows.name.startswith(f"test-{sha256[:12]}-")


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("model=trimodal model.layers=0", "layers=0: must be from 1"),
        ("model=multi_adversary +model.adversaries.phases.weight=1", "phases"),
        ("model=knn model.k=0", "model.k=0: must be at least 1"),
        ("model=multi_adversary data=ted data.root=x", r"gesture phases \(the field phases\)"),
    ],
)
def test_a_setting_of_the_method_is_checked_before_the_corpus_is_prepared(
    setting, message, tmp_path, monkeypatch
):
    def prepare(self):
        raise AssertionError("the corpus is prepared")

    monkeypatch.setattr(StoreDataModule, "prepare_store", prepare)
    given = (f"outputs_dir={tmp_path}", f"run_dir={tmp_path / 'run'}", *setting.split())
    choices = [f"choices.{name}=x" for name in ("model", "data", "ablation", "experiment", "study")]
    given = (*given, *choices, "run_prefix=run", "study_name=study")
    with command("train", *given) as cfg, pytest.raises(ConfigError, match=message):
        run(cfg)
    assert json.loads((tmp_path / "run" / "record.json").read_text())["status"] == "failed"


@pytest.mark.parametrize("name", [path.stem for path in (CONF / "model").glob("*.yaml")])
def test_every_model_can_be_built_without_a_corpus(name):
    with command("train", f"model={name}") as cfg:
        try:
            built = build(cfg.model, corpus=placeholder_facts())
        except CospeechError as error:
            if "need the extra" in error.problem:
                pytest.skip(error.problem)
            raise
    assert isinstance(built, LightningModule)
    assert built.needs <= FIELDS.keys()
