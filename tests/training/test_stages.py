"""The stages of a training as pure values, and a small training that goes through them."""

from typing import ClassVar

import pytest
import torch
from lightning import Trainer
from torch import nn
from torch.utils.data import DataLoader

from cospeech.training.losses import WeighedLosses
from cospeech.training.products import Products
from cospeech.training.stages import FINISHED, Progress, Schedule
from cospeech.training.staging import TrainsInStages
from cospeech.training.steps import descend, log_losses

SCHEDULE = Schedule(("first", "left_out", "open", "last"), {"first": 2, "open": None, "last": 4})


def test_stages_follow_one_another_but_for_those_left_out_or_done():
    assert SCHEDULE.first() == "first"
    assert SCHEDULE.next_after("first") == "open"
    assert SCHEDULE.first({"first", "open"}) == "last"
    assert SCHEDULE.next_after("first", {"open"}) == "last"
    assert SCHEDULE.next_after("last") == FINISHED
    assert SCHEDULE.next_after("open", {"last"}) == FINISHED


def test_stages_are_numbered_from_one_with_those_left_out():
    assert [SCHEDULE.number(stage) for stage in ("first", "open", "last", FINISHED)] == [1, 3, 4, 5]


def test_steps_left_are_of_this_stage_and_those_that_follow():
    def left(stage, step, done=()):
        return SCHEDULE.steps_left(Progress(stage, step), done, {"open": 7})

    assert left("first", 0) == 2 + 7 + 4
    assert left("first", 1) == 1 + 7 + 4
    assert left("first", 1, {"open"}) == 1 + 4
    assert left("open", 3) == 7 + 4
    assert left("last", 3) == 1
    assert left(FINISHED, 0) == 0


class TwoStages(TrainsInStages):
    """A line is fitted in the first stage, and its offset in the second."""

    product_settings: ClassVar = {"slope": ("slope_steps",)}

    def __init__(self, folder, slope_steps=3, offset_steps=2, rate=0.1):
        super().__init__()
        self.automatic_optimization = False
        self.save_hyperparameters("slope_steps", "rate", logger=False)
        self.slope, self.offset = nn.Parameter(torch.ones(1)), nn.Parameter(torch.zeros(1))
        self.products = Products(None if folder is None else str(folder))
        lengths = {"slope": slope_steps, "offset": offset_steps}
        self.schedule = Schedule(("slope", "offset"), lengths)
        self.progress, self.done, self.seed = Progress("slope"), frozenset(), 7
        self.stages, self.measured = [], 0

    def configure_optimizers(self):
        return [torch.optim.SGD([weight], 0.1) for weight in (self.slope, self.offset)]

    def training_step(self, batch, batch_idx):
        self.stages.append(self.progress.stage)
        losses = WeighedLosses()
        losses.add(
            "error", 1, lambda: (self.slope * batch + self.offset - 3 * batch).square().sum()
        )
        descend(self, self.optimizers()[self.progress.stage == "offset"], losses.total)
        logged = log_losses(self, losses.values, 1)
        self.finish_step()
        return logged

    def measure_corpus(self):
        self.measured += 1
        return {"corpus": "numbers"}

    def product(self, stage):
        return {"slope": self.slope.detach().clone()}

    def take_product(self, stage, product):
        self.slope.data.copy_(product["slope"])


def fit(method, epochs=9, checkpoint=None):
    trainer = Trainer(
        max_epochs=epochs,
        accelerator="cpu",
        logger=False,
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
    )
    batches = DataLoader(torch.tensor([0.5, 1.0]), batch_size=1)
    trainer.fit(method, batches, ckpt_path=checkpoint, weights_only=True)
    return trainer


def test_a_training_goes_through_its_stages_and_stops_by_itself():
    method = TwoStages(None)
    assert (method.steps_left, method.in_last_stage) == (5, False)
    trainer = fit(method)
    assert method.stages == ["slope"] * 3 + ["offset"] * 2
    assert (method.steps_left, method.in_last_stage) == (0, True)
    assert trainer.current_epoch < 9
    assert float(trainer.callback_metrics["train/stage"]) == 2
    fit(method)
    assert len(method.stages) == 5


def test_a_later_run_of_the_same_settings_begins_after_what_is_done(tmp_path):
    first, later = TwoStages(tmp_path), TwoStages(tmp_path)
    fit(first)
    fit(later)
    assert later.stages == ["offset"] * 2
    assert torch.equal(later.slope, first.slope)
    for changed in (TwoStages(tmp_path, slope_steps=4), TwoStages(tmp_path)):
        changed.seed += changed.hparams.slope_steps == 3
        fit(changed)
        assert changed.stages[0] == "slope"
    unrelated = TwoStages(tmp_path, rate=0.5)
    fit(unrelated)
    assert unrelated.stages == ["offset"] * 2


@pytest.mark.parametrize("epochs", [1, 2])
def test_a_killed_run_goes_on_where_it_stood_whatever_the_folder_holds(tmp_path, epochs):
    straight = TwoStages(None)
    fit(straight)
    killed = TwoStages(None)
    fit(killed, epochs).save_checkpoint(tmp_path / "a.ckpt")
    fit(TwoStages(tmp_path))
    resumed = TwoStages(tmp_path)
    fit(resumed, checkpoint=tmp_path / "a.ckpt")
    assert killed.stages + resumed.stages == straight.stages
    assert resumed.measured == 0
    assert torch.equal(resumed.slope, straight.slope)
    assert torch.equal(resumed.offset, straight.offset)


def test_too_few_epochs_are_said_at_the_start(caplog):
    fit(TwoStages(None), epochs=2)
    assert "2 epochs hold 4 more steps, and the stages need 5 or more" in caplog.text


def test_what_a_product_took_the_place_of_is_not_done_by_a_resumed_run(tmp_path):
    killed = TwoStages(None)
    killed.done = frozenset({"offset"})
    fit(killed, epochs=1).save_checkpoint(tmp_path / "a.ckpt")
    resumed = TwoStages(None)
    fit(resumed, checkpoint=tmp_path / "a.ckpt")
    assert killed.stages + resumed.stages == ["slope"] * 3
    assert (resumed.done, resumed.steps_left) == ({"offset"}, 0)
