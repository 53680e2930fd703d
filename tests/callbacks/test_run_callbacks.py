"""The run's callbacks on a method small enough to know what they must report."""

import json
import logging
import signal

import pytest
import torch
from lightning import Callback, Trainer
from lightning.pytorch.callbacks import ModelCheckpoint

from callbacks.cost_estimate import CostEstimate
from callbacks.evaluate_fgd import EvaluateFGD
from callbacks.graceful_interrupt import GracefulInterrupt
from callbacks.progress_bar import EpochLines
from callbacks.render_samples import RenderSamples
from callbacks.run_record import WriteRunRecord
from callbacks.step_seed import SeedEachStep
from callbacks.stop_on_nan import StopOnNaN
from callbacks.throughput import Throughput
from cospeech.corpus.window_loader import WindowLoader
from cospeech.corpus.windows import WindowDataset, WindowSpec
from cospeech.errors import CospeechError
from cospeech.evaluation import standard_catalogue
from cospeech.experiment import RunContext, RunInterrupted
from cospeech.methods.base import GestureMethod
from cospeech.metrics.encoder import GestureEncoder, PoseAutoencoder
from cospeech.metrics.evaluation_windows import cut_windows
from cospeech.metrics.functional import frechet_distance, joint_mae
from cospeech.metrics.moments import feature_moments
from cospeech.motion.motion import Motion
from cospeech.motion.upper_body import UPPER_BODY
from cospeech.nn.checkpoints import WholeCheckpoints
from cospeech.reporting.record import RunRecord
from tests.corpora import make_store


class Shifted(GestureMethod):
    """Gives back the real motion with the left wrist 5 cm higher; learns one useless number."""

    window = WindowSpec(15, 34, 4, 10)
    needs = frozenset({"positions"})
    begin = None

    def __init__(self, nan_at: int | None = None):
        super().__init__()
        self.number = torch.nn.Parameter(torch.ones(()))
        self.nan_at = nan_at
        self.draws = []

    def configure_optimizers(self):
        return torch.optim.SGD([self.number], 0.1)

    def training_step(self, batch, batch_idx):
        self.draws.append(torch.rand(()).item())
        loss = self.number.square()
        if self.nan_at == batch_idx:
            loss = loss * float("nan")
        self.log("train/loss", loss, on_step=False, on_epoch=True)
        return {"train/loss": loss.detach()}

    def sample(self, batch, generator):
        positions = batch.positions.clone()
        positions[:, :, 6, 1] += 0.05
        return positions

    def generate(self, speech, speaker=None, seed_motion=None, controls=None, generator=None):
        frames = round(speech.duration * 15)
        return Motion(UPPER_BODY, 15.0, torch.zeros(frames, 10, 3).numpy())


@pytest.fixture
def run(tmp_path):
    store = make_store(tmp_path)
    torch.manual_seed(0)
    encoder = GestureEncoder(PoseAutoencoder(), store.facts()["mean_direction"])
    facts = {"id": "x", "model": "m", "data": "d", "ablation": "full", "seed": 0}
    facts["config"] = {"training": {"epochs": -1}}
    record = RunRecord(tmp_path / "run" / "record.json", facts)
    return RunContext(
        tmp_path / "run", store, encoder, standard_catalogue(), record, "python train.py"
    )


def last_checkpoint(run):
    """As configured: replaced after every epoch."""
    return ModelCheckpoint(
        run.folder / "checkpoints",
        "last",
        enable_version_counter=False,
        every_n_epochs=1,
        save_on_train_epoch_end=True,
    )


def loader(run, split):
    dataset = WindowDataset(run.store, split, Shifted.window, Shifted.needs)
    return WindowLoader(dataset, 8, seed=0, shuffle=split == "train", drop_last=split == "train")


def fit(run, method, callbacks, epochs=1, checkpoint=None):
    trainer = Trainer(
        max_epochs=epochs,
        plugins=[WholeCheckpoints()],
        accelerator="cpu",
        logger=False,
        enable_checkpointing=any(isinstance(c, ModelCheckpoint) for c in callbacks),
        enable_progress_bar=any(isinstance(c, EpochLines) for c in callbacks),
        enable_model_summary=False,
        num_sanity_val_steps=0,
        callbacks=callbacks,
        default_root_dir=str(run.folder),
    )
    trainer.fit(
        method,
        loader(run, "train"),
        loader(run, "val"),
        ckpt_path=checkpoint,
        weights_only=None if checkpoint is None else True,
    )
    return trainer


def test_fgd_is_that_of_all_validation_windows(run):
    trainer = fit(run, Shifted(), [EvaluateFGD(run)], epochs=2)
    dataset = loader(run, "val").dataset
    real = dataset.batch(range(len(dataset))).positions
    generated = real.clone()
    generated[:, :, 6, 1] += 0.05
    features = [feature_moments(run.encoder.encode_positions(p)) for p in (real, generated)]
    expected = frechet_distance(
        *features[0].mean_and_covariance(), *features[1].mean_and_covariance()
    )
    logged = trainer.callback_metrics
    assert logged["val/fgd"].item() == pytest.approx(expected.item(), rel=1e-4)
    terms = logged["val/fgd_mean_term"] + logged["val/fgd_covariance_term"]
    assert terms.item() == pytest.approx(logged["val/fgd"].item(), rel=1e-4)
    # one of ten joints is 5 cm off on one of three axes
    assert logged["val/joint_mae"].item() == pytest.approx(0.05 / 30, rel=1e-5)
    assert logged["val/joint_mae"].item() == pytest.approx(joint_mae(generated, real).item())
    assert logged["val/acceleration_error"].item() == pytest.approx(0, abs=1e-7)


def test_longer_windows_are_cut_into_those_of_the_evaluation_space():
    positions = torch.arange(2 * 75.0).reshape(2, 75, 1, 1).expand(2, 75, 10, 3)
    windows = cut_windows(positions)
    assert windows.shape == (10, 34, 10, 3)  # from frames 0, 10, 20, 30 and 40 of each item
    assert windows[:, 0, 0, 0].tolist() == [0, 10, 20, 30, 40, 75, 85, 95, 105, 115]
    assert windows[3, :, 4, 2].tolist() == list(range(30, 64))


def test_the_record_has_a_row_per_epoch_as_it_ends(run):
    fit(run, Shifted(), [EvaluateFGD(run), Throughput(), WriteRunRecord(run)], epochs=3)
    record = json.loads(run.record.path.read_text())
    assert [row["epoch"] for row in record["epochs"]] == [0, 1, 2]
    for row in record["epochs"]:
        assert row["val/fgd"] > 0
        assert row["train/windows_per_second"] > 0


def test_an_epoch_run_again_replaces_its_row(run):
    run.record.add_epoch(0, {"val/fgd": 3.0})
    run.record.add_epoch(1, {"val/fgd": 2.0})
    run.record.add_epoch(1, {"val/fgd": 1.0})
    values = json.loads(run.record.path.read_text())["epochs"]
    assert values == [{"epoch": 0, "val/fgd": 3.0}, {"epoch": 1, "val/fgd": 1.0}]


def test_a_nan_loss_stops_the_run_and_names_the_windows(run):
    with pytest.raises(CospeechError, match=r"train/loss became NaN.*epoch 0, batch 2"):
        fit(run, Shifted(nan_at=2), [StopOnNaN(run)])
    note = json.loads((run.folder / "nan_batch.json").read_text())
    assert note["batch"] == 2
    assert note["losses"] == {"train/loss": "nan"}
    expected = list(loader(run, "train"))[2].window_ids.tolist()
    assert [window["window"] for window in note["windows"]] == expected
    first = note["windows"][0]
    windows, window = loader(run, "train").dataset, first["window"]
    assert first["recording"] == run.store.recordings[windows.recordings[window]].id
    assert first["start_s"] == pytest.approx(windows.firsts[window] / 15)


def test_draws_depend_on_the_step_alone(run):
    first, second = Shifted(), Shifted()
    fit(run, first, [SeedEachStep(3)], epochs=2)
    torch.manual_seed(99)
    fit(run, second, [SeedEachStep(3)], epochs=2)
    assert first.draws == second.draws
    assert len(set(first.draws)) == len(first.draws)
    other = Shifted()
    fit(run, other, [SeedEachStep(4)], epochs=2)
    assert not set(other.draws) & set(first.draws)


def test_a_log_file_gets_a_line_per_epoch_with_the_fgd(run, capsys):
    trainer = fit(run, Shifted(), [EvaluateFGD(run), EpochLines()], epochs=2)
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[:2] for line in lines] == [["epoch", "0/1"], ["epoch", "1/1"]]
    assert f"val/fgd {trainer.callback_metrics['val/fgd'].item():.4g}" in lines[-1]


def test_an_epoch_entered_in_its_middle_has_a_sane_clock(run, tmp_path, capsys):
    class Stop(Callback):
        def on_train_batch_end(self, trainer, pl_module, outputs, batch, batch_idx):
            if batch_idx == 2:
                trainer.save_checkpoint(tmp_path / "middle.ckpt", weights_only=False)
                raise RuntimeError("stopped")

    with pytest.raises(RuntimeError, match="stopped"):
        fit(run, Shifted(), [Stop()])
    trainer = Trainer(
        max_epochs=1,
        accelerator="cpu",
        logger=False,
        enable_checkpointing=False,
        enable_model_summary=False,
        num_sanity_val_steps=0,
        callbacks=[CostEstimate(run, quick=None), EpochLines()],
        default_root_dir=str(run.folder),
    )
    trainer.fit(
        Shifted(),
        loader(run, "train"),
        loader(run, "val"),
        ckpt_path=tmp_path / "middle.ckpt",
        weights_only=True,
    )
    said = capsys.readouterr().out
    (line,) = [line for line in said.splitlines() if line.startswith("epoch 0/0")]
    assert float(line.split()[2]) < 60
    assert " h of training left" not in said


def test_the_cost_names_steps_seconds_and_the_quick_variant(run, capsys):
    fit(run, Shifted(), [CostEstimate(run, quick="experiment=y")], epochs=2)
    said = capsys.readouterr().out
    assert "2 epochs x 6 steps = 12 steps" in said
    assert "s per step: about" in said
    assert "add experiment=y" in said


def test_without_a_number_of_epochs_the_method_tells_what_is_left(run, capsys):
    class Knows(Shifted):
        """Ends by itself after fourteen steps."""

        steps_left, in_last_stage = 14, True

        def training_step(self, batch, batch_idx):
            self.steps_left -= 1
            self.trainer.should_stop = self.steps_left <= 0
            return super().training_step(batch, batch_idx)

    fit(run, Knows(), [CostEstimate(run, quick=None), EpochLines()], epochs=-1)
    said = capsys.readouterr().out
    assert "epochs of 6 steps, about 14 steps" in said
    assert "\nepoch 2  " in said  # not "2/-2"


class Learns(Shifted):
    """Takes a step for every batch, and a random one."""

    def training_step(self, batch, batch_idx):
        losses = super().training_step(batch, batch_idx)
        optimizer = self.optimizers()
        optimizer.zero_grad()
        self.manual_backward(self.number.square() * self.draws[-1])
        optimizer.step()
        return losses


def test_a_damaged_last_checkpoint_costs_an_epoch_and_not_the_run(run, caplog):
    straight = Learns()
    fit(run, straight, [SeedEachStep(3)], epochs=3)
    fit(run, Learns(), [SeedEachStep(3), last_checkpoint(run)], epochs=2)
    path = run.folder / "checkpoints" / "last.ckpt"
    path.write_bytes(path.read_bytes()[:-100])
    resumed = Learns()
    with caplog.at_level(logging.WARNING):
        fit(run, resumed, [SeedEachStep(3), last_checkpoint(run)], epochs=3, checkpoint=path)
    assert any("last.previous.ckpt (epoch 0" in message for message in caplog.messages)
    assert resumed.draws == straight.draws[6:]  # from the second epoch on
    assert torch.equal(resumed.number, straight.number)


class StopsItself(Learns):
    """Ends in its third epoch, as methods do that know what they need."""

    def training_step(self, batch, batch_idx):
        self.trainer.should_stop = self.global_step >= 13 or self.current_epoch > 4
        return super().training_step(batch, batch_idx)


def test_a_training_that_has_ended_gains_no_empty_epoch(run):
    fit(run, StopsItself(), [WriteRunRecord(run), last_checkpoint(run)], epochs=-1)
    values = json.loads(run.record.path.read_text())
    assert values["fit"] == {"asked": -1, "ended": 3}
    assert [row["epoch"] for row in values["epochs"]] == [0, 1, 2]
    path = run.folder / "checkpoints" / "last.ckpt"
    resumed = StopsItself()
    fit(run, resumed, [WriteRunRecord(run)], epochs=values["fit"]["ended"], checkpoint=path)
    assert resumed.draws == []
    assert json.loads(run.record.path.read_text()) == values


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_in_the_middle_of_an_epoch_saves_and_stops(run, number):
    class Signal(Callback):
        def on_train_batch_start(self, trainer, pl_module, batch, batch_idx):
            if batch_idx == 2:
                signal.raise_signal(number)

    outer = signal.signal(number, signal.SIG_DFL)  # pytest itself may be run by nohup
    try:
        with pytest.raises(RunInterrupted, match=r"last\.ckpt is saved"):
            fit(run, Learns(), [GracefulInterrupt(run), Signal()])
        assert signal.getsignal(number) is signal.SIG_DFL
    finally:
        signal.signal(number, outer)
    path = run.folder / "checkpoints" / "last.ckpt"
    assert torch.load(path, weights_only=True)["global_step"] == 3


def test_a_sample_that_cannot_be_made_is_a_warning(run, caplog):
    class Mute(Learns):
        def generate(self, speech, **given):
            raise RuntimeError("no gestures today")

    method = Mute()
    rendering = RenderSamples(run, every_n_epochs=1, clips=1, seconds=2, video=False)
    assert rendering.spans
    with caplog.at_level(logging.WARNING):
        fit(run, method, [rendering, WriteRunRecord(run)], epochs=2)
    told = [message for message in caplog.messages if "no gestures today" in message]
    assert len(told) == 2
    assert len(run.record.values["epochs"]) == 2
    assert run.record.values["samples"] == []
